"""E57 point clouds (ASTM E2807): checked pages, an XML description, and bit-packed columns of points."""

from __future__ import annotations

import math
import struct
import xml.etree.ElementTree as Xml
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.errors import InputError
from siloscope.io.source import Format, FrameSource, Item, Options
from siloscope.types.frame import Frame

MAGIC = b"ASTM-E57"
_BATCH_PAGES = 4096
_SECTION_HEAD = 32
_DATA_PACKET = 1


class PagedFile:
    """The bytes of an E57 file without the checksum (CRC-32C) that ends every page; each is checked when read."""

    def __init__(self, path: Path) -> None:
        self.name = str(path)
        self.file = path.open("rb")
        self.size = path.stat().st_size
        head = self.file.read(48)
        if len(head) < 48:
            raise InputError(f"{self.name}: the file breaks off in its header; export it again")
        fields: tuple[int, ...] = struct.unpack("<IIQQQQ", head[8:])
        self.xml_at, self.xml_size, self.page = fields[3:]
        if not 64 <= self.page <= 1 << 20:
            raise InputError(f"{self.name}: damaged header (pages of {self.page} bytes); export the file again")

    def logical(self, physical: int) -> int:
        """Place among the bytes without checksums."""
        return physical - physical // self.page * 4

    def read(self, at: int, size: int) -> bytes:
        """Bytes from a logical place; raises `InputError` for a wrong checksum or a file that is cut off."""
        net = self.page - 4
        first, last = at // net, (at + size - 1) // net
        if at < 0 or size < 0 or size > self.size or (last + 1) * self.page > self.size:
            raise InputError(f"{self.name}: the file is cut off or damaged; export it again")
        self.file.seek(first * self.page)
        pages = [self._checked(first, last, start) for start in range(first, last + 1, _BATCH_PAGES)]
        return b"".join(pages)[at - first * net :][:size]

    def _checked(self, first: int, last: int, start: int) -> bytes:
        count = min(_BATCH_PAGES, last + 1 - start)
        pages = memoryview(self.file.read(count * self.page))
        parts = [pages[i * self.page : (i + 1) * self.page] for i in range(count)]
        for number, part in enumerate(parts, start):
            if _core.checksum(bytes(part[:-4])) != int.from_bytes(part[-4:], "big"):
                raise InputError(f"{self.name}: page {number} fails its checksum; the file is damaged, export it again")
        return b"".join(part[:-4] for part in parts)

    def xml(self) -> Xml.Element:
        """The description."""
        text = self.read(self.logical(self.xml_at), self.xml_size)
        if b"<!" in text.replace(b"<![CDATA[", b"").replace(b"<!--", b""):
            raise InputError(f"{self.name}: the description declares entities, which E57 does not use; not read")
        try:
            return Xml.fromstring(text)
        except (Xml.ParseError, ValueError, LookupError) as error:
            raise InputError(f"{self.name}: damaged description ({error}); export the file again") from None


class Column(NamedTuple):
    """One field of the points: how many bits a value takes, and what they mean."""

    name: str
    bits: int
    real: bool
    low: int
    scale: float
    offset: float
    """Value = (raw + low) · scale + offset."""


class Scan(NamedTuple):
    """One ``data3D`` entry."""

    name: str
    size: int
    at: int
    """Physical place of its section."""
    columns: tuple[Column, ...]


def _local(element: Xml.Element) -> str:
    return element.tag.rsplit("}", 1)[-1]


def _child(element: Xml.Element, name: str) -> Xml.Element | None:
    return next((child for child in element if _local(child) == name), None)


def scans_of(name: str, root: Xml.Element) -> list[Scan]:
    """The scans of a file; raises `InputError` for a description that is not E57's."""
    data = _child(root, "data3D")
    try:
        return [_scan(number, element) for number, element in enumerate(data if data is not None else ())]
    except (TypeError, ValueError, OverflowError, AttributeError, KeyError) as error:
        raise InputError(f"{name}: damaged description ({error}); export the file again") from None


def _scan(number: int, element: Xml.Element) -> Scan:
    label, points = _child(element, "name"), _child(element, "points")
    if points is None:
        raise ValueError(f"scan {number} has no points")
    prototype = _child(points, "prototype")
    columns = tuple(_column(field) for field in (prototype if prototype is not None else ()))
    text = (label.text or "").strip() if label is not None else ""
    size, at = (int(points.attrib[key]) for key in ("recordCount", "fileOffset"))
    if size < 0 or at < 0:
        raise ValueError(f"scan {number} has {size} points at {at}")
    return Scan(text or f"scan {number}", size, at, columns)


def _column(field: Xml.Element) -> Column:
    kind = field.attrib.get("type")
    if kind == "Float":
        return Column(_local(field), 32 if field.attrib.get("precision") == "single" else 64, True, 0, 1.0, 0.0)
    if kind not in ("Integer", "ScaledInteger"):
        raise ValueError(f"field {_local(field)} of type {kind}")
    low = int(field.attrib.get("minimum", -(1 << 63)))
    high = int(field.attrib.get("maximum", (1 << 63) - 1))
    scale, offset = (float(field.attrib.get(key, default)) for key, default in (("scale", 1), ("offset", 0)))
    if high < low or (high - low).bit_length() > 64 or not (math.isfinite(scale) and math.isfinite(offset)):
        raise ValueError(f"bounds of field {_local(field)}")
    if kind == "Integer":
        scale, offset = 1.0, 0.0
    return Column(_local(field), (high - low).bit_length(), False, low, scale, offset)


_CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
_SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")


