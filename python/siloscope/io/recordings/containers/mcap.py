"""MCAP, the container of Foxglove and of ROS 2, read from front to back; cut-off files give what is there."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

from siloscope.errors import InputError
from siloscope.io.recordings.containers.file_recording import FileRecording, Place
from siloscope.io.recordings.dialects import source
from siloscope.io.recordings.recording import Entry, Topic, decompress
from siloscope.io.recordings.wire import Wire
from siloscope.io.source import Format, FrameSource, Options

MAGIC = b"\x89MCAP0\r\n"
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END = 2, 3, 4, 5, 6, 15


class Mcap(FileRecording):
    """An MCAP file with ROS 1 or CDR messages."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._schemas: dict[int, tuple[str, bytes]] = {}
        self._channels: dict[int, Topic] = {}
        self._chunks: list[tuple[str, int, int, int, int]] = []
        self._read_index()

    def _index(self) -> None:
        at = len(MAGIC)
        while True:
            kind, size = struct.unpack("<BQ", self._bytes(at, 9))
            at += 9
            if kind in (_FOOTER, _DATA_END):
                return
            if kind == _CHUNK:
                self._add_chunk(at, size)
            elif kind == _MESSAGE:
                self._add_message(Wire(self._bytes(at, min(size, 22))), Place(None, at + 22, at + size))
            elif kind in (_SCHEMA, _CHANNEL):
                self._define(kind, self._bytes(at, size))
            at += size
            if at > self.size:
                raise InputError("the recording is cut off or was never closed; frames before are read")

    def _define(self, kind: int, data: bytes | memoryview) -> None:
        record = Wire(data)
        number = record.u16()
        if kind == _SCHEMA:
            name, _ = record.string(), record.string()
            self._schemas[number] = name, bytes(record.blob())
            return
        schema = record.u16()
        topic, encoding = record.string(), record.string()
        name, described = self._schemas.get(schema, ("", b""))
        self._channels[number] = self.declare(topic, name, encoding, described if encoding == "protobuf" else b"")

    def _add_chunk(self, at: int, size: int) -> None:
        head = Wire(self._bytes(at, min(size, 64, self.size - at)))
        head.take(16)
        plain_size, crc, compression, stored = head.u64(), head.u32(), head.string(), head.u64()
        if head.at + stored > size:
            raise InputError("a chunk of messages is damaged; frames before are read")
        self._chunks.append((compression, at + head.at, stored, plain_size, crc))
        number = len(self._chunks) - 1
        cut = at + head.at + stored > self.size
        for kind, start, end in _records(self._chunk(number), cut):
            record = memoryview(self._chunk(number))[start:end]
            if kind == _MESSAGE:
                self._add_message(Wire(record), Place(number, start + 22, end))
            elif kind in (_SCHEMA, _CHANNEL):
                self._define(kind, record)

    def _unpack(self, number: int) -> bytes:
        compression, at, stored, size, crc = self._chunks[number]
        cut = at + stored > self.size
        data = self._bytes(at, min(stored, self.size - at))
        plain = decompress(compression, data, size, cut=cut)
        if crc and not cut and zlib.crc32(plain) != crc:
            raise InputError("a chunk of messages fails its checksum; frames before are read")
        return plain

    def _add_message(self, head: Wire, where: Place) -> None:
        topic = self._channels.get(head.u16())
        head.u32()
        time_ns = head.u64()
        if topic:
            topic.entries.append(Entry(time_ns, where))


def _records(chunk: bytes, cut: bool) -> Iterator[tuple[int, int, int]]:
    """Kind, and the data's start and end, of every record in a chunk; stops quietly where it is cut."""
    at = 0
    while at + 9 <= len(chunk):
        kind, size = struct.unpack_from("<BQ", chunk, at)
        start, at = at + 9, at + 9 + size
        if at <= len(chunk):
            yield kind, start, at
    if at != len(chunk) and not cut:
        raise InputError("a chunk of messages is damaged; frames before are read")


def _open(path: Path, options: Options) -> FrameSource:
    return source(path, "mcap", options, Mcap(path))


FORMAT = Format("mcap", lambda head, path: head.startswith(MAGIC), _open)
