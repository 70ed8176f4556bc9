"""A recording in one file, indexed from front to back: what stands before damage is kept."""

from __future__ import annotations

from abc import abstractmethod
from pathlib import Path
from typing import BinaryIO, NamedTuple

from siloscope.errors import InputError
from siloscope.io.recordings.recording import Entry, Recording, Topic, wire
from siloscope.io.recordings.wire import Wire


class Place(NamedTuple):
    """Where a message lies: from `start` to `end` of the file, or of an unpacked chunk."""

    chunk: int | None
    start: int
    end: int


class FileRecording(Recording):
    """A container that this package reads by itself.

    A subclass indexes the messages in `_index`, which raises `InputError` where the file breaks off, and unpacks a
    chunk of messages in `_unpack`, where it has such. It calls `_read_index` when its own attributes are set.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.file: BinaryIO = path.open("rb")
        self.size = path.stat().st_size
        self._unpacked: tuple[int, bytes] | None = None

    @abstractmethod
    def _index(self) -> None:
        """Declares the topics and their entries."""

    def _unpack(self, number: int) -> bytes:
        """The messages of a chunk."""
        raise NotImplementedError

    def _read_index(self) -> None:
        try:
            self._index()
        except InputError as error:
            self.damage = f"{self.name}: {error}"
        except BaseException:
            self.file.close()
            raise
        for topic in self.topics.values():
            topic.entries.sort(key=lambda entry: entry.time_ns)

    def _bytes(self, at: int, size: int) -> bytes:
        """Bytes of the file; nothing is allocated for more than there are."""
        if not 0 <= size <= self.size - at:
            raise InputError("the recording is cut off or was never closed; frames before are read")
        self.file.seek(at)
        return self.file.read(size)

    def _chunk(self, number: int) -> bytes:
        if self._unpacked is None or self._unpacked[0] != number:
            self._unpacked = number, self._unpack(number)
        return self._unpacked[1]

    def read(self, topic: Topic, entry: Entry) -> Wire:
        """One message."""
        chunk, start, end = entry.where
        if chunk is None:
            return wire(topic.encoding, self._bytes(start, end - start))
        return wire(topic.encoding, memoryview(self._chunk(chunk))[start:end])

    def close(self) -> None:
        """Lets go of the file."""
        self._unpacked = None
        self.file.close()
