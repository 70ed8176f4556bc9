"""NumPy's ``.npy`` and ``.npz``. The dtype decides: integers are raw units, floating point is metres.

Shapes: (H, W) one depth image, (F, H, W) a stack, (N, 3) points, (H, W, 3) organised points, (F, H, W, 3) a stack of
those. An ``.npz`` names its arrays: ``depth`` or ``points`` (or its only array), and beside it ``depth_unit``,
``camera`` (the text of a JSON camera file) or ``K`` (3, 3), ``labels``, ``timestamps`` and ``gravity``.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.camera import Camera
from siloscope.errors import InputError
from siloscope.frame import Frame
from siloscope.frames.arrays import MAGIC, StoredArray, stored_array
from siloscope.frames.beside import take_camera_beside
from siloscope.frames.source import Format, FrameSource, Item, Options, check_image_size

ZIP_MAGIC = b"PK\x03\x04"
DEPTH_NAMES = ("depth", "depths", "depth_image", "points", "xyz")
BESIDE_NAMES = ("depth_unit", "camera", "K", "labels", "timestamps", "gravity", "provenance")
_BEST_DEFLATE_RATIO = 1032
_LARGEST_BESIDE = 1 << 20
_SMALLEST_SIDE = 8


class ArraySource(FrameSource):
    """Frames of one stored array."""

    def __init__(self, path: Path, options: Options, format: str, array: StoredArray, main: str = "") -> None:
        super().__init__(path, format, options)
        self.array = array
        self.kind = _kind(array, main)
        self.stacked = len(_image_shape(array.shape)) > {"depth": 2, "organised": 3, "points": 2}[self.kind]
        self.labels: NDArray[Any] | None = None
        if self.kind != "points":
            height, width = _image_shape(array.shape)[int(self.stacked) :][:2]
            check_image_size(array.name, width, height)
            if self.kind == "depth":
                take_camera_beside(self, (width, height))

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
        values = self._values(index).reshape(_image_shape(self.array.shape)[int(self.stacked) :])
        time = None if self.timestamps is None else self.timestamps[index or 0]
        frame = Frame(labels=self._labels(index), timestamp=time, source=self.name)
        return _with_values(frame, self.kind, values, self.array.name)

    def _values(self, index: int | None) -> NDArray[Any]:
        if index is None:
            return self.array.whole()
        return self.array.whole()[index] if self.array.fortran else self.array.part(index)

    def _labels(self, index: int | None) -> NDArray[Any] | None:
        stacked = self.labels is not None and self.labels.ndim == 3 and index is not None
        return self.labels[index] if stacked and self.labels is not None else self.labels

    def _count(self) -> int:
        return self.array.parts_there() if self.stacked else 1

    def _streams(self) -> list[dict[str, Any]]:
        shape = _image_shape(self.array.shape)[int(self.stacked) :]
        size = [shape[0]] if self.kind == "points" else [shape[1], shape[0]]
        kind = "depth" if self.kind == "depth" else "points"
        dtype = self.array.dtype.name
        return [{"name": kind, "kind": kind, "size": size, "dtype": dtype, "frames": self._count(), "chosen": True}]

    def close(self) -> None:
        self.array.file.close()


def _image_shape(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Without a last side of 1, as (H, W, 1) images have."""
    return shape[:-1] if len(shape) >= 3 and shape[-1] == 1 else shape


def _kind(array: StoredArray, main: str) -> str:
    """What an array of this shape and name is: ``depth``, ``organised`` or ``points``."""
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
    return replace(frame, points=values)


def _open_npy(path: Path, options: Options) -> FrameSource:
    file = path.open("rb")
    try:
        return ArraySource(path, options, "npy", stored_array(file, str(path), path.stat().st_size))
    except InputError:
        file.close()
        raise


