"""Messages in Protocol Buffers, read by the descriptors that their recording carries."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from siloscope.errors import InputError

_DEEPEST = 16
"""Messages inside messages; depth images have three."""
_LONGEST_VARINT = 10
_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5
_REPEATED = 3
_STRING, _MESSAGE, _BLOB = 9, 11, 12
_PACKED = {1: "<f8", 2: "<f4", 6: "<u8", 7: "<u4", 15: "<i4", 16: "<i8"}
"""Types of fixed size, by their number in a descriptor, and how NumPy calls them."""
_SIGNED = (3, 5)
_ZIGZAG = (17, 18)
_BOOL = 8


class Field(NamedTuple):
    """One field of a message."""

    name: str
    type: int
    repeated: bool
    message: str
    """Name of its message, for fields that are one."""


Layout = dict[int, Field]
"""Fields of a message by number."""


class Messages:
    """The messages that a ``FileDescriptorSet`` describes; raises `InputError` for one that is damaged."""

    def __init__(self, descriptors: bytes) -> None:
        self.layouts: dict[str, Layout] = {}
        for number, file in _fields(memoryview(descriptors)):
            if number == 1:
                self._take_file(_blob(file))

    def _take_file(self, file: memoryview) -> None:
        parts = list(_fields(file))
        package = next((_text(value) for number, value in parts if number == 2), "")
        for number, value in parts:
            if number == 4:
                self._take_message(package, _blob(value), 0)

    def _take_message(self, parent: str, data: memoryview, depth: int) -> None:
        if depth > _DEEPEST:
            raise InputError("a message's description is nested too deeply")
        parts = list(_fields(data))
        name = next((_text(value) for number, value in parts if number == 1), "")
        full = f"{parent}.{name}".lstrip(".")
        self.layouts[full] = dict(_field(_blob(value)) for number, value in parts if number == 2)
        for number, value in parts:
            if number == 3:
                self._take_message(full, _blob(value), depth + 1)

    def read(self, name: str, data: memoryview, depth: int = 0) -> dict[str, Any]:
        """A message's fields by name; bytes stay undecoded, numbers repeated in one piece are arrays."""
        layout = self.layouts.get(name)
        if layout is None or depth > _DEEPEST:
            raise InputError(f"the recording does not describe its messages '{name}'")
        found: dict[str, Any] = {}
        for number, raw in _fields(data):
            field = layout.get(number)
            if field is not None:
                self._take_value(found, field, raw, depth)
        return found

    def _take_value(self, found: dict[str, Any], field: Field, raw: Any, depth: int) -> None:
        if field.type == _MESSAGE:
            value: Any = self.read(field.message, _blob(raw), depth + 1)
        else:
            value = _value(field, raw)
        if not field.repeated:
            found[field.name] = value
        elif isinstance(value, np.ndarray):
            found[field.name] = [*found.get(field.name, []), *value.tolist()]
        else:
            found.setdefault(field.name, []).append(value)


@lru_cache(maxsize=32)
def messages_of(descriptors: bytes) -> Messages:
    """The messages that a schema of a recording describes."""
    return Messages(descriptors)


def _field(data: memoryview) -> tuple[int, Field]:
    told = dict(_fields(data))
    name, message = _text(told.get(1, b"")), _text(told.get(6, b"")).lstrip(".")
    return int(told.get(3, 0)), Field(name, int(told.get(5, 0)), told.get(4) == _REPEATED, message)


def _fields(data: memoryview) -> Iterator[tuple[int, Any]]:
    """Number and undecoded value of every field: an int, or bytes."""
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        number, kind = key >> 3, key & 7
        if kind == _VARINT:
            value, at = _varint(data, at)
            yield number, value
            continue
        if kind == _BYTES:
            size, at = _varint(data, at)
        elif kind in (_FIXED32, _FIXED64):
            size = 4 if kind == _FIXED32 else 8
        else:
            raise InputError("a message in Protocol Buffers is damaged")
        if size > len(data) - at:
            raise InputError(f"message ends {size - len(data) + at} bytes early")
        yield number, data[at : at + size]
        at += size


def _varint(data: memoryview, at: int) -> tuple[int, int]:
    value = 0
    for i, byte in enumerate(data[at : at + _LONGEST_VARINT]):
        value |= (byte & 0x7F) << 7 * i
        if byte < 0x80:
            return value & 0xFFFFFFFFFFFFFFFF, at + i + 1
    raise InputError("a message in Protocol Buffers is damaged")


def _value(field: Field, raw: Any) -> Any:
    if field.type == _STRING:
        return _text(raw)
    if field.type == _BLOB:
        return _blob(raw)
    if field.type in _PACKED:
        return _fixed(field, _blob(raw))
    if isinstance(raw, int):
        return _whole(field, raw)
    numbers, at = [], 0
    while at < len(raw):
        number, at = _varint(raw, at)
        numbers.append(_whole(field, number))
    return np.array(numbers)


def _fixed(field: Field, raw: memoryview) -> Any:
    kind = np.dtype(_PACKED[field.type])
    if len(raw) % kind.itemsize or (not field.repeated and len(raw) != kind.itemsize):
        raise InputError(f"field {field.name} of a message is damaged")
    numbers = np.frombuffer(raw, kind)
    return numbers if field.repeated else numbers[0].item()


def _whole(field: Field, raw: int) -> int | bool:
    if field.type == _BOOL:
        return raw != 0
    if field.type in _ZIGZAG:
        return raw >> 1 ^ -(raw & 1)
    if field.type in _SIGNED:
        return int(struct.unpack("<q", struct.pack("<Q", raw))[0])
    return raw


def _blob(raw: Any) -> memoryview:
    if isinstance(raw, int):
        raise InputError("a message in Protocol Buffers is damaged")
    return memoryview(raw)


def _text(raw: Any) -> str:
    return bytes(_blob(raw)).decode("utf-8", "replace")
