"""Recordings of Livox lidars: ``.lvx`` (versions 1.0 and 1.1) and ``.lvx2``, a frame a second.

Points tagged as dust are left out. Axes are the lidar's: x forward, y left, z up.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError
from siloscope.io.source import Format, FrameSource, Item, Options
from siloscope.types.frame import Frame

MAGIC = b"livox_tech"
_CODE = 0xAC0EA767
_HEADER, _PRIVATE, _FRAME_HEAD = 24, 5, 24
_DEVICE = {1: 59, 2: 63}
"""Bytes of a device's description, by version."""
_PACKAGE_HEAD = {1: 19, 2: 27}
_WINDOW_S = 1.0
"""Length of a frame: Livox's pattern does not repeat, and 50 ms of it show a silo thinly."""
_STANDARD_GRAVITY = 9.80665

_RAW = [("xyz", "<i4", 3), ("reflectivity", "u1")]
_TAGGED = [*_RAW, ("tag", "u1")]
_POLAR = [("depth", "<u4"), ("theta", "<u2"), ("phi", "<u2"), ("reflectivity", "u1")]
_RETURNS = [("xyz", "<i4", 3), ("reflectivity", "u1"), ("tag", "u1")]
_CENTIMETRES = [("xyz", "<i2", 3), ("reflectivity", "u1"), ("tag", "u1")]


class Kind(NamedTuple):
    """How the points of a package are stored."""

    dtype: np.dtype[Any]
    returns: int
    """In a package of version 1."""
    metres: float
    """Metres a unit of length."""


KINDS: dict[tuple[int, int], Kind] = {
    (1, 0): Kind(np.dtype(_RAW), 100, 1e-3),
    (1, 1): Kind(np.dtype(_POLAR), 100, 1e-3),
    (1, 2): Kind(np.dtype(_TAGGED), 96, 1e-3),
    (1, 3): Kind(np.dtype([*_POLAR, ("tag", "u1")]), 96, 1e-3),
    (1, 4): Kind(np.dtype(_RETURNS), 2 * 48, 1e-3),
    (1, 7): Kind(np.dtype(_RETURNS), 3 * 30, 1e-3),
    (2, 1): Kind(np.dtype(_TAGGED), 0, 1e-3),
    (2, 2): Kind(np.dtype(_CENTIMETRES), 0, 1e-2),
}
"""By version and number of the data type."""
_OTHER_SIZES = {5: 48 * 16, 6: 24, 8: 30 * 22}
"""Bytes of packages of version 1 that hold no points that are read: several returns in polar form, and the IMU."""
_IMU = 6
_IMU_TYPES = {1: 6, 2: 0}


class Package(NamedTuple):
    """One package of points, not decoded yet."""

    time_s: float
    kind: Kind
    at: int
    size: int


