"""What the point cloud formats share: from named columns to points, from organised points to their camera."""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError
from siloscope.io.source import MAX_SIDE, FrameSource, Item, Options, check_image_size
from siloscope.types.camera import Camera
from siloscope.types.frame import Frame

Columns = Mapping[str, NDArray[Any]]
"""Fields of a cloud by name, each (N,)."""

RECOVERED = "recovered from the organised points"

LABEL_NAMES = ("label", "labels", "class", "classification", "segment", "scalar_label", "scalar_Label")


class CloudSource(FrameSource):
    """One file with one cloud."""

    def __init__(self, path: Path, format: str, options: Options, read: Callable[[Path], Frame]) -> None:
        super().__init__(path, format, options)
        self.size: list[int] = []
        self.dtype = ""
        self._read = read

    def _items(self) -> Iterator[Item]:
        yield Item(self.path.name, lambda: self._read(self.path))

    @property
    def camera(self) -> Camera | None:
        """The user's camera, else the one recovered from organised points (which reads them)."""
        given = super().camera
        return given or (self._recovered if len(self.size) == 2 else None)

    @cached_property
    def _recovered(self) -> Camera | None:
        try:
            with np.errstate(all="ignore"):
                camera = self._read(self.path).camera
        except InputError:
            return None  # told where the frame itself is asked for
        if camera is not None:
            self.provenance["camera_from"] = RECOVERED
        return camera

    def _count(self) -> int:
        return 1

    def _streams(self) -> list[dict[str, Any]]:
        return [{"name": "points", "kind": "points", "size": self.size, "dtype": "float", "frames": 1, "chosen": True}]


def cloud_frame(name: str, columns: Columns, grid: tuple[int, int] | None) -> Frame:
    """A frame of the columns x, y, z and, where there is one, the label; `grid` is (rows, columns) if organised."""
    by_name = {key.lower(): column for key, column in columns.items()}
    missing = [key for key in "xyz" if key not in by_name]
    if missing:
        found = ", ".join(columns) or "none"
        raise InputError(f"{name}: no field '{missing[0]}' among {found}; export the points with x, y and z")
    points = np.stack([_float(by_name[key]) for key in "xyz"], axis=-1)
    if not len(points):
        raise InputError(f"{name}: the cloud has no points; export it again")
    if not np.isfinite(points).all(axis=1).any():
        raise InputError(f"{name}: all {len(points)} points are invalid; check what the sensor saw")
    labels = next((_integer(columns[key]) for key in LABEL_NAMES if key in columns), None)
    return _organised(name, Frame(points=points, labels=labels, source=name), grid)


def _float(column: NDArray[Any]) -> NDArray[Any]:
    """Native float32 where it was that, float64 else."""
    return column.astype(np.float32 if column.dtype.itemsize == 4 and column.dtype.kind == "f" else np.float64)


def _integer(column: NDArray[Any]) -> NDArray[np.int64] | None:
    """Labels; None where they are no whole numbers."""
    if column.dtype.kind == "f" and not np.all(np.isfinite(column) & (np.abs(column) < 2**53)):
        return None
    whole = column.astype(np.int64)
    return whole if np.array_equal(whole, column) else None


def _organised(name: str, frame: Frame, grid: tuple[int, int] | None) -> Frame:
    points, labels = frame.points, frame.labels
    if grid is None or points is None:
        return frame
    rows, columns = grid
    if rows * columns != len(points):
        raise InputError(f"{name}: declared {columns} x {rows} points but has {len(points)}; export it again")
    check_image_size(name, columns, rows)
    labels = labels if labels is None else labels.reshape(rows, columns)
    return with_recovered_camera(replace(frame, points=points.reshape(rows, columns, 3), labels=labels))


_MOST_HOLES = 4
"""Places of a grid for a point that it has, above which the pixels' places are no use."""


