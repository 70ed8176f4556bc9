"""Folders of depth images or clouds, in the natural order of their names, and the layout of the TUM RGB-D dataset."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from siloscope.errors import InputError
from siloscope.io.arrays import npy, npz
from siloscope.io.beside import take_camera_beside
from siloscope.io.clouds import pcd, ply
from siloscope.io.images import netpbm, png, tiff, viewer_raw
from siloscope.io.source import Format, FrameSource, Item, Options
from siloscope.types.frame import Frame

TUM_LIST = "depth.txt"
TUM_DEPTH_UNIT = 0.0002
"""The TUM dataset's depth images have 5000 units a metre."""

FRAME_LIST = "frames.json"
"""What `siloscope convert` writes beside the frames: their names, times and gravity."""

_FORMATS = tuple(module.FORMAT for module in (png, tiff, netpbm, viewer_raw, npy, npz, ply, pcd))
_LARGEST_LIST = 64 << 20
_ALONE = Options(beside=False)


class FolderSource(FrameSource):
    """Files of one format with a frame each."""

    independent = True

    def __init__(self, path: Path, options: Options, files: Sequence[Path], format: Format, layout: str) -> None:
        super().__init__(path, "folder", options)
        self.files = tuple(files)
        self.file_format = format
        self._read_one = _one_frame_of(format)
        self.provenance |= {"layout": layout, "files": format.name}
        self._gravity: list[Any] = [None] * len(files)
        if size := self._image_size:
            take_camera_beside(self, size, *dict.fromkeys([path, self.files[0].parent]))
        if format is viewer_raw.FORMAT and self.file_camera is None and not options.cameras:
            with viewer_raw.ViewerRawSource(self.files[0], options) as first:
                self.file_camera, self.provenance["camera_from"] = first.file_camera, first.provenance["camera_from"]

    @cached_property
    def _first(self) -> FrameSource:
        return self.file_format.open(self.files[0], _ALONE)

    @cached_property
    def _image_size(self) -> tuple[int, int] | None:
        for file in self.files[:3]:
            try:
                stream = self.file_format.open(file, _ALONE)._streams()[0]
            except InputError:
                continue
            return tuple(stream["size"]) if stream["kind"] == "depth" else None
        return None

    def _items(self) -> Iterator[Item]:
        for index, file in enumerate(self.files):
            yield Item(str(file.relative_to(self.path)), partial(self._read, index))

    def _read(self, index: int) -> Frame:
        frame = self._read_one(self.files[index])
        time = self.timestamps[index] if self.timestamps else frame.timestamp
        gravity = self._gravity[index]
        return replace(frame, timestamp=time, gravity=frame.gravity if gravity is None else gravity)

    def _count(self) -> int:
        return len(self.files)

    def _streams(self) -> list[dict[str, Any]]:
        first = self._first._streams()[0]
        return [{**first, "frames": len(self.files)}]


def _open(path: Path, options: Options) -> FrameSource:
    if (path / TUM_LIST).is_file():
        return _open_tum(path, options)
    for folder in (path, path / "depth"):
        if folder.is_dir() and (found := _frame_files(folder)):
            return _open_files(path, options, folder, found)
    raise InputError(
        f"{path}: a folder without depth frames (16-bit PNG or PGM, TIFF, PFM, NumPy, the Viewer's .raw, PLY, PCD)"
        f"{_what_it_has(path)}; give the folder that holds them"
    )


def _what_it_has(path: Path) -> str:
    """How many files of which endings, for a message."""
    found = Counter(file.suffix.lower() or "no ending" for file in path.iterdir() if file.is_file())
    listed = ", ".join(f"{count} {suffix}" for suffix, count in found.most_common(5))
    return f", but with {listed}" if listed else ", and without files"


def _open_files(path: Path, options: Options, folder: Path, found: dict[str, list[Path]]) -> FrameSource:
    if len(found) > 1:
        kinds = ", ".join(f"{len(files)} {kind}" for kind, files in found.items())
        raise InputError(f"{path}: holds frames of several formats ({kinds}); give one kind: {path}/*.png")
    ((kind, files),) = found.items()
    source = FolderSource(path, options, files, next(f for f in _FORMATS if f.name == kind), "files in a folder")
    _take_list(source, folder)
    return source