class LivoxSource(FrameSource):
    """One recording."""

    def __init__(self, path: Path, options: Options) -> None:
        super().__init__(path, "livox", options)
        self.file = path.open("rb")
        self.size = path.stat().st_size
        self.damage: str | None = None
        self.packages: list[Package] = []
        self._accelerations: list[NDArray[np.float64]] = []
        try:
            self.version, first = self._read_header()
            self._index(first)
            if not self.packages:
                raise InputError(self.damage or f"{self.name}: the recording has no points; record again")
        except BaseException:
            self.file.close()
            raise
        start = self.packages[0].time_s
        seconds = groupby(self.packages, lambda package: int((package.time_s - start) / _WINDOW_S))
        self.windows = [list(window) for _, window in seconds]
        self.timestamps = [window[0].time_s for window in self.windows]
        self.provenance["axes"] = "the lidar's: x forward, y left, z up"
        self._take_gravity()

    def _read_header(self) -> tuple[int, int]:
        """Version, and where the first frame begins."""
        head = self.file.read(_HEADER + _PRIVATE)
        version = head[16] if len(head) == _HEADER + _PRIVATE else 0
        if version not in _DEVICE or head[17] not in (0, 1) or struct.unpack_from("<I", head, 20)[0] != _CODE:
            raise InputError(f"{self.name}: damaged, or an LVX of another version than 1.1 and 2.0; convert it to LAS")
        if version == 1 and head[17] == 0:
            return version, self._first_frame_of_1_0(head[24], head[28])
        return version, _HEADER + _PRIVATE + head[28] * _DEVICE[version]

    def _first_frame_of_1_0(self, *devices: int) -> int:
        """Where the frames of an LVX 1.0 begin, which had no frame duration and shorter devices: a frame's head names
        its own place. Raises `InputError` where none does."""
        for private, count in zip((1, _PRIVATE), devices, strict=True):
            for device in (_DEVICE[1] - 1, _DEVICE[1]):
                at = _HEADER + private + count * device
                if self._bytes(at, 8) == struct.pack("<Q", at):
                    return at
        raise InputError(f"{self.name}: an LVX of version 1.0 without a frame; convert it to LAS in Livox Viewer")

    def _index(self, at: int) -> None:
        """Finds the packages by the frames' offsets, up to where the file breaks off."""
        while at + _FRAME_HEAD <= self.size:
            here, after, _ = struct.unpack("<QQQ", self._bytes(at, _FRAME_HEAD))
            if here != at or not at + _FRAME_HEAD <= after:
                self.damage = f"{self.name}: the recording is damaged at byte {at}; frames before are read"
                return
            self._index_frame(at + _FRAME_HEAD, min(after, self.size))
            if after > self.size:
                self.damage = f"{self.name}: the recording is cut off; frames before are read"
                return
            at = after

    def _index_frame(self, at: int, end: int) -> None:
        head_size = _PACKAGE_HEAD[self.version]
        while at + head_size <= end:
            head = self._bytes(at, head_size)
            number, time_ns, size = _described(self.version, head)
            at += head_size
            if size is None or at + size > end:
                return
            kind = KINDS.get((self.version, number))
            if kind is not None and size >= kind.dtype.itemsize:
                self.packages.append(Package(time_ns * 1e-9, kind, at, size))
            elif number == _IMU_TYPES[self.version] and size >= _OTHER_SIZES[_IMU]:
                self._accelerations.append(np.frombuffer(self._bytes(at + 12, 12), "<f4").astype(np.float64))
            at += size

    def _bytes(self, at: int, size: int) -> bytes:
        self.file.seek(at)
        return self.file.read(size)

    def _take_gravity(self) -> None:
        """Gravity in the lidar's axes: its accelerometer, in units of g, measures minus that at rest."""
        from siloscope.io.recordings import gravity

        if not self._accelerations:
            self.provenance["gravity_from"] = "no accelerometer recorded"
            return
        samples = np.array(self._accelerations) * _STANDARD_GRAVITY
        self.gravity, self.provenance["gravity_from"] = gravity.at_rest(samples)

    def _items(self) -> Iterator[Item]:
        for number, window in enumerate(self.windows):
            yield Item(f"frame {number}", partial(self._decode, window))
        if self.damage:
            raise InputError(self.damage)

    def _decode(self, window: list[Package]) -> Frame:
        parts = [_points(self.version, package, self._bytes(package.at, package.size)) for package in window]
        points = np.concatenate([points for points, _ in parts])
        dust = sum(count for _, count in parts)
        if not len(points):
            raise InputError(f"{self.name}: no point was measured in this frame")
        return Frame(points=points, timestamp=window[0].time_s, provenance={"left_out_as_dust": dust})

    def _count(self) -> int:
        return len(self.windows)

    def _streams(self) -> list[dict[str, Any]]:
        size = sum(package.size // package.kind.dtype.itemsize for package in self.windows[0])
        stream = {"name": "points", "kind": "points", "size": [size], "dtype": "float32"}
        return [{**stream, "frames": len(self.windows), "chosen": True}]

    def close(self) -> None:
        """Lets go of the file."""
        self.file.close()


def _described(version: int, head: bytes) -> tuple[int, int, int | None]:
    """Data type, time in nanoseconds, and bytes of a package's content, None where the type is unknown."""
    if version == 1:
        number, time_ns = struct.unpack_from("<BQ", head, 10)
        kind = KINDS.get((1, number))
        return number, time_ns, kind.dtype.itemsize * kind.returns if kind else _OTHER_SIZES.get(number)
    time_ns, _, number, size = struct.unpack_from("<QHBI", head, 7)
    return number, time_ns, size


def _points(version: int, package: Package, data: bytes) -> tuple[NDArray[np.float32], int]:
    """Points (N, 3) of a package in metres, without those not measured and those tagged as dust, and how many these."""
    kind = package.kind
    rows = np.frombuffer(data, kind.dtype, len(data) // kind.dtype.itemsize)
    points = (rows["xyz"] * kind.metres) if "xyz" in (kind.dtype.names or ()) else _from_polar(rows, kind.metres)
    measured = np.any(points != 0, axis=1)
    dust = _is_dust(version, rows["tag"]) if "tag" in (kind.dtype.names or ()) else np.zeros(len(rows), bool)
    return points[measured & ~dust].astype(np.float32), int(np.count_nonzero(measured & dust))


def _from_polar(rows: NDArray[Any], metres: float) -> NDArray[np.float64]:
    """Range, zenith and azimuth, in hundredths of a degree, to x, y, z."""
    r, theta, phi = rows["depth"] * metres, np.radians(rows["theta"] / 100), np.radians(rows["phi"] / 100)
    return np.stack([r * np.sin(theta) * np.cos(phi), r * np.sin(theta) * np.sin(phi), r * np.cos(theta)], axis=1)


def _is_dust(version: int, tags: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Points that the lidar takes for noise by the strength of their return (bits 2, 3) or their place (bits 0, 1).

    Mid-40, Mid-70, Horizon and Avia (version 1) tag noise with high confidence by 1, with moderate by 2; Mid-360 and
    HAP (version 2) tag their confidence in the point, 2 being low. Source: Livox's manuals, "point cloud tag".
    """
    noise: NDArray[np.bool_] = np.zeros(len(tags), bool)
    for shift in (0, 2):
        group = tags >> shift & 3
        noise |= (group == 2) | ((group == 1) & (version == 1))
    return noise


FORMAT = Format("livox", lambda head, path: head.startswith(MAGIC), LivoxSource)