def by_pixel(frame: Frame, pixels: NDArray[np.float64]) -> Frame:
    """Points (N, 3) laid out by their pixels' column and row (N, 2), as an organised frame with its camera.

    Where every other pixel was kept, so is the grid; places that are no whole numbers leave the points as they are.
    """
    points = frame.points
    if points is None or not np.all((pixels >= 0) & (pixels < MAX_SIDE) & (pixels == np.floor(pixels))):
        return frame
    places = pixels.astype(np.int64) - pixels.min(axis=0).astype(np.int64)
    places //= np.maximum(1, np.gcd.reduce(places, axis=0))
    columns, rows = (places.max(axis=0) + 1).tolist()
    if rows * columns > _MOST_HOLES * len(points):
        return frame
    grid = np.full((rows, columns, 3), np.nan, points.dtype)
    grid[places[:, 1], places[:, 0]] = points
    return with_recovered_camera(replace(frame, points=grid))


def with_recovered_camera(frame: Frame) -> Frame:
    """A frame of organised points with the camera that made them, where one fits and none is known."""
    if frame.points is None or frame.camera is not None or (camera := recover_camera(frame.points)) is None:
        return frame
    return replace(frame, camera=camera, provenance={**frame.provenance, "camera_from": RECOVERED})


_MOST_RMS_PX = 0.05
_SAMPLES = 20_000


def recover_camera(points: NDArray[Any]) -> Camera | None:
    """The pinhole camera that made organised points (H, W, 3), by least squares; None where none fits.

    Solves ``u = fx x/z + cx`` and ``v = fy y/z + cy`` (Eqs. 1 and 2) over the valid pixels and accepts an rms of
    1/20 pixel: points turned into another frame, distorted images and grids of scanners don't reach it.
    """
    height, width = points.shape[:2]
    v, u = np.nonzero(np.isfinite(points).all(axis=2) & (points[:, :, 2] > 0))
    step = max(1, len(u) // _SAMPLES)
    u, v = u[::step], v[::step]
    if len(np.unique(u)) < 3 or len(np.unique(v)) < 3:  # fewer pixels than can tell a focal length
        return None
    seen = points[v, u].astype(np.float64)
    across, down = _line(seen[:, 0] / seen[:, 2], u), _line(seen[:, 1] / seen[:, 2], v)
    if across is None or down is None:
        return None
    return Camera(width, height, across[0], down[0], across[1], down[1])


def _line(ratio: NDArray[np.float64], pixel: NDArray[np.int64]) -> tuple[float, float] | None:
    """Focal length and centre of ``pixel = f ratio + c``; None where it is no line or the length is not positive."""
    design = np.stack([ratio, np.ones_like(ratio)], axis=1)
    (f, c), *_ = np.linalg.lstsq(design, pixel, rcond=None)
    rms = float(np.sqrt(np.mean((design @ (f, c) - pixel) ** 2)))
    return (float(f), float(c)) if f > 0 and rms < _MOST_RMS_PX else None


def numbers_in_text(name: str, text: bytes, rows: int, columns: int, what: str) -> NDArray[np.float64]:
    """A (rows, columns) table of numbers apart by white space, one row a line.

    Raises `InputError` naming the line where one is short or holds no number: shifted columns would be wrong points.
    """
    if not rows:
        return np.empty((0, columns))
    if rows * columns * 2 > len(text) + 1:
        raise InputError(f"{name}: {len(text)} bytes can't hold {rows} {what}; the file was cut off, export it again")
    with warnings.catch_warnings(action="ignore"):
        try:
            table = np.loadtxt(io.BytesIO(text), np.float64, comments=None, max_rows=rows, ndmin=2)
        except ValueError as error:
            raise InputError(f"{name}: among the {what}, {error}; export the file again") from None
    if table.shape != (rows, columns):
        raise InputError(
            f"{name}: declared {rows} {what} of {columns} values but has {table.shape[0]} of {table.shape[1]}; "
            "the file was cut off or damaged, export it again"
        )
    return table


def as_declared(column: NDArray[np.float64], dtype: str | np.dtype[Any]) -> NDArray[Any]:
    """Numbers read from text in the floating-point type that the header declares; whole numbers stay float64."""
    declared = np.dtype(dtype)
    return column.astype(declared) if declared.kind == "f" else column
