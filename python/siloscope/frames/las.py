"""LAS and LAZ point clouds, by `laspy` and `lazrs` (extra ``las``)."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError
from siloscope.frame import Frame
from siloscope.frames.extras import need
from siloscope.frames.source import Format, FrameSource, Item, Options

MAGIC = b"LASF"
_STEP = 1_000_000
_LARGEST_RATIO = 1000
"""Points a byte of a compressed file at most: identical points cost next to nothing."""
_UNITS = {9001: ("metre", 1.0), 9002: ("foot", 0.3048), 9003: ("US survey foot", 1200 / 3937)}
_LINEAR_UNITS_KEY, _GEO_KEYS, _WKT = 3076, 34735, 2112


class LasSource(FrameSource):
    """All points of one file, float64: coordinates may be millions of metres from the origin."""

    def __init__(self, path: Path, options: Options) -> None:
        super().__init__(path, "las", options)
        self.laspy = need("laspy", "las", f"{path}: reading LAS and LAZ")
        self.header = self._header()
        self.count = int(self.header.point_count)
        self._check_count()
        unit, self.metres = unit_of(self.header)
        self.provenance["unit"] = unit
        self.provenance["axes"] = "as in the file: a map's, z up, not a camera's"

    def _header(self) -> Any:
        try:
            with self.laspy.open(self.path) as reader:
                return reader.header
        except Exception as error:
            raise self._damaged(error) from None

    def _check_count(self) -> None:
        size = self.path.stat().st_size - self.header.offset_to_point_data
        compressed = self.header.are_points_compressed
        most = size * _LARGEST_RATIO if compressed else size // max(1, self.header.point_format.size)
        if not 0 <= self.count <= max(0, most):
            raise InputError(
                f"{self.name}: {self.count} points are declared, more than the file holds; it is cut off or damaged"
            )
        if compressed:
            self._check_chunks()

    def _check_chunks(self) -> None:
        """The number of compressed chunks stands at the file's end, where a cut file has none."""
        with self.path.open("rb") as file:
            file.seek(self.header.offset_to_point_data)
            at = struct.unpack("<q", file.read(8).ljust(8, b"\xff"))[0]
            size = self.path.stat().st_size
            file.seek(at if 0 <= at <= size - 8 else max(0, size - 8))
            _, chunks = struct.unpack("<II", file.read(8).ljust(8, b"\xff"))
        if not 0 <= at <= size - 8 or chunks > size:
            raise InputError(f"{self.name}: the table of compressed points is missing; the file is cut off or damaged")

    def _items(self) -> Iterator[Item]:
        yield Item(self.path.name, self._decode)

    def _decode(self) -> Frame:
        parts: list[NDArray[np.float64]] = []
        try:
            with self.laspy.open(self.path) as reader:
                for chunk in reader.chunk_iterator(_STEP):
                    parts.append(np.stack([chunk.x, chunk.y, chunk.z], axis=1).astype(np.float64))
        except Exception as error:
            raise self._damaged(error) from None
        except BaseException as error:
            # The decompressor's own assertions arrive as an exception outside of Python's usual tree.
            if type(error).__name__ != "PanicException":
                raise
            raise self._damaged(error) from None
        points = np.concatenate(parts) if parts else np.empty((0, 3))
        if len(points) != self.count:
            raise InputError(f"{self.name}: {len(points)} of {self.count} points could be read; the file is cut off")
        return Frame(points=points * self.metres)

    def _damaged(self, error: BaseException) -> InputError:
        if isinstance(error, InputError):
            return error
        cause = str(error).splitlines()[0] if str(error) else type(error).__name__
        return InputError(f"{self.name}: damaged LAS or LAZ file ({cause}); export it again")

    def _count(self) -> int:
        return 1

    def _streams(self) -> list[dict[str, Any]]:
        stream = {"name": "points", "kind": "points", "size": self.count, "dtype": "float64"}
        return [{**stream, "frames": 1, "chosen": True}]


def unit_of(header: Any) -> tuple[str, float]:
    """Name of the linear unit, and metres in it, from the file's coordinate system; metres where it has none."""
    for record in header.vlrs:
        if record.record_id == _GEO_KEYS and (found := _from_geo_keys(record.record_data_bytes())):
            return found
        if record.record_id == _WKT and (found := _from_wkt(record.record_data_bytes())):
            return found
    return "not told, taken as metres", 1.0


def _from_geo_keys(data: bytes) -> tuple[str, float] | None:
    keys = np.frombuffer(data[: len(data) // 8 * 8], "<u2").reshape(-1, 4)[1:]
    units = [_UNITS.get(int(value)) for key, where, _, value in keys if (key, where) == (_LINEAR_UNITS_KEY, 0)]
    return units[0] if units else None


def _from_wkt(data: bytes) -> tuple[str, float] | None:
    """The last ``UNIT`` of a projected system is that of its coordinates; the one inside GEOGCS is an angle."""
    text = data.decode("utf-8", "replace")
    if not text.lstrip().startswith(("PROJCS", "COMPD_CS", "LOCAL_CS", "GEOCCS")):
        return None
    units = [(name, float(size)) for name, size in re.findall(r'UNIT\["([^"]+)",\s*([0-9.eE+-]+)', text)]
    lengths = [(name, size) for name, size in units if "deg" not in name.lower() and 1e-3 < size <= 1000]
    return lengths[0] if lengths else None


FORMAT = Format("las", lambda head, path: head.startswith(MAGIC), LasSource, extra="las")
