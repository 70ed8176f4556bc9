"""The container of ROS 1 bags, version 2.0, read from front to back.

Going by the records themselves, not by the index at the file's end, it also reads bags that were cut off or never
closed, and those of recorders that take liberties with the index and the connection records.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from siloscope.errors import InputError
from siloscope.io.recordings.containers.file_recording import FileRecording, Place
from siloscope.io.recordings.dialects import source
from siloscope.io.recordings.recording import Entry, Topic, decompress
from siloscope.io.source import Format, FrameSource, Options

MAGIC = b"#ROSBAG V2.0\n"
_MESSAGE, _HEADER, _CHUNK, _CONNECTION = 2, 3, 5, 7

Fields = dict[str, bytes]


class _Record(NamedTuple):
    fields: Fields
    at: int
    """Where its data start."""
    size: int


class Rosbag1(FileRecording):
    """A ROS 1 bag."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._connections: dict[int, Topic] = {}
        self._chunks: list[tuple[str, int, int, int, bool]] = []
        self._read_index()

    def _index(self) -> None:
        at, index_at = len(MAGIC), 0
        while at < self.size:
            record = self._record(at)
            kind = record.fields.get("op", b"")[:1]
            if kind == bytes([_HEADER]):
                index_at = _number(record.fields, "index_pos", "<Q")
            elif kind == bytes([_CHUNK]):
                self._add_chunk(record)
            elif kind == bytes([_CONNECTION]):
                self._connect(record.fields, self._data(record))
            at = record.at + record.size
            if at > self.size:
                raise InputError(
                    f"the recording is cut off: {at - self.size} bytes are missing; frames before are read"
                )
        if not index_at:
            raise InputError("the recording was never closed, so its end may be missing; frames in it are read")
        if index_at > self.size:
            raise InputError("the recording is cut off at its end; frames before are read")

    def _record(self, at: int) -> _Record:
        head_size = self._length(at)
        head = self._bytes(at + 4, head_size)
        return _Record(_fields(head), at + 8 + head_size, self._length(at + 4 + head_size))

    def _length(self, at: int) -> int:
        return int(struct.unpack("<I", self._bytes(at, 4))[0])

    def _data(self, record: _Record) -> bytes:
        return self._bytes(record.at, record.size)

    def _add_chunk(self, record: _Record) -> None:
        compression = record.fields.get("compression", b"none").decode("ascii", "replace")
        size = _number(record.fields, "size", "<I")
        cut = record.at + record.size > self.size
        stored = min(record.size, self.size - record.at)
        self._chunks.append((compression, record.at, stored, size, cut))
        number = len(self._chunks) - 1
        for fields, start, end in _records(self._chunk(number), cut):
            if fields.get("op") == bytes([_CONNECTION]):
                self._connect(fields, self._chunk(number)[start:end])
            elif fields.get("op") == bytes([_MESSAGE]):
                self._add_message(fields, Place(number, start, end))

    def _unpack(self, number: int) -> bytes:
        compression, at, stored, size, cut = self._chunks[number]
        return decompress(compression, self._bytes(at, stored), size, cut=cut)

    def _connect(self, fields: Fields, data: bytes) -> None:
        # Recorders differ in which of the two places holds the topic.
        told = {**_fields(data), **fields}
        name, kind = (told.get(key, b"").decode("utf-8", "replace") for key in ("topic", "type"))
        if name:
            self._connections[_number(fields, "conn", "<I")] = self.declare(name, kind, "ros1")

    def _add_message(self, fields: Fields, where: Place) -> None:
        topic = self._connections.get(_number(fields, "conn", "<I"))
        if topic:
            seconds, nanoseconds = struct.unpack("<II", fields.get("time", bytes(8))[:8].ljust(8, b"\0"))
            topic.entries.append(Entry(seconds * 1_000_000_000 + nanoseconds, where))


def _records(chunk: bytes, cut: bool) -> Iterator[tuple[Fields, int, int]]:
    """Header fields and the data's start and end of every record in a chunk; stops quietly where it is cut."""
    at = 0
    while at < len(chunk):
        try:
            head = _part(chunk, at)
            start = at + 8 + len(head)
            end = start + struct.unpack_from("<I", chunk, start - 4)[0]
            if end > len(chunk):
                raise InputError("a record runs over the end of its chunk")
            fields = _fields(head)
        except (struct.error, InputError):
            if cut:
                return
            raise InputError("a chunk of messages is damaged; frames before are read") from None
        yield fields, start, end
        at = end


def _part(data: bytes, at: int) -> bytes:
    (size,) = struct.unpack_from("<I", data, at)
    part = data[at + 4 : at + 4 + size]
    if len(part) < size:
        raise InputError("a record runs over the end of its chunk")
    return part


def _fields(head: bytes) -> Fields:
    """Fields ``name=value`` of a record's header."""
    fields: Fields = {}
    at = 0
    while at < len(head):
        try:
            field = _part(head, at)
        except (struct.error, InputError):
            raise InputError("a record's header is damaged; frames before are read") from None
        name, _, value = field.partition(b"=")
        fields[name.decode("ascii", "replace")] = value
        at += 4 + len(field)
    return fields


def _number(fields: Fields, name: str, code: str) -> int:
    try:
        return int(struct.unpack(code, fields.get(name, b""))[0])
    except struct.error:
        raise InputError(f"a record has no {name}; frames before are read") from None


def _open(path: Path, options: Options) -> FrameSource:
    return source(path, "bag", options, Rosbag1(path))


FORMAT = Format("bag", lambda head, path: head.startswith(MAGIC), _open)
