"""Camera files: intrinsics as JSON, TOML or YAML with named fields, OpenCV's FileStorage, Kalibr, COLMAP, ScanNet, BOP,
bare matrices, and what RealSense's tools write. The content decides which, not the name.
"""

from __future__ import annotations

import json
import re
import tomllib
from os import PathLike
from pathlib import Path
from typing import Any

from siloscope.errors import InputError
from siloscope.io.camera_files.distortion import DISTORTION_NAMES, distortion_model
from siloscope.io.camera_files.documents import from_document, joined
from siloscope.io.camera_files.enumeration import from_enumeration
from siloscope.io.camera_files.fields import CameraFile, camera, from_fields, from_matrix
from siloscope.io.camera_files.numpy_file import is_numpy, numpy_fields
from siloscope.io.camera_files.opencv import fields_of, is_file_storage
from siloscope.io.camera_files.tables import calibrations, stream_cameras
from siloscope.io.camera_files.writing import dump
from siloscope.io.camera_sizes import Intrinsics, choose, size_of
from siloscope.types.camera import Camera

__all__ = [
    "DISTORTION_NAMES",
    "CameraFile",
    "Intrinsics",
    "camera",
    "choose",
    "distortion_model",
    "dump",
    "from_matrix",
    "load",
    "parse",
    "parse_json",
    "read",
    "text_of",
]

LARGEST_FILE = 1 << 20
"""Bytes; no camera file is longer."""


def load(path: str | PathLike[str], size: tuple[int, int] | None = None) -> Camera:
    """The camera of a file, for a frame of `size` (width, height) or as the file has it. Raises `InputError`."""
    cameras = read(path).cameras
    if size is not None:
        return choose(str(path), cameras, size)[0]
    sizes = [size_of(camera) for camera in cameras]
    if len(cameras) == 1 and sizes[0] is not None:
        return choose(str(path), cameras, sizes[0])[0]
    known = ", ".join(f"{size[0]} x {size[1]}" if size else "no size" for size in sizes)
    raise InputError(f"{path}: has cameras of {known}; which is meant; keep the one of your depth stream in the file")


def read(path: str | PathLike[str]) -> CameraFile:
    """All that a camera file says; raises `InputError` naming the file and the field."""
    if is_numpy(Path(path)):
        return from_document(str(path), numpy_fields(Path(path)), calibration=True)
    return parse(str(path), text_of(Path(path)))


def parse(name: str, text: str) -> CameraFile:
    """Reads the text of a camera file in any of the formats; `name` is for messages."""
    if text.lstrip().startswith("{"):
        return parse_json(name, text)
    if re.search(r'^\s*Intrinsic of "', text, re.MULTILINE):
        return CameraFile(from_enumeration(name, text))
    if is_file_storage(text):
        return from_document(name, fields_of(name, text), calibration=True)
    if cameras := stream_cameras(name, text):
        return joined([from_fields(name, fields) for fields in cameras])
    if cameras := calibrations(name, text):
        return joined([from_fields(name, fields, calibration=True) for fields in cameras])
    return from_document(name, _toml_or_yaml(name, text))


def parse_json(name: str, text: str) -> CameraFile:
    """Reads the text of a JSON camera file."""
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{name}: not valid JSON ({error}); check the camera file") from None
    return from_document(name, document)


def text_of(path: Path) -> str:
    """The text of a camera file, UTF-8 or UTF-16; raises `InputError`."""
    try:
        if not path.is_file():
            raise InputError(f"{path}: no such camera file; check the path")
        with path.open("rb") as file:
            data = file.read(LARGEST_FILE + 1)
    except OSError as error:
        raise InputError(f"{path}: can't be read ({error.strerror}); check the path and its permissions") from None
    if len(data) > LARGEST_FILE or not data.strip():
        cause = "is empty" if not data.strip() else "is too long for a camera file"
        raise InputError(f"{path}: {cause}; give a file with the intrinsics of the depth camera")
    try:
        return data.decode("utf-16" if data.startswith((b"\xff\xfe", b"\xfe\xff")) else "utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path}: is not text; give the intrinsics as JSON, TOML or ROS camera_info YAML") from None


def _toml_or_yaml(name: str, text: str) -> Any:
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError):
        pass
    import yaml

    try:
        return next(iter(yaml.safe_load_all(text)), None)
    except (yaml.YAMLError, ValueError, TypeError, RecursionError) as error:
        cause = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(
            f"{name}: neither JSON, TOML, YAML nor any other camera file that is known ({cause}); "
            "give width, height, fx, fy, cx, cy as JSON"
        ) from None
