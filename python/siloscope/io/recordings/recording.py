"""What every recording gives, whatever its container: topics with their messages, read one at a time."""

from __future__ import annotations

import bz2
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple, ParamSpec, TypeVar

from siloscope.errors import InputError
from siloscope.io.recordings.wire import Buffer, Cdr, Wire

MAX_CHUNK = 1 << 30
"""Largest chunk of messages taken for real, in bytes."""

_STEP = 1 << 20
_ZSTD = b"\x28\xb5\x2f\xfd"

P = ParamSpec("P")
T = TypeVar("T")


class Entry(NamedTuple):
    """One message of a recording: when it was recorded, and where it is."""

    time_ns: int
    where: Any


class Topic(NamedTuple):
    """A named sequence of messages of one type; `type` is without ROS 2's ``/msg/``."""

    name: str
    type: str
    encoding: str
    """``ros1``, ``cdr``, ``protobuf`` or ``json``; others are not read."""
    entries: list[Entry]
    schema: bytes = b""
    """What describes its messages, for Protocol Buffers a ``FileDescriptorSet``."""


class Recording(ABC):
    """A container of messages, indexed on opening. Close it when done.

    Attributes
    ----------
    name : str
        The file, for messages.
    topics : dict of str to Topic
        By the topic's name, in the order of the file.
    damage : str or None
        Why messages may be missing at the end: the file was cut off, or never closed.
    """

    def __init__(self, path: Path) -> None:
        self.name = str(path)
        self.topics: dict[str, Topic] = {}
        self.damage: str | None = None

    @abstractmethod
    def read(self, topic: Topic, entry: Entry) -> Wire:
        """One message; raises `InputError` where it can't be read any more."""

    @abstractmethod
    def close(self) -> None:
        """Lets go of the file."""

    def declare(self, name: str, type: str, encoding: str, schema: bytes = b"") -> Topic:
        """The topic of this name, made where it is new."""
        plain = type.replace("/msg/", "/")
        return self.topics.setdefault(name, Topic(name, plain, encoding, [], schema))

    def of_type(self, *types: str) -> Iterator[Topic]:
        """Topics of these types that have messages."""
        return (topic for topic in self.topics.values() if topic.type in types and topic.entries)

    def first(self, name: str) -> Wire | None:
        """The first message of a topic, or None."""
        topic = self.topics.get(name)
        return self.read(topic, topic.entries[0]) if topic and topic.entries else None


def wire(encoding: str, data: Buffer) -> Wire:
    """A message in its encoding; raises `InputError` for one that is not read."""
    if encoding == "ros1":
        return Wire(data)
    if encoding == "cdr":
        return Cdr(_unpacked(bytes(data)) if data[:4] == _ZSTD else data)
    if encoding in ("protobuf", "json"):
        return Wire(data)
    raise InputError(f"messages are encoded as '{encoding}'; read are ros1, cdr, protobuf and json")


def _unpacked(data: bytes) -> bytes:
    """A message that the recorder compressed by itself (``--compression-mode message``)."""
    from siloscope.io import zstandard

    size = zstandard.content_size(data)
    if size is None:
        raise InputError("a compressed message does not tell its size")
    return decompress("zstd", data, size)


def decompress(compression: str, data: bytes, size: int, *, cut: bool = False) -> bytes:
    """Decompresses a chunk of messages.

    Grows with what really comes out, so a wrong declared `size` allocates nothing. With `cut`, gives what can be had
    of a chunk whose end is missing.

    Raises
    ------
    InputError
        For an unknown compression, damaged data, or another size than declared.
    """
    if size > MAX_CHUNK:
        raise InputError(f"a chunk of messages is declared {size} bytes large")
    steps = _steps(compression, data)
    parts: list[bytes] = []
    have = 0
    try:
        while have < size and (part := next(steps, b"")):
            parts.append(part)
            have += len(part)
    except (OSError, EOFError, RuntimeError, ValueError) as error:
        if not cut:
            raise InputError(f"a chunk of messages is damaged ({error})") from None
    if have != size and not cut:
        raise InputError(f"a chunk of messages is declared {size} bytes large but has {have}")
    return b"".join(parts)


def _steps(compression: str, data: bytes) -> Iterator[bytes]:
    if compression in ("", "none"):
        return iter([data])
    if compression == "bz2":
        return _pulled(bz2.BZ2Decompressor(), data)
    if compression == "lz4":
        import lz4.frame

        return _pulled(lz4.frame.LZ4FrameDecompressor(), data)
    if compression == "zstd":
        from siloscope.io import zstandard

        return zstandard.steps(data, _STEP)
    raise InputError(f"messages are compressed with '{compression}'; read are lz4, bz2 and zstd")


def _pulled(decompressor: Any, data: bytes) -> Iterator[bytes]:
    part = decompressor.decompress(data, _STEP)
    while part or not (decompressor.eof or decompressor.needs_input):
        yield part
        if decompressor.eof or decompressor.needs_input:
            return
        part = decompressor.decompress(b"", _STEP)


def or_none(read: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T | None:
    """What `read` gives, or None where the message is damaged; for what a frame can do without."""
    try:
        return read(*args, **kwargs)
    except InputError:
        return None
