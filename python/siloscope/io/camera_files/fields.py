"""Cameras from named fields, in the spellings that are in use."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from siloscope.errors import InputError
from siloscope.io.camera_files.distortion import distortion_model, is_fisheye
from siloscope.types.camera import Camera

_FIELD_NAMES = {
    "width": ("width", "image_width", "w"),
    "height": ("height", "image_height", "h"),
    "fx": ("fx", "focal_x"),
    "fy": ("fy", "focal_y"),
    "cx": ("cx", "ppx"),
    "cy": ("cy", "ppy"),
}
_MATRIX_NAMES = ("camera_matrix", "K", "k")
_MODEL_NAMES = ("distortion_model", "model", "camera_model")
_COEFFICIENT_NAMES = ("distortion_coefficients", "distortion", "coeffs", "coefficients", "D", "d")
_NESTED_NAMES = ("camera", "depth", "depth_camera", "depth_intrinsics", "intrinsic", "intrinsics")


@dataclass(frozen=True)
class CameraFile:
    """What a camera file says.

    Attributes
    ----------
    cameras : tuple of Camera
        One, or one a resolution.
    depth_unit : float or None
        Metres per raw unit, where the file has it.
    """

    cameras: tuple[Camera, ...]
    depth_unit: float | None = None


def from_fields(name: str, fields: Any) -> CameraFile:
    """The camera and unit in named fields, as a camera file has them; raises `InputError` naming the field."""
    if not isinstance(fields, Mapping):
        raise InputError(f"{name}: no named fields; a camera file has width, height, fx, fy, cx, cy")
    nested = [fields[key] for key in _NESTED_NAMES if isinstance(fields.get(key), Mapping)]
    inner = nested[0] if nested and not _has_focal_length(fields) else fields
    _refuse_crops(name, inner)
    values = {key: _number(name, key, _field(name, inner, key)) for key in ("width", "height")}
    values |= _focal_lengths(name, inner)
    named = next((inner[key] for key in _MODEL_NAMES if isinstance(inner.get(key), str)), "")
    k = _coefficients(name, inner, fisheye=is_fisheye(named))
    model = distortion_model(name, named, k)
    unit = depth_unit_of(name, inner) or depth_unit_of(name, fields)
    return CameraFile((_camera(name, values, model, k),), unit)


def _camera(name: str, values: dict[str, float], model: str, k: list[float]) -> Camera:
    try:
        camera = Camera(**values, distortion_model=model, distortion=() if model == "none" else tuple(k))  # type: ignore[arg-type]
    except (InputError, OverflowError, ValueError) as error:
        raise InputError(f"{name}: {error}") from None
    if camera.cx == 0 == camera.cy:
        raise InputError(f"{name}: cx and cy are both 0; give the sensor's own intrinsics with --camera FILE")
    return camera


def _has_focal_length(fields: Mapping[str, Any]) -> bool:
    return any(key in fields for key in (*_FIELD_NAMES["fx"], *_MATRIX_NAMES, "intrinsic_matrix"))


def _field(name: str, fields: Mapping[str, Any], key: str) -> Any:
    for alias in _FIELD_NAMES[key]:
        if alias in fields:
            return fields[alias]
    raise InputError(f"{name}: '{key}' is missing; a camera file has width, height, fx, fy, cx, cy")


def _number(name: str, key: str, value: Any) -> float:
    try:
        if isinstance(value, bool):
            raise TypeError
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name}: '{key}' is {value!r}, not a number; correct the camera file") from None
    if not math.isfinite(number):
        raise InputError(f"{name}: '{key}' is {number}; give the sensor's own intrinsics with --camera FILE")
    return number


def _focal_lengths(name: str, fields: Mapping[str, Any]) -> dict[str, float]:
    if "intrinsic_matrix" in fields:
        return _by_column(name, _matrix(name, "intrinsic_matrix", fields["intrinsic_matrix"]))
    if any(alias in fields for alias in _FIELD_NAMES["fx"]):
        return {key: _number(name, key, _field(name, fields, key)) for key in ("fx", "fy", "cx", "cy")}
    for key in _MATRIX_NAMES:
        if key in fields:
            return _by_row(name, key, _matrix(name, key, fields[key]))
    raise InputError(f"{name}: 'fx' is missing; a camera file has width, height, fx, fy, cx, cy")


def _matrix(name: str, key: str, value: Any) -> list[float]:
    """Nine numbers of a matrix written flat, as rows, or as ROS's ``{rows, cols, data}``."""
    if isinstance(value, Mapping):
        value = value.get("data")
    rows = value if isinstance(value, list) else []
    flat = [item for row in rows for item in (row if isinstance(row, list) else [row])]
    if len(flat) != 9:
        raise InputError(f"{name}: '{key}' has {len(flat)} numbers, not 9; correct the camera file")
    return [_number(name, f"{key}[{i}]", item) for i, item in enumerate(flat)]


