"""The camera file that lies beside a depth image, for images whose format has no place for a camera."""

from __future__ import annotations

import os
from pathlib import Path

from siloscope.errors import InputError
from siloscope.io import camera_files
from siloscope.io.source import FrameSource

NAMES = (
    *(f"camera{suffix}" for suffix in (".json", ".toml", ".yaml", ".yml", ".txt")),
    *("camera_matrix.csv", "camera-intrinsics.txt", "intrinsic_depth.txt", "scene_camera.json"),
    *(f"camera_info{suffix}" for suffix in (".yaml", ".yml", ".json")),
    *("camera_intrinsic.json", "camera_intrinsics.json", "intrinsic.json"),
    *(f"intrinsics{suffix}" for suffix in (".json", ".toml", ".yaml", ".yml", ".txt")),
)
"""Names looked for, in the image's folder."""


def camera_file_beside(folder: Path) -> Path | None:
    """The camera file in a folder; raises `InputError` where several say different things."""
    paths = (os.path.join(folder, name) for name in NAMES)  # a Path for each would take longer than a small frame
    found = [Path(path) for path in paths if os.path.isfile(path)]
    if not found:
        return None
    if len({camera_files.read(path) for path in found}) > 1:
        names = ", ".join(path.name for path in found)
        raise InputError(f"{folder}: several different camera files ({names}); give the right one with --camera")
    return found[0]


def take_camera_beside(source: FrameSource, size: tuple[int, int], *folders: Path) -> None:
    """Gives a source the camera and unit of the file beside it, unless the user gave a camera."""
    if source.options.cameras or not source.options.beside:
        return
    path = next(filter(None, map(camera_file_beside, folders or (source.path.parent,))), None)
    if path is None:
        return
    stored = camera_files.read(path)
    source.file_camera, how = camera_files.choose(str(path), stored.cameras, size)
    source.provenance["camera_from"] = f"{path.name}, {how}" if how else path.name
    if stored.depth_unit is not None:
        source.file_depth_unit = stored.depth_unit
        source.provenance["depth_unit_from"] = path.name
