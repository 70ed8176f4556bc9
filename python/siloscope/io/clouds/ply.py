"""PLY point clouds: ascii and binary of either byte order; organised where the header's obj_info tells the columns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError
from siloscope.io.clouds.columns import CloudSource, Columns, as_declared, cloud_frame, numbers_in_text
from siloscope.io.source import Format, Options, read_bytes
from siloscope.types.frame import Frame

_TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float": "f4", "double": "f8", "float32": "f4", "float64": "f8"},
}
_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_LONGEST_HEADER = 65_536


@dataclass(frozen=True)
class ListKind:
    """Types of a list property: of its length, and of its entries."""

    length: str
    entry: str

    def step(self, order: str) -> Callable[[bytes, int], int]:
        """What goes from the start of such a list to its end."""
        length, entry = np.dtype(self.length), np.dtype(self.entry).itemsize
        size, signed = length.itemsize, length.kind == "i"
        byte_order: Literal["little", "big"] = "big" if order == ">" else "little"

        def over(data: bytes, at: int) -> int:
            count = int.from_bytes(data[at : at + size], byte_order, signed=signed)
            return at + size + max(0, count) * entry

        return over


def _skip(size: int) -> Callable[[bytes, int], int]:
    return lambda data, at: at + size


@dataclass
class Element:
    """One element of the header: its name, how many, and its properties with their dtype, or that of a list."""

    name: str
    count: int
    properties: list[tuple[str, str | ListKind]] = field(default_factory=list)

    def dtype(self, name: str, order: str) -> np.dtype[Any]:
        """Layout of one entry in a binary file; refuses lists, whose size only reading tells."""
        lists = [key for key, kind in self.properties if isinstance(kind, ListKind)]
        if lists:
            raise InputError(f"{name}: element '{self.name}' has the list '{lists[0]}'; export the points alone")
        try:
            return np.dtype([(key, order + str(kind)) for key, kind in self.properties])
        except ValueError:
            raise InputError(f"{name}: element '{self.name}' names a property twice; export it again") from None

    def end(self, data: bytes, start: int, order: str) -> int:
        """Where this element ends in a binary file, past its lists one by one; for a cut file, somewhere behind it."""
        kinds = [kind for _, kind in self.properties]
        if not any(isinstance(kind, ListKind) for kind in kinds):
            return start + self.count * sum(np.dtype(kind).itemsize for kind in kinds if isinstance(kind, str))
        steps = [kind.step(order) if isinstance(kind, ListKind) else _skip(np.dtype(kind).itemsize) for kind in kinds]
        for _ in range(self.count):
            for step in steps:
                start = step(data, start)
            if start > len(data):
                break
        return start


@dataclass
class Header:
    """What stands before ``end_header``."""

    order: str
    """Byte order, or "" for ascii."""
    elements: list[Element]
    grid: tuple[int, int] | None
    """Rows and columns of an organised cloud."""
    size: int
    """Bytes of the header."""

    @property
    def vertices(self) -> Element:
        """The element of the points."""
        return next(element for element in self.elements if element.name == "vertex")


def read_header(name: str, data: bytes) -> Header:
    """Reads the header from the file's first bytes; raises `InputError` naming the line that is wrong."""
    end = data.find(b"end_header", 0, _LONGEST_HEADER)
    newline = data.find(b"\n", end)
    if end < 0 or newline < 0:
        raise InputError(f"{name}: the PLY header does not end; the file was cut off or damaged, export it again")
    words = [line.split() for line in data[:end].decode("latin-1").splitlines()]
    header = Header("?", [], None, newline + 1)
    sizes: dict[str, int] = {}
    for line in words[1:]:
        try:
            _take_line(header, sizes, line)
        except (KeyError, IndexError, ValueError):
            raise InputError(f"{name}: the PLY header line '{' '.join(line)}' is wrong; export it again") from None
    if header.order == "?" or not any(element.name == "vertex" for element in header.elements):
        raise InputError(f"{name}: the PLY header names no format or no vertices; export it again")
    rows, columns = sizes.get("num_rows", 0), sizes.get("num_cols", 0)
    if rows > 1 and rows * columns == header.vertices.count:  # range grids leave invalid points out and differ
        header.grid = (rows, columns)
    return header


def _take_line(header: Header, sizes: dict[str, int], line: list[str]) -> None:
    match line:
        case ["format", kind, _]:
            header.order = _FORMATS[kind]
        case ["element", key, count]:
            header.elements.append(Element(key, _count(count)))
        case ["property", "list", counted, kind, key]:
            header.elements[-1].properties.append((key, ListKind(_TYPES[counted], _TYPES[kind])))
        case ["property", kind, key]:
            header.elements[-1].properties.append((key, _TYPES[kind]))
        case ["obj_info", "num_rows" | "num_cols" as key, count]:
            sizes[key] = _count(count)
        case [] | ["comment" | "obj_info", *_]:
            pass
        case _:
            raise ValueError


def _count(word: str) -> int:
    if not word.isascii() or not word.isdigit() or len(word) > 15:
        raise ValueError
    return int(word)


def read(path: Path) -> Frame:
    """The points of one file: (N, 3), or (H, W, 3) where organised."""
    name = str(path)
    data = read_bytes(path)
    header = read_header(name, data)
    columns = _ascii(name, data, header) if header.order == "" else _binary(name, data, header)
    return cloud_frame(name, columns, header.grid)


def _ascii(name: str, data: bytes, header: Header) -> Columns:
    vertices = header.vertices
    vertices.dtype(name, "<")
    before = header.elements[: header.elements.index(vertices)]
    start = _after_lines(data, header.size, sum(element.count for element in before))
    table = numbers_in_text(name, data[start:], vertices.count, len(vertices.properties), "vertices")
    return {key: as_declared(table[:, i], str(kind)) for i, (key, kind) in enumerate(vertices.properties)}


def _after_lines(data: bytes, start: int, lines: int) -> int:
    for _ in range(min(lines, len(data))):
        start = data.find(b"\n", start) + 1 or len(data)
    return start


def _binary(name: str, data: bytes, header: Header) -> Columns:
    element, offset = header.vertices, header.size
    for before in header.elements[: header.elements.index(element)]:
        offset = before.end(data, offset, header.order)
    dtype = element.dtype(name, header.order)
    there = max(0, len(data) - offset) // max(1, dtype.itemsize)
    if there < element.count:
        raise InputError(
            f"{name}: the header declares {element.count} vertices but the file holds {there}; "
            "it was cut off or damaged, export it again"
        )
    table: NDArray[Any] = np.frombuffer(data, dtype, element.count, offset) if element.count else np.empty(0, dtype)
    return {key: table[key] for key in table.dtype.names or ()}


class PlySource(CloudSource):
    """One PLY file."""

    def __init__(self, path: Path, options: Options) -> None:
        super().__init__(path, "ply", options, read)
        with path.open("rb") as file:
            header = read_header(self.name, file.read(_LONGEST_HEADER))
        self.size = list(reversed(header.grid)) if header.grid else [header.vertices.count]
        kinds = dict(header.vertices.properties)
        x = kinds.get("x")
        self.dtype = np.dtype(x).name if isinstance(x, str) else "unknown"
        self.provenance["storage"] = {"": "ascii", "<": "binary", ">": "binary, big-endian"}[header.order]


FORMAT = Format("ply", lambda head, path: head[:3] == b"ply" and head[3:4] in (b"\n", b"\r"), PlySource, read_one=read)