def _by_column(name: str, m: list[float]) -> dict[str, float]:
    """Open3D writes the matrix column by column: cx and cy are the elements 6 and 7. Rows are told by their zeros."""
    if m[2] == 0 == m[5]:
        m = [m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]]
    return _by_row(name, "intrinsic_matrix", m)


def _by_row(name: str, key: str, m: list[float]) -> dict[str, float]:
    if m[1] != 0 or m[3] != 0 or m[6] != 0 or m[7] != 0 or (m[8] != 1 and any(m)):
        raise InputError(f"{name}: '{key}' is {m}, no matrix of a pinhole without skew; correct the camera file")
    return {"fx": m[0], "fy": m[4], "cx": m[2], "cy": m[5]}


def _coefficients(name: str, fields: Mapping[str, Any], fisheye: bool) -> list[float]:
    key = next((key for key in _COEFFICIENT_NAMES if not isinstance(fields.get(key), str | None)), None)
    value = fields[key] if key else fields
    if isinstance(value, Mapping):
        value = value["data"] if "data" in value else _by_name(value, fisheye)
    if not isinstance(value, list | tuple):
        raise InputError(f"{name}: '{key}' is {value!r}, not a list of numbers; correct the camera file")
    return [_number(name, f"{key}[{i}]", item) for i, item in enumerate(value)]


def _by_name(fields: Mapping[str, Any], fisheye: bool) -> list[Any]:
    """Coefficients written one by one, in their model's order."""
    order = ("k1", "k2", "k3", "k4") if fisheye else ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    last = max((i for i, k in enumerate(order) if k in fields), default=-1)
    return [fields.get(k, 0.0) for k in order[: last + 1]]


def _refuse_crops(name: str, fields: Mapping[str, Any]) -> None:
    """ROS's binning and region of interest make the frame another size than K is for."""
    for key in ("binning_x", "binning_y"):
        if fields.get(key) not in (None, 0, 1):
            raise InputError(f"{name}: '{key}' is {fields[key]}; give the intrinsics of the binned image")
    roi = fields.get("roi")
    if isinstance(roi, Mapping) and any(roi.get(key) not in (None, 0) for key in ("x_offset", "y_offset")):
        raise InputError(f"{name}: 'roi' has an offset; give the intrinsics of the cropped image")


def depth_unit_of(name: str, fields: Mapping[str, Any]) -> float | None:
    """Metres per raw unit from a file's fields: ``depth_unit``, or ``depth_scale`` in either of its two meanings.

    Some write a scale as metres per unit (0.001), some as units per metre (1000); a unit of a metre or more is none.
    """
    if "depth_unit" in fields:
        unit = _number(name, "depth_unit", fields["depth_unit"])
    elif "depth_scale" in fields:
        scale = _number(name, "depth_scale", fields["depth_scale"])
        unit = 1 / scale if scale > 1 else scale
    else:
        return None
    if not 0 < unit < 1:
        raise InputError(f"{name}: a depth unit of {unit} m is not possible; give metres per raw unit, such as 0.001")
    return unit


def from_matrix(name: str, matrix: Any, width: int, height: int) -> Camera:
    """A pinhole camera from its (3, 3) matrix ``[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]``."""
    return from_fields(name, {"K": np.asarray(matrix).tolist(), "width": width, "height": height}).cameras[0]


def camera(
    name: str,
    width: Any,
    height: Any,
    matrix: Sequence[Any],
    model: str | None = None,
    coefficients: Sequence[Any] = (),
) -> Camera:
    """A camera from the fields of a recording, as ROS ``CameraInfo`` has them: K row by row, model, D.

    Raises `InputError` that starts with `name` and names the field.
    """
    fields = {"width": width, "height": height, "K": list(matrix), "distortion_model": model, "D": list(coefficients)}
    return from_fields(name, fields).cameras[0]