class NpzSource(ArraySource):
    """The main array of an archive, with what stands beside it."""

    def __init__(self, path: Path, options: Options) -> None:
        archive = _archive(path)
        try:
            main = _main(path, archive, options.stream)
            super().__init__(path, options, "npz", _member(path, archive, main), main)
            self.archive = archive
            self._read_beside()
        except InputError:
            archive.close()
            raise
        self.provenance["array"] = main

    def _read_beside(self) -> None:
        self.labels = self._beside("labels")
        if (times := self._beside("timestamps")) is not None:
            self.timestamps = [float(time) for time in np.ravel(times)]
            if len(self.timestamps) != self._count():
                raise InputError(
                    f"{self.name}: {len(self.timestamps)} timestamps for {self._count()} frames; save both again"
                )
        if (gravity := self._beside("gravity")) is not None:
            if gravity.shape != (3,) or not np.all(np.isfinite(gravity)):
                raise InputError(f"{self.name}: 'gravity' must be three finite numbers; save it again or leave it out")
            self.gravity = gravity.astype(np.float64)
        if (unit := self._beside("depth_unit")) is not None:
            self.file_depth_unit = _scalar(self.name, "depth_unit", unit)
            self.provenance["depth_unit_from"] = "file"
        self.file_camera = self._stored_camera()

    def _stored_camera(self) -> Camera | None:
        from siloscope import camera_files

        if (text := self._beside("camera", text=True)) is not None and text.dtype.kind == "U" and text.size == 1:
            stored = camera_files.parse_json(f"{self.name}: camera", str(text.reshape(-1)[0]))
            self.file_depth_unit = self.file_depth_unit or stored.depth_unit
            self.provenance["camera_from"] = "file"
            return stored.cameras[0]
        if (matrix := self._beside("K")) is not None and self.kind != "points":
            height, width = _image_shape(self.array.shape)[int(self.stacked) :][:2]
            self.provenance["camera_from"] = "file"
            return camera_files.from_matrix(f"{self.name}: K", matrix, width, height)
        return None

    def _beside(self, name: str, text: bool = False) -> NDArray[Any] | None:
        if f"{name}.npy" not in self.archive.namelist():
            return None
        largest = max(_LARGEST_BESIDE, self.array.nbytes)
        if self.archive.getinfo(f"{name}.npy").file_size > largest:
            raise InputError(f"{self.name}: '{name}' is larger than it can be; save the file again")
        with _member(self.path, self.archive, name, text=text).file as file:
            file.seek(0)
            size = self.archive.getinfo(f"{name}.npy").file_size
            return stored_array(file, f"{self.name}: {name}", size, text=text).whole()

    def close(self) -> None:
        super().close()
        self.archive.close()


def _scalar(name: str, key: str, value: NDArray[Any]) -> float:
    if value.size != 1:
        raise InputError(f"{name}: '{key}' must be one number, not {value.shape}; save it again")
    return float(value.reshape(-1)[0])


def _archive(path: Path) -> zipfile.ZipFile:
    try:
        return zipfile.ZipFile(path)
    except Exception as error:  # zipfile raises many kinds on hostile directories
        raise InputError(f"{path}: damaged npz archive ({error}); save it again with numpy.savez") from None


def _main(path: Path, archive: zipfile.ZipFile, stream: str | None) -> str:
    """Name of the array that holds the frames."""
    names = [name.removesuffix(".npy") for name in archive.namelist() if name.endswith(".npy")]
    if stream is not None:
        fitting = [name for name in names if stream == name] or [name for name in names if stream in name]
    else:
        fitting = [name for name in DEPTH_NAMES if name in names] or [n for n in names if n not in BESIDE_NAMES]
    if len(set(fitting)) == 1:
        return fitting[0]
    found = ", ".join(names) or "none"
    raise InputError(f"{path}: which array holds the frames? It has {found}; give --stream NAME, or save it as 'depth'")


def _member(path: Path, archive: zipfile.ZipFile, name: str, *, text: bool = False) -> StoredArray:
    info = archive.getinfo(f"{name}.npy")
    label = f"{path}: {name}"
    if info.flag_bits & 1 or info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise InputError(f"{label}: encrypted or unusually compressed; save it again with numpy.savez")
    stored = min(info.compress_size, path.stat().st_size)
    if info.file_size > stored * _BEST_DEFLATE_RATIO + 1024:
        raise InputError(
            f"{label}: {stored} bytes can't hold the declared {info.file_size}; the file is damaged or hostile"
        )
    try:
        file = archive.open(info)
    except Exception as error:  # as in _archive
        raise InputError(f"{label}: can't be read ({error}); save it again with numpy.savez") from None
    return stored_array(file, label, info.file_size, text=text)


def _open(path: Path, options: Options) -> FrameSource:
    with path.open("rb") as file:
        zipped = file.read(4) == ZIP_MAGIC
    return NpzSource(path, options) if zipped else _open_npy(path, options)


def _sniff(head: bytes, path: Path) -> bool:
    if head.startswith(MAGIC):
        return True
    return head.startswith(ZIP_MAGIC) and b".npy" in head[26 : 30 + int.from_bytes(head[26:28], "little")]


def read(path: Path) -> Frame:
    """The frame of a file that has one."""
    with _open(path, Options(beside=False)) as source:
        if len(source) != 1:
            raise InputError(f"{path}: {len(source)} frames in one file of several; give the file alone")
        frame = next(source._items()).read()
    unit = source.file_depth_unit if frame.depth_unit is None else frame.depth_unit
    return replace(frame, camera=source.file_camera, depth_unit=unit, gravity=source.gravity)


FORMAT = Format("npy", _sniff, _open, read_one=read)
