"""PCD point clouds of the Point Cloud Library: ascii, binary and binary_compressed; organised where HEIGHT > 1."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from siloscope import _core
from siloscope.errors import InputError
from siloscope.io.clouds.columns import CloudSource, Columns, as_declared, cloud_frame, numbers_in_text
from siloscope.io.source import Format, Options, read_bytes
from siloscope.types.frame import Frame

_LONGEST_HEADER = 65_536
_SIZES = {"F": (4, 8), "I": (1, 2, 4, 8), "U": (1, 2, 4, 8)}
_STORAGE = ("ascii", "binary", "binary_compressed")
_MOST_VALUES = 10_000
"""Values of one point; descriptors have some hundreds."""


@dataclass(frozen=True)
class Field:
    """One field of a point: `count` values of a dtype."""

    name: str
    dtype: np.dtype[Any]
    count: int

    @property
    def nbytes(self) -> int:
        """Bytes in one point."""
        return self.dtype.itemsize * self.count


@dataclass(frozen=True)
class Header:
    """What stands before the values."""

    fields: tuple[Field, ...]
    width: int
    height: int
    storage: str
    viewpoint: tuple[str, ...]
    size: int
    """Bytes of the header."""

    @property
    def points(self) -> int:
        """How many there are."""
        return self.width * self.height

    @property
    def point_bytes(self) -> int:
        """Bytes of one point."""
        return sum(field.nbytes for field in self.fields)


def read_header(name: str, data: bytes) -> Header:
    """Reads the header from the file's first bytes; raises `InputError` naming the line that is wrong."""
    lines: dict[str, list[str]] = {}
    end = 0
    while "DATA" not in lines:
        newline = data.find(b"\n", end, _LONGEST_HEADER)
        if newline < 0:
            raise InputError(f"{name}: the PCD header does not end; the file was cut off or damaged, export it again")
        key, *words = data[end:newline].decode("latin-1").split("#")[0].split() or [""]
        lines[key.upper()] = words
        end = newline + 1
    return _header(name, lines, end)


def _header(name: str, lines: dict[str, list[str]], size: int) -> Header:
    names = lines.get("FIELDS") or lines.get("COLUMNS") or []
    sizes, kinds = lines.get("SIZE", []), lines.get("TYPE", [])
    counts = lines.get("COUNT") or ["1"] * len(names)
    if not names or not len(names) == len(sizes) == len(kinds) == len(counts):
        raise InputError(
            f"{name}: the PCD header has {len(names)} FIELDS, {len(sizes)} SIZE, {len(kinds)} TYPE and {len(counts)} "
            "COUNT entries; they must be as many, export the file again"
        )
    fields = tuple(_field(name, *four) for four in zip(names, kinds, sizes, counts, strict=True))
    storage = " ".join(lines["DATA"]).lower()
    if storage not in _STORAGE:
        raise InputError(f"{name}: unknown DATA '{storage}' in the PCD header; known are {', '.join(_STORAGE)}")
    width, height = _shape(name, lines)
    return Header(fields, width, height, storage, tuple(lines.get("VIEWPOINT", ())), size)


def _field(name: str, key: str, kind: str, size: str, count: str) -> Field:
    values = _whole(count)
    if kind not in _SIZES or _whole(size) not in _SIZES[kind] or not 0 < values <= _MOST_VALUES:
        raise InputError(
            f"{name}: field '{key}' of TYPE {kind}, SIZE {size}, COUNT {count} is none that PCD has; export it again"
        )
    return Field(key, np.dtype(f"<{kind.lower()}{size}"), values)


def _shape(name: str, lines: dict[str, list[str]]) -> tuple[int, int]:
    points = _whole(*lines.get("POINTS", ["-"])[:1])
    width = _whole(*lines.get("WIDTH", lines.get("POINTS", ["-"]))[:1])
    height = _whole(*lines.get("HEIGHT", ["1"])[:1])
    if width < 0 or height < 0 or ("POINTS" in lines and points != width * height):
        raise InputError(f"{name}: the PCD header's WIDTH, HEIGHT and POINTS don't agree; export the file again")
    return width, height


