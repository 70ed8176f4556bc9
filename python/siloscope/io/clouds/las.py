"""LAS point clouds, and LAZ by `lazrs` (extra ``las``)."""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError
from siloscope.io.extras import need
from siloscope.io.source import Format, FrameSource, Item, Options
from siloscope.types.frame import Frame

MAGIC = b"LASF"
_STEP = 50_000
_MOST_PER_BYTE = 30
"""Points a byte of a LAZ file at most; real scans take some bytes a point."""
_RECORD_HEAD = 54
_GEO_KEYS, _WKT, _LASZIP = 34735, 2112, 22204
_LINEAR_UNITS_KEY = 3076
_UNITS = {9001: ("metre", 1.0), 9002: ("foot", 0.3048), 9003: ("US survey foot", 1200 / 3937)}


class Header(NamedTuple):
    """What is needed of a LAS header."""

    points_at: int
    record_count: int
    records_at: int
    compressed: bool
    point_size: int
    points: int
    scale: NDArray[np.float64]
    offset: NDArray[np.float64]


def read_header(name: str, head: bytes) -> Header:
    """The public header block of LAS 1.0 to 1.4; raises `InputError` for one that makes no sense."""
    if len(head) < 227:
        raise InputError(f"{name}: the file breaks off in its header; export it again")
    minor = head[25]
    records_at, points_at, record_count, form, point_size, count = struct.unpack_from("<HIIBHI", head, 94)
    if minor >= 4 and len(head) >= 255:
        count = struct.unpack_from("<Q", head, 247)[0] or count
    numbers = np.frombuffer(head, "<f8", 6, 131)
    if head[24] != 1 or point_size < 12 or not np.all(np.isfinite(numbers)) or np.any(numbers[:3] == 0):
        raise InputError(f"{name}: damaged LAS header; export the file again")
    return Header(points_at, record_count, records_at, form & 0x80 != 0, point_size, count, numbers[:3], numbers[3:])


def read_records(file: BinaryIO, header: Header) -> Iterator[tuple[int, bytes]]:
    """Number and content of the variable length records; ends where the points start."""
    file.seek(header.records_at)
    at = header.records_at
    for _ in range(header.record_count):
        head = file.read(_RECORD_HEAD)
        if len(head) < _RECORD_HEAD:
            return
        number, size = struct.unpack_from("<HH", head, 18)
        at += _RECORD_HEAD + size
        if at > header.points_at:
            return
        yield number, file.read(size)


