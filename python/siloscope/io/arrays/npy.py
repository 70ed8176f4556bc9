"""NumPy's ``.npy``. The dtype decides: integers are raw units, floating point is metres.

Shapes: (H, W) one depth image, (F, H, W) a stack, (N, 3) points, (H, W, 3) organised points, (F, H, W, 3) a stack of
those.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError
from siloscope.io.arrays.stored_array import MAGIC, StoredArray, stored_array
from siloscope.io.beside import take_camera_beside
from siloscope.io.clouds.columns import with_recovered_camera
from siloscope.io.source import Format, FrameSource, Item, Options, check_image_size
from siloscope.types.frame import Frame

_SMALLEST_SIDE = 8
_SIDES = {"depth": 2, "points": 2, "organised": 3}


class ArraySource(FrameSource):
    """Frames of one stored array."""

    def __init__(self, path: Path, options: Options, format: str, array: StoredArray) -> None:
        super().__init__(path, format, options)
        self.array = array
        self.kind = _kind(array)
        sides = _image_shape(array.shape)
        self.stacked = len(sides) > _SIDES[self.kind]
        self.frame_shape = sides[1:] if self.stacked else sides
        self.labels: NDArray[Any] | None = None
        if self.kind != "points":
            check_image_size(array.name, *self.image_size)

    @property
    def image_size(self) -> tuple[int, int]:
        """Width and height of an image or organised cloud."""
        return self.frame_shape[1], self.frame_shape[0]

    def _items(self) -> Iterator[Item]:
        if not self.stacked:
            yield Item(self.path.name, partial(self._frame, None))
            return
        there = self._count()
        for index in range(there):
            yield Item(f"frame {index}", partial(self._frame, index))
        if there < self.array.shape[0]:
            raise InputError(f"{self.name}: cut off after {there} of {self.array.shape[0]} frames; save it again")

    def _frame(self, index: int | None) -> Frame:
        values = self._values(index).reshape(self.frame_shape)
        time = None if self.timestamps is None else self.timestamps[index or 0]
        frame = Frame(labels=self._labels(index), timestamp=time, source=self.name)
        return _with_values(frame, self.kind, values, self.array.name)

    def _values(self, index: int | None) -> NDArray[Any]:
        if index is None:
            return self.array.whole()
        return self._all[index] if self.array.fortran else self.array.part(index)

    @cached_property
    def _all(self) -> NDArray[Any]:
        """A stack in Fortran's order, whose frames lie scattered over the file."""
        return self.array.whole()

    def _labels(self, index: int | None) -> NDArray[Any] | None:
        if self.labels is None or not self.stacked or self.labels.ndim < len(_pixels(self)) + 1:
            return self.labels
        return np.asarray(self.labels[index])

    def _count(self) -> int:
        return self.array.parts_there() if self.stacked else 1

    def _streams(self) -> list[dict[str, Any]]:
        size = [self.frame_shape[0]] if self.kind == "points" else list(self.image_size)
        kind = "depth" if self.kind == "depth" else "points"
        stream = {"name": kind, "kind": kind, "size": size, "dtype": self.array.dtype.name}
        return [{**stream, "frames": self._count(), "chosen": True}]

    def close(self) -> None:
        self.array.file.close()


def _pixels(source: ArraySource) -> tuple[int, ...]:
    """Shape of what has a label each."""
    return source.frame_shape if source.kind == "depth" else source.frame_shape[:-1]


def labels_fit(source: ArraySource, labels: NDArray[Any]) -> bool:
    """Whether there is a label for each pixel or point, of one frame for all or of every frame."""
    pixels = _pixels(source)
    return labels.shape in (pixels, (source._count(), *pixels) if source.stacked else pixels)


def _image_shape(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Without a last side of 1, as (H, W, 1) images have."""
    return shape[:-1] if len(shape) >= 3 and shape[-1] == 1 else shape


def _kind(array: StoredArray) -> str:
    """What an array of this shape is: ``depth``, ``organised`` or ``points``."""
    shape = _image_shape(array.shape)
    if 0 in shape or not shape:
        raise InputError(f"{array.name}: the array is empty; save the frame again")
    if array.dtype.itemsize == 1:
        raise InputError(
            f"{array.name}: 8-bit values are a picture, not depth; save uint16 raw units or float32 metres"
        )
    if shape[-1] == 3 and 2 <= len(shape) <= 4:
        return "points" if len(shape) == 2 else "organised"
    if len(shape) not in (2, 3) or min(shape[-2:]) < _SMALLEST_SIDE:
        raise InputError(
            f"{array.name}: an array of shape {array.shape} is neither a depth image (H, W), a stack (F, H, W) "
            "nor points (N, 3) or (H, W, 3); save it in one of these shapes"
        )
    return "depth"


def _with_values(frame: Frame, kind: str, values: NDArray[Any], name: str) -> Frame:
    if values.dtype == np.float16:
        values = values.astype(np.float32)
    if kind == "depth":
        return replace(frame, depth=values)
    if not np.issubdtype(values.dtype, np.floating):
        raise InputError(f"{name}: points are integers ({values.dtype}) of unknown unit; save floating-point metres")
    frame = replace(frame, points=values)
    return with_recovered_camera(frame) if kind == "organised" else frame


def _open(path: Path, options: Options) -> ArraySource:
    file = path.open("rb")
    try:
        source = ArraySource(path, options, "npy", stored_array(file, str(path), path.stat().st_size))
        if source.kind == "depth":
            take_camera_beside(source, source.image_size)
    except InputError:
        file.close()
        raise
    return source


def read(path: Path) -> Frame:
    """The frame of a file that has one."""
    with _open(path, Options(beside=False)) as source:
        return only_frame(source)


def only_frame(source: ArraySource) -> Frame:
    """The frame of a source that has one, as stored."""
    if source.stacked:
        raise InputError(f"{source.name}: a stack in one file of several; give the file alone")
    return next(source._items()).read()


FORMAT = Format("npy", lambda head, path: head.startswith(MAGIC), _open, read_one=read)