def _frame_files(folder: Path) -> dict[str, list[Path]]:
    """Frames in a folder by format, in natural order; pictures and other files are left out."""
    found: dict[str, list[Path]] = {}
    for path in sorted(folder.iterdir(), key=lambda path: natural_key(path.name)):
        if path.is_file() and not path.name.startswith(".") and (kind := _kind(path)):
            found.setdefault(kind, []).append(path)
    return found


def natural_key(name: str) -> list[tuple[int, str]]:
    """Sorts frame2 before frame10."""
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", name) if part]


def _kind(path: Path) -> str | None:
    """The format of a frame file; None for other files, for 8-bit and colour pictures too."""
    try:
        with path.open("rb") as file:
            head = file.read(512)
    except OSError:
        return None
    if head.startswith(png.MAGIC):
        return "png" if head[24:26] == b"\x10\x00" else None
    return next((f.name for f in _FORMATS if f.sniff(head, path)), None)


def _take_list(source: FolderSource, folder: Path) -> None:
    """Times and gravity from the list that `convert` writes; times from names that are seconds since 1970."""
    names = [file.name for file in source.files]
    if (folder / FRAME_LIST).is_file():
        entries = _listed(folder / FRAME_LIST)
        rows = [entries.get(name, {}) for name in names]
        if all(isinstance(row.get("timestamp"), int | float) for row in rows):
            source.timestamps = [float(row["timestamp"]) for row in rows]
        source._gravity = [_vector(row.get("gravity")) for row in rows]
    elif all(re.fullmatch(r"1\d{9}\.\d+", Path(name).stem) for name in names):
        source.timestamps = [float(Path(name).stem) for name in names]


def _listed(path: Path) -> dict[str, dict[str, Any]]:
    try:
        if path.stat().st_size > _LARGEST_LIST:
            raise ValueError("too long")
        entries = json.loads(path.read_text(encoding="utf-8"))["frames"]
        return {str(entry["file"]): entry for entry in entries}
    except (OSError, ValueError, TypeError, KeyError, RecursionError) as error:
        raise InputError(f"{path}: not the list of frames that convert writes ({error}); remove it") from None


def _vector(value: Any) -> Any:
    return np.asarray(value, np.float64) if isinstance(value, list) and len(value) == 3 else None


def _open_tum(path: Path, options: Options) -> FrameSource:
    """The TUM layout: depth.txt has a time and a file name a line."""
    files, times = [], []
    for number, line in enumerate(_lines(path / TUM_LIST), 1):
        if line.strip() and not line.startswith("#"):
            time, file = _tum_line(path, number, line)
            times.append(time)
            files.append(file)
    if not files:
        raise InputError(f"{path / TUM_LIST}: lists no frames; each line has a time and a file name")
    source = FolderSource(path, options, files, png.FORMAT, "TUM RGB-D")
    source.timestamps = times
    if source.file_depth_unit is None:
        source.file_depth_unit = TUM_DEPTH_UNIT
        source.provenance["depth_unit_from"] = "TUM layout"
    return source


def _lines(path: Path) -> list[str]:
    try:
        if path.stat().st_size > _LARGEST_LIST:
            raise InputError(f"{path}: too long for a list of frames; check the file")
        return path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as error:
        raise InputError(f"{path}: can't be read ({error.strerror}); check its permissions") from None


def _tum_line(path: Path, number: int, line: str) -> tuple[float, Path]:
    words = line.split()
    try:
        time, file = float(words[0]), path / words[1]
        if not np.isfinite(time) or len(words) != 2 or not file.resolve().is_relative_to(path.resolve()):
            raise ValueError
    except (ValueError, IndexError, OSError):
        raise InputError(
            f"{path / TUM_LIST}: line {number} is not a time and the name of a file in this folder; correct the list"
        ) from None
    return time, file


FORMAT = Format("folder", lambda head, path: path.is_dir() and not head, _open)


def _one_frame_of(format: Format) -> Callable[[Path], Frame]:
    """What reads a file of one frame; every format in `_FORMATS` has it."""
    if format.read_one is None:
        raise InputError(f"files of the format {format.name} have no single frames; give the files themselves")
    return format.read_one
