"""Which part of a frame to look at: a mask file, a label, a box. All give boolean arrays of the frame's shape."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError
from siloscope.estimation.inputs import crop_box, metres, within
from siloscope.types.frame import Frame

Mask = NDArray[np.bool_]

LARGEST_MASK = 100_000_000
"""Pixels; a larger image is damaged or hostile."""


def depth_metres(frame: Frame) -> NDArray[np.float64]:
    """Depth (H, W) of an image frame in metres, NaN where there is no measurement."""
    depth = metres(frame).astype(np.float64)
    depth[depth == 0] = np.nan
    return depth


def frame_points(frame: Frame) -> NDArray[np.float64]:
    """Points of a frame in the camera frame, in metres: (H, W, 3) or (N, 3), NaN where there is no measurement.

    Depth images are back-projected (Eqs. 1 and 2); raises `InputError` for one without a camera.
    """
    if frame.points is not None:
        return np.asarray(frame.points, np.float64)
    if frame.depth is None or frame.camera is None:
        raise InputError(f"{frame.source}: a depth image needs its camera; give the intrinsics with --camera FILE")
    depth = depth_metres(frame)
    rays = frame.camera.rays()
    return np.dstack([rays[..., 0] * depth, rays[..., 1] * depth, depth])


def read_mask(path: str | PathLike[str], shape: tuple[int, ...]) -> Mask:
    """A mask from an image or ``.npy`` file: what is not 0 belongs to the silo.

    Raises
    ------
    InputError
        Where the file can't be read, is not of the frame's shape, or selects nothing.
    """
    values = _read_values(Path(path))
    if values.shape != shape:
        raise InputError(f"{path}: the mask is {_size(values.shape)} but the frame {_size(shape)}; make one for it")
    return _some(values != 0, f"{path}: the mask is 0 everywhere; mark the silo with any other value")


def label_mask(frame: Frame, label: int) -> Mask:
    """The points or pixels with one label of the file's own segmentation."""
    if frame.labels is None:
        raise InputError(f"{frame.source}: the file has no labels; use --mask or --crop instead")
    labels = np.asarray(frame.labels)
    there = ", ".join(str(value) for value in np.unique(labels)[:20])
    return _some(
        np.asarray(labels == label, np.bool_),
        f"{frame.source}: no point has the label {label}; labels there are {there}",
    )


def box_mask(frame: Frame, box: Sequence[float]) -> Mask:
    """The points or pixels inside ``xmin, xmax, ymin, ymax, zmin, zmax`` of the camera frame, metres."""
    points = frame_points(frame)
    return _some(within(points, crop_box(box)), f"{frame.source}: no point lies in the crop box {_extent(points)}")


def _some(mask: Any, complaint: str) -> Mask:
    if not mask.any():
        raise InputError(complaint)
    chosen: Mask = mask
    return chosen


def _extent(points: NDArray[np.float64]) -> str:
    flat = points.reshape(-1, 3)
    seen = flat[np.isfinite(flat).all(axis=1)]
    if not len(seen):
        return "(the frame has no points at all)"
    pairs = zip(seen.min(axis=0), seen.max(axis=0), strict=True)
    return "(the points reach " + ", ".join(f"{low:.3g} to {high:.3g} m" for low, high in pairs) + " in x, y, z)"


def _size(shape: tuple[int, ...]) -> str:
    return " x ".join(str(side) for side in reversed(shape))


def _read_values(path: Path) -> NDArray[Any]:
    try:
        with path.open("rb") as file:
            head = file.read(8)
        return _array(path) if head.startswith(b"\x93NUMPY") else _image(path)
    except OSError as error:
        raise InputError(f"{path}: the mask can't be read ({error.strerror or error}); check the path") from None


def _array(path: Path) -> NDArray[Any]:
    try:
        values = np.load(path, allow_pickle=False, mmap_mode="r")
    except ValueError as error:
        raise InputError(f"{path}: the mask can't be read ({error}); save it with numpy.save") from None
    if values.dtype.kind not in "biuf":
        raise InputError(f"{path}: a mask of type {values.dtype} can't be used; save whole numbers or booleans")
    return np.array(values)


def _image(path: Path) -> NDArray[Any]:
    from PIL import Image

    remedy = "save the mask as an 8-bit PNG of the frame's size, 0 outside the silo"
    try:
        with Image.open(path) as image:
            if image.width * image.height > LARGEST_MASK:
                raise InputError(f"{path}: the mask is declared {image.width} x {image.height} pixels; {remedy}")
            values = np.asarray(image if image.mode in ("1", "L", "I", "I;16", "P") else image.convert("L"))
    except InputError:
        raise
    except Exception as error:  # each image format fails in its own way
        raise InputError(f"{path}: the mask can't be read as an image ({error}); {remedy}") from None
    return values
