"""NumPy's ``.npz``: the frames in one array, ``depth`` or ``points`` (or its only one), and beside it ``depth_unit``,
``camera`` (the text of a JSON camera file) or ``K`` (3, 3), ``labels``, ``timestamps`` and ``gravity``.
"""

from __future__ import annotations

import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError
from siloscope.io import camera_files
from siloscope.io.arrays.npy import ArraySource, labels_fit, only_frame
from siloscope.io.arrays.stored_array import StoredArray, stored_array
from siloscope.io.beside import take_camera_beside
from siloscope.io.source import Format, Options
from siloscope.types.camera import Camera
from siloscope.types.frame import Frame

MAGIC = b"PK\x03\x04"
FRAME_NAMES = ("depth", "depths", "depth_image", "points", "xyz")
BESIDE_NAMES = ("depth_unit", "camera", "K", "labels", "timestamps", "gravity", "provenance")
_BEST_DEFLATE_RATIO = 1032
_LARGEST_BESIDE = 1 << 20


class NpzSource(ArraySource):
    """The main array of an archive, with what stands beside it."""

    def __init__(self, path: Path, options: Options) -> None:
        archive = _archive(path)
        try:
            main = _main(path, archive, options.stream)
            super().__init__(path, options, "npz", _member(path, archive, main))
            self.archive = archive
            self._read_beside()
        except InputError:
            archive.close()
            raise
        self.provenance["array"] = main

    def _read_beside(self) -> None:
        self.labels = self._read_labels()
        self.timestamps = self._read_timestamps()
        self.gravity = self._read_gravity()
        if not self.options.cameras:
            self._read_camera()
        if (unit := self._beside("depth_unit")) is not None:
            if unit.size != 1:
                raise InputError(f"{self.name}: 'depth_unit' must be one number, not {unit.shape}; save it again")
            self.file_depth_unit = float(unit.reshape(-1)[0])
            self.provenance["depth_unit_from"] = "file"

    def _read_labels(self) -> NDArray[Any] | None:
        labels = self._beside("labels")
        if labels is not None and not (labels.dtype.kind in "iu" and labels_fit(self, labels)):
            raise InputError(
                f"{self.name}: 'labels' of {labels.dtype} {labels.shape} are no whole number for each pixel or point; "
                "save them in the frame's shape"
            )
        return labels

    def _read_timestamps(self) -> list[float] | None:
        times = self._beside("timestamps")
        if times is not None and times.size != self._count():
            raise InputError(f"{self.name}: {times.size} timestamps for {self._count()} frames; save both again")
        return None if times is None else [float(time) for time in times.reshape(-1)]

    def _read_gravity(self) -> NDArray[np.float64] | None:
        gravity = self._beside("gravity")
        if gravity is not None and (gravity.shape != (3,) or not np.all(np.isfinite(gravity))):
            raise InputError(f"{self.name}: 'gravity' must be three finite numbers; save it again or leave it out")
        return None if gravity is None else gravity.astype(np.float64)

    def _read_camera(self) -> None:
        camera = self._stored_camera()
        if camera is not None:
            self.file_camera = camera
            self.provenance["camera_from"] = "file"
        elif self.kind == "depth":
            take_camera_beside(self, self.image_size)

    def _stored_camera(self) -> Camera | None:
        text = self._beside("camera", text=True)
        if text is not None and text.dtype.kind == "U" and text.size == 1:
            stored = camera_files.parse_json(f"{self.name}: camera", str(text.reshape(-1)[0]))
            self.file_depth_unit = stored.depth_unit
            return camera_files.choose(f"{self.name}: camera", stored.cameras, self.image_size)[0]
        matrix = self._beside("K")
        if matrix is None or self.kind == "points":
            return None
        return camera_files.from_matrix(f"{self.name}: K", matrix, *self.image_size)

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

    def _streams(self) -> list[dict[str, Any]]:
        return [{**stream, "name": self.provenance["array"]} for stream in super()._streams()]

    def close(self) -> None:
        super().close()
        self.archive.close()


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
        fitting = [name for name in FRAME_NAMES if name in names] or [n for n in names if n not in BESIDE_NAMES]
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


def read(path: Path) -> Frame:
    """The frame of a file that has one, with what is stored beside it."""
    with NpzSource(path, Options(beside=False)) as source:
        frame = only_frame(source)
    camera = frame.camera or source.file_camera
    return replace(frame, camera=camera, depth_unit=source.file_depth_unit, gravity=source.gravity)


def _sniff(head: bytes, path: Path) -> bool:
    name = head[30 : 30 + int.from_bytes(head[26:28], "little")]
    return head.startswith(MAGIC) and name.endswith(b".npy")


FORMAT = Format("npz", _sniff, NpzSource, read_one=read)