class LasSource(FrameSource):
    """All points of one file, float64: coordinates may be millions of metres from the origin."""

    def __init__(self, path: Path, options: Options) -> None:
        super().__init__(path, "las", options)
        self.size = path.stat().st_size
        with path.open("rb") as file:
            self.header = read_header(self.name, file.read(375))
            records = dict(read_records(file, self.header))
        self.laszip = records.get(_LASZIP, b"")
        self._check_count()
        if self.header.compressed:
            self.lazrs = need("lazrs", "las", f"{path}: reading LAZ")
            self._check_laszip()
        unit, self.metres = unit_of(records)
        self.provenance["unit"] = unit
        self.provenance["axes"] = "as in the file: a map's, z up, not a camera's"

    def _check_count(self) -> None:
        header = self.header
        room = max(0, self.size - header.points_at)
        most = room * _MOST_PER_BYTE if header.compressed else room // header.point_size
        if header.points > most:
            raise InputError(
                f"{self.name}: {header.points} points are declared, more than the file holds; it is cut off or damaged"
            )

    def _check_laszip(self) -> None:
        """The decompressor trusts its record and the table of chunks at the file's end; a cut file has none."""
        data = self.laszip
        items = struct.unpack_from("<H", data, 32)[0] if len(data) >= 34 else 0
        whole = items > 0 and len(data) >= 34 + 6 * items
        sizes = [size for _, size, _ in struct.iter_unpack("<HHH", data[34 : 34 + 6 * items])] if whole else []
        chunk = struct.unpack_from("<I", data, 12)[0] if whole else 0
        if sum(sizes) != self.header.point_size or not chunk:
            raise InputError(f"{self.name}: damaged LAZ description; export the file again")
        with self.path.open("rb") as file:
            file.seek(self.header.points_at)
            at = struct.unpack("<q", file.read(8).ljust(8, b"\xff"))[0]
            if not self.header.points_at < at <= self.size - 8:
                raise InputError(f"{self.name}: the table of compressed points is missing; the file is cut off")
            file.seek(at)
            _, chunks = struct.unpack("<II", file.read(8))
        if chunks > self.size or (chunk < 0xFFFFFFFF and self.header.points > chunks * chunk):
            raise InputError(f"{self.name}: the table of compressed points is damaged; export the file again")

    def _items(self) -> Iterator[Item]:
        yield Item(self.path.name, self._decode)

    def _decode(self) -> Frame:
        parts = [self._coordinates(block) for block in self._blocks()]
        points = np.concatenate(parts) if parts else np.empty((0, 3))
        if not np.all(np.isfinite(points)):
            raise InputError(f"{self.name}: coordinates beyond all bounds; the file is damaged")
        return Frame(points=points)

    def _coordinates(self, block: bytes | bytearray) -> NDArray[np.float64]:
        """X, Y, Z are the first twelve bytes of every point, whatever its format."""
        rows = np.frombuffer(block, np.uint8).reshape(-1, self.header.point_size)
        raw = np.ascontiguousarray(rows[:, :12]).view("<i4").astype(np.float64)
        with np.errstate(over="ignore", invalid="ignore"):
            metres: NDArray[np.float64] = (raw * self.header.scale + self.header.offset) * self.metres
        return metres

    def _blocks(self) -> Iterator[bytes | bytearray]:
        """The points' bytes, some thousand points at a time."""
        with self.path.open("rb") as file:
            file.seek(self.header.points_at)
            unpack = self._unpacker(file) if self.header.compressed else None
            for start in range(0, self.header.points, _STEP):
                size = min(_STEP, self.header.points - start) * self.header.point_size
                block = unpack(size) if unpack else file.read(size)
                if len(block) < size:
                    raise InputError(f"{self.name}: the file is cut off; export it again")
                yield block

    def _unpacker(self, file: BinaryIO) -> Any:
        decompressor = self._guarded(self.lazrs.LasZipDecompressor, file, self.laszip)

        def unpack(size: int) -> bytearray:
            block = bytearray(size)
            self._guarded(decompressor.decompress_many, block)
            return block

        return unpack

    def _guarded(self, work: Any, *arguments: Any) -> Any:
        try:
            return work(*arguments)
        except BaseException as error:
            # The decompressor's own assertions arrive as an exception outside of Python's usual tree.
            if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
                raise
            raise InputError(f"{self.name}: damaged LAZ points ({error}); export the file again") from None

    def _count(self) -> int:
        return 1

    def _streams(self) -> list[dict[str, Any]]:
        stream = {"name": "points", "kind": "points", "size": [self.header.points], "dtype": "float64"}
        return [{**stream, "frames": 1, "chosen": True}]


def unit_of(records: dict[int, bytes]) -> tuple[str, float]:
    """Name of the linear unit, and metres in it, from the file's coordinate system; metres where it has none."""
    found = _from_geo_keys(records.get(_GEO_KEYS, b"")) or _from_wkt(records.get(_WKT, b""))
    return found or ("not told, taken as metres", 1.0)


def _from_geo_keys(data: bytes) -> tuple[str, float] | None:
    keys = np.frombuffer(data[: len(data) // 8 * 8], "<u2").reshape(-1, 4)[1:]
    units = [_UNITS.get(int(value)) for key, where, _, value in keys if (key, where) == (_LINEAR_UNITS_KEY, 0)]
    return units[0] if units else None


def _from_wkt(data: bytes) -> tuple[str, float] | None:
    """The first unit of length in a projected system is that of its coordinates; the one inside GEOGCS is an angle."""
    text = data.decode("utf-8", "replace")
    if not text.lstrip().startswith(("PROJCS", "COMPD_CS", "LOCAL_CS", "GEOCCS")):
        return None
    units = [(name, _size(size)) for name, size in re.findall(r'UNIT\["([^"]+)",\s*([0-9.eE+-]+)', text)]
    return next(((name, size) for name, size in units if "deg" not in name.lower() and 1e-3 < size <= 1000), None)


def _size(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


FORMAT = Format("las", lambda head, path: head.startswith(MAGIC), LasSource, extra="las")