def read_points(file: PagedFile, scan: Scan) -> NDArray[np.float64]:
    """Points (N, 3) of a scan in metres, in the scanner's frame; NaN where the scanner marks none."""
    names = [column.name for column in scan.columns]
    wanted = next((group for group in (_CARTESIAN, _SPHERICAL) if set(group) <= set(names)), None)
    if wanted is None:
        raise InputError(f"{scan.name} has neither Cartesian nor spherical coordinates, but {', '.join(names)}")
    invalid = wanted[0].replace("X", "InvalidState").replace("Range", "InvalidState")
    used = [names.index(name) for name in (*wanted, invalid) if name in names]
    streams = _streams(file, scan, used)
    values = {names[i]: _values(scan, scan.columns[i], streams[i]) for i in used}
    points = np.stack([values[name] for name in wanted], axis=1)
    points = points if wanted is _CARTESIAN else _from_spherical(points)
    if invalid in values:
        points[values[invalid] != 0] = np.nan
    return points


def _from_spherical(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Range, azimuth, elevation (radians) to x, y, z."""
    r, azimuth, elevation = points.T
    flat = r * np.cos(elevation)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), r * np.sin(elevation)], axis=1)


def _streams(file: PagedFile, scan: Scan, used: list[int]) -> dict[int, bytes]:
    """The packed bytes of the columns asked for, joined over all packets."""
    at = file.logical(scan.at)
    kind, length, data_at = struct.unpack("<B7xQQ", file.read(at, _SECTION_HEAD)[:24])
    start = file.logical(data_at)
    end = at + length
    if kind != 1 or not at < start <= end or end > file.logical(file.size):
        raise InputError(f"{scan.name} is damaged: its section does not lie in the file")
    section = memoryview(file.read(start, end - start))
    parts: dict[int, list[memoryview]] = {column: [] for column in used}
    for packet in _packets(scan, section):
        for column, part in enumerate(_bytestreams(scan, packet)):
            if column in parts:
                parts[column].append(part)
    return {column: b"".join(found) for column, found in parts.items()}


_PACKET_HEAD = 6
"""Bytes before a data packet's column sizes."""


def _packets(scan: Scan, section: memoryview) -> Iterator[memoryview]:
    at = 0
    while at + _PACKET_HEAD <= len(section):
        kind, _, length = struct.unpack_from("<BBH", section, at)
        packet = section[at : at + length + 1]
        if len(packet) < length + 1 or kind > 2:
            raise InputError(f"{scan.name} is damaged: a packet runs over its end")
        at += length + 1
        if kind == _DATA_PACKET:
            if len(packet) < _PACKET_HEAD:
                raise InputError(f"{scan.name} is damaged: a packet is shorter than its own head")
            yield packet


def _bytestreams(scan: Scan, packet: memoryview) -> Iterator[memoryview]:
    (count,) = struct.unpack_from("<H", packet, 4)
    at = _PACKET_HEAD + 2 * count
    if count != len(scan.columns) or at > len(packet):
        raise InputError(f"{scan.name} is damaged: a packet has {count} columns, not {len(scan.columns)}")
    for size in struct.unpack_from(f"<{count}H", packet, _PACKET_HEAD):
        if at + size > len(packet):
            raise InputError(f"{scan.name} is damaged: a column runs over the end of its packet")
        yield packet[at : at + size]
        at += size


def _values(scan: Scan, column: Column, packed: bytes) -> NDArray[np.float64]:
    if scan.size * column.bits > 8 * len(packed) or (not column.bits and scan.size > MAX_CONSTANT):
        raise InputError(f"{scan.name} is declared to have {scan.size} points, more than the file holds")
    if column.real:
        return np.frombuffer(packed, f"<f{column.bits // 8}", scan.size).astype(np.float64)
    return (_unpack(packed, column.bits, scan.size) + column.low) * column.scale + column.offset


MAX_CONSTANT = 100_000_000
"""Most points whose coordinate is constant, and so takes no byte in the file."""


def _unpack(packed: bytes, bits: int, count: int) -> NDArray[np.float64]:
    """Unsigned numbers of `bits` bits each, lowest bit first."""
    if bits == 0:
        return np.zeros(count)
    if bits in (8, 16, 32, 64):
        return np.frombuffer(packed, f"<u{bits // 8}", count).astype(np.float64)
    values = np.empty(count)
    step = 1 << 16
    weights = np.left_shift(np.uint64(1), np.arange(bits, dtype=np.uint64))
    for start in range(0, count, step):
        some = min(step, count - start)
        first = start * bits // 8
        piece = np.frombuffer(packed, np.uint8, (some * bits + 7) // 8, first)
        flags = np.unpackbits(piece, bitorder="little", count=some * bits).reshape(some, bits)
        values[start : start + some] = flags @ weights
    return values


class E57Source(FrameSource):
    """The scans of a file, each in its scanner's frame."""

    def __init__(self, path: Path, options: Options) -> None:
        super().__init__(path, "e57", options)
        self.pages = PagedFile(path)
        try:
            self.scans = scans_of(self.name, self.pages.xml())
        except BaseException:
            self.pages.file.close()
            raise
        self.provenance["axes"] = "as in the file: the scanner's, not a camera's"

    def _items(self) -> Iterator[Item]:
        for scan in self.scans:
            yield Item(scan.name, partial(self._decode, scan))

    def _decode(self, scan: Scan) -> Frame:
        return Frame(points=read_points(self.pages, scan))

    def _count(self) -> int:
        return len(self.scans)

    def _streams(self) -> list[dict[str, Any]]:
        kinds = {"name": "points", "kind": "points", "dtype": "float64", "chosen": True}
        return [{**kinds, "name": scan.name, "size": [scan.size], "frames": 1} for scan in self.scans]

    def close(self) -> None:
        """Lets go of the file."""
        self.pages.file.close()


FORMAT = Format("e57", lambda head, path: head.startswith(MAGIC), E57Source)
