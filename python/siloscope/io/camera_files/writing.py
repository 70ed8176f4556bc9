"""Writes camera files."""

from __future__ import annotations

import json
from os import PathLike
from pathlib import Path
from typing import Any

from siloscope.errors import InputError
from siloscope.types.camera import Camera

_ROS_NAMES = {
    "none": "plumb_bob",
    "brown_conrady": "plumb_bob",
    "rational": "rational_polynomial",
    "kannala_brandt": "equidistant",
}


def dump(camera: Camera, path: str | PathLike[str], depth_unit: float | None = None) -> None:
    """Writes a camera file: TOML for ``.toml``, ROS ``camera_info`` for ``.yaml``, else JSON with named fields.

    `depth_unit` (metres per raw unit) goes into TOML and JSON; ROS has no place for it.
    """
    path = Path(path)
    fields = camera.to_dict() | ({} if depth_unit is None else {"depth_unit": depth_unit})
    if path.suffix == ".toml":
        text = "".join(f"{key} = {_toml(value)}\n" for key, value in fields.items())
    elif path.suffix in (".yaml", ".yml"):
        text = _ros_yaml(camera)
    else:
        text = json.dumps(fields, indent=2) + "\n"
    path.write_text(text, encoding="utf-8")


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {_toml(each)}" for key, each in value.items()) + "}"
    return json.dumps(value)


def _ros_yaml(camera: Camera) -> str:
    if camera.distortion_model not in _ROS_NAMES:
        raise InputError(f"ROS has no distortion model '{camera.distortion_model}'; write the camera as .toml or .json")
    k = list(camera.distortion) or [0.0] * 5
    fx, fy, cx, cy = camera.fx, camera.fy, camera.cx, camera.cy
    projection = [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    return (
        f"image_width: {camera.width}\nimage_height: {camera.height}\n"
        f"camera_matrix:\n  rows: 3\n  cols: 3\n  data: {[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]}\n"
        f"distortion_model: {_ROS_NAMES[camera.distortion_model]}\n"
        f"distortion_coefficients:\n  rows: 1\n  cols: {len(k)}\n  data: {k}\n"
        "rectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]\n"
        f"projection_matrix:\n  rows: 3\n  cols: 4\n  data: {projection}\n"
    )