def _whole(word: str = "-") -> int:
    """A count as written; -1 where it is none."""
    return int(word) if word.isascii() and word.isdigit() and len(word) <= 15 else -1


def read(path: Path) -> Frame:
    """The points of one file: (N, 3), or (H, W, 3) where organised."""
    name = str(path)
    data = read_bytes(path)
    header = read_header(name, data)
    columns = {"ascii": _ascii, "binary": _binary, "binary_compressed": _compressed}[header.storage](name, data, header)
    return cloud_frame(name, columns, (header.height, header.width) if header.height > 1 else None)


def _ascii(name: str, data: bytes, header: Header) -> Columns:
    count = sum(field.count for field in header.fields)
    table = numbers_in_text(name, data[header.size :], header.points, count, "points")
    starts = np.cumsum([0, *(field.count for field in header.fields)])
    return {
        field.name: as_declared(table[:, start], field.dtype)
        for field, start in zip(header.fields, starts, strict=False)
    }


def _binary(name: str, data: bytes, header: Header) -> Columns:
    _check_length(name, len(data) - header.size, header)
    starts = _starts(header.fields)
    kinds = [(field.dtype.str, (field.count,)) for field in header.fields]
    keys = [f"{i}" for i in range(len(kinds))]
    dtype = np.dtype({"names": keys, "formats": kinds, "offsets": starts, "itemsize": header.point_bytes})
    table = np.frombuffer(data, dtype, header.points, header.size) if header.points else np.empty(0, dtype)
    return {field.name: table[key][:, 0] for field, key in zip(header.fields, keys, strict=True)}


def _compressed(name: str, data: bytes, header: Header) -> Columns:
    """Two sizes, then LZF of all values field by field."""
    body = data[header.size :]
    packed, size = (int.from_bytes(body[i : i + 4], "little") for i in (0, 4))
    if len(body) < 8 or packed > len(body) - 8:
        raise InputError(f"{name}: breaks off in the compressed points; it was cut off, export it again")
    _check_length(name, size, header)
    try:
        values = _core.decompress_lzf(body[8 : 8 + packed], size)
    except ValueError as error:
        raise InputError(f"{name}: damaged compressed points ({error}); export the file again") from None
    starts = [start * header.points for start in _starts(header.fields)]
    return {
        field.name: np.frombuffer(values, field.dtype, header.points * field.count, start)[:: field.count]
        for field, start in zip(header.fields, starts, strict=True)
    }


def _starts(fields: Sequence[Field]) -> list[int]:
    return [sum(field.nbytes for field in fields[:i]) for i in range(len(fields))]


def _check_length(name: str, there: int, header: Header) -> None:
    wanted = header.points * header.point_bytes
    if there < wanted:
        raise InputError(
            f"{name}: the header declares {header.points} points of {header.point_bytes} bytes but the file holds "
            f"{max(there, 0) // header.point_bytes}; it was cut off or damaged, export it again"
        )


class PcdSource(CloudSource):
    """One PCD file."""

    def __init__(self, path: Path, options: Options) -> None:
        super().__init__(path, "pcd", options, read)
        with path.open("rb") as file:
            header = read_header(self.name, file.read(_LONGEST_HEADER))
        self.size = [header.width, header.height] if header.height > 1 else [header.points]
        self.dtype = next((field.dtype.name for field in header.fields if field.name == "x"), "unknown")
        self.provenance |= {"storage": header.storage, "fields": [field.name for field in header.fields]}
        if header.viewpoint:
            self.provenance["viewpoint"] = " ".join(header.viewpoint)


def _sniff(head: bytes, path: Path) -> bool:
    lines = [line.strip() for line in head.split(b"\n")]
    first = next((line for line in lines if line and not line.startswith(b"#")), b"")
    return lines[0].startswith(b"# .PCD") or first.split()[:1] in ([b"VERSION"], [b"FIELDS"])


FORMAT = Format("pcd", _sniff, PcdSource, read_one=read)
