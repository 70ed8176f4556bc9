"""Cameras from named fields, in the spellings that are in use."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from siloscope.errors import InputError
from siloscope.io.camera_files.distortion import distortion_model, is_fisheye
from siloscope.io.camera_files.tables import bop_unit
from siloscope.io.camera_sizes import Intrinsics, Known
from siloscope.types.camera import Camera
from siloscope.types.intrinsics import IntrinsicsStd

_FIELD_NAMES = {
    "width": ("width", "image_width", "w"),
    "height": ("height", "image_height", "h"),
    "fx": ("fx", "focal_x", "fl_x"),
    "fy": ("fy", "focal_y", "fl_y"),
    "cx": ("cx", "ppx"),
    "cy": ("cy", "ppy"),
}
_MATRIX_NAMES = ("camera_matrix", "K", "cam_K", "camera_mat", "mtx", "intrinsic_matrix")
_MODEL_NAMES = ("distortion_model", "model", "camera_model")
_OPENCV_COEFFICIENTS = ("distortion_coefficients", "dist", "dist_coeffs", "dist_coeff")
"""Coefficients that name no model are OpenCV's under these names: plumb_bob up to five of them, rational above."""
_COEFFICIENT_NAMES = (*_OPENCV_COEFFICIENTS, "distortion", "coeffs", "coefficients", "D")
_NESTED_NAMES = ("camera", "depth", "depth_camera", "depth_intrinsics", "intrinsic", "intrinsics")


@dataclass(frozen=True)
class CameraFile:
    """What a camera file says.

    Attributes
    ----------
    cameras : tuple of Camera or Intrinsics
        One, or several of which the frame's size chooses; `Intrinsics` where they hold for more sizes than one.
    depth_unit : float or None
        Metres per raw unit, where the file has it.
    """

    cameras: tuple[Known, ...]
    depth_unit: float | None = None


def from_fields(name: str, fields: Any, *, calibration: bool = False) -> CameraFile:
    """The camera and unit in named fields, as a camera file has them; raises `InputError` naming the field.

    The intrinsics of a `calibration` hold for its images at any scale, those of other files for one size.
    """
    if not isinstance(fields, Mapping):
        raise InputError(f"{name}: no named fields; a camera file has width, height, fx, fy, cx, cy")
    nested = [fields[key] for key in _NESTED_NAMES if isinstance(fields.get(key), Mapping)]
    inner = nested[0] if nested and not _has_focal_length(fields) else fields
    _refuse_crops(name, inner)
    values = _size(name, inner) | _focal_lengths(name, inner)
    named = next((inner[key] for key in _MODEL_NAMES if isinstance(inner.get(key), str)), "")
    if not named and inner.get("fisheye_model") in (1, "1"):
        named = "fisheye"
    named, k = _lens(name, inner, named)
    model = distortion_model(name, named, k)
    unit = bop_unit(fields) or depth_unit_of(name, inner) or depth_unit_of(name, fields)
    lens = {"distortion_model": model, "distortion": () if model == "none" else tuple(k)}
    return CameraFile((_camera(name, values, lens | _stated(name, inner, fields), calibration),), unit)


def _stated(name: str, *tables: Mapping[str, Any]) -> dict[str, IntrinsicsStd]:
    """How exactly the intrinsics are known, where a file states it."""
    told = next((table["intrinsics_std"] for table in tables if table.get("intrinsics_std") is not None), None)
    try:
        return {} if told is None else {"intrinsics_std": IntrinsicsStd.of_fields(told)}
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def _size(name: str, fields: Mapping[str, Any]) -> dict[str, float]:
    """Width and height; neither where the file has all of the intrinsics but no size."""
    whole = _find(fields, _MATRIX_NAMES) or all(_find(fields, _FIELD_NAMES[key]) for key in ("fx", "fy", "cx", "cy"))
    if whole and not any(_find(fields, _FIELD_NAMES[key]) for key in ("width", "height")):
        return {}
    return {key: _number(name, key, _field(name, fields, key)) for key in ("width", "height")}


def _camera(name: str, values: dict[str, float], lens: dict[str, Any], calibration: bool) -> Known:
    size = {"width": values.get("width", 1), "height": values.get("height", 1)}
    try:
        camera = Camera(**{**values, **size}, **lens)  # type: ignore[arg-type]
    except (InputError, OverflowError, ValueError) as error:
        raise InputError(f"{name}: {error}") from None
    if camera.cx == 0 == camera.cy:
        raise InputError(f"{name}: cx and cy are both 0; give the sensor's own intrinsics with --camera FILE")
    if "width" in values and not calibration:
        return camera
    known = (camera.width, camera.height) if "width" in values else None
    pixels = (camera.fx, camera.fy, camera.cx, camera.cy)
    return Intrinsics(*pixels, camera.distortion_model, camera.distortion, known, camera.intrinsics_std)


def _has_focal_length(fields: Mapping[str, Any]) -> bool:
    return _find(fields, (*_FIELD_NAMES["fx"], *_MATRIX_NAMES)) is not None


def _find(fields: Mapping[str, Any], names: Sequence[str]) -> str | None:
    """The first of the names that a file has, as the file spells it: cameraMatrix, Camera_Matrix and so on."""
    spelled = {_plain(key): key for key in reversed(list(fields)) if isinstance(key, str)}
    return next((spelled[_plain(name)] for name in names if _plain(name) in spelled), None)


def _plain(name: str) -> str:
    return name.lower().replace("_", "").replace("-", "")


def _field(name: str, fields: Mapping[str, Any], key: str) -> Any:
    if (found := _find(fields, _FIELD_NAMES[key])) is not None:
        return fields[found]
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
    key = _find(fields, ("intrinsic_matrix",))
    if key is None and _find(fields, _FIELD_NAMES["fx"]) is not None:
        return {key: _number(name, key, _field(name, fields, key)) for key in ("fx", "fy", "cx", "cy")}
    key = key or _find(fields, _MATRIX_NAMES)
    if key is not None:
        return _by_row(name, key, _turned(_matrix(name, key, fields[key])))
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


def _turned(m: list[float]) -> list[float]:
    """The matrix row by row: Open3D and Record3D write it column by column, which its zeros tell."""
    if m[2] == 0 == m[5] and (m[6] or m[7]):
        return [m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]]
    return m


def _by_row(name: str, key: str, m: list[float]) -> dict[str, float]:
    if m[1] != 0 or m[3] != 0 or m[6] != 0 or m[7] != 0 or (m[8] != 1 and any(m)):
        raise InputError(f"{name}: '{key}' is {m}, no matrix of a pinhole without skew; correct the camera file")
    return {"fx": m[0], "fy": m[4], "cx": m[2], "cy": m[5]}


def _lens(name: str, fields: Mapping[str, Any], named: str) -> tuple[str, list[float]]:
    """Model and coefficients; under OpenCV's names their number tells a model that is not named."""
    k = _coefficients(name, fields, fisheye=is_fisheye(named))
    if named or _find(fields, _OPENCV_COEFFICIENTS) is None:
        return named, k
    while k and k[-1] == 0:
        k.pop()
    return ("rational" if len(k) > 5 else "plumb_bob"), k


def _coefficients(name: str, fields: Mapping[str, Any], fisheye: bool) -> list[float]:
    key = next((key for known in _COEFFICIENT_NAMES if (key := _given(fields, known))), None)
    value = fields[key] if key else fields
    if isinstance(value, Mapping):
        value = value["data"] if "data" in value else _by_name(value, fisheye)
    if not isinstance(value, list | tuple):
        raise InputError(f"{name}: '{key}' is {value!r}, not a list of numbers; correct the camera file")
    flat = [item for row in value for item in (row if isinstance(row, list) else [row])]
    return [_number(name, f"{key}[{i}]", item) for i, item in enumerate(flat)]


def _given(fields: Mapping[str, Any], name: str) -> str | None:
    """The spelling under which a file gives coefficients; a word or nothing there is none."""
    key = _find(fields, (name,))
    return None if key is None or isinstance(fields[key], str | None) else key


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
    return camera(name, width, height, np.asarray(matrix).tolist())


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
    return sized(name, from_fields(name, fields).cameras[0])


def sized(name: str, camera: Known) -> Camera:
    """A camera where its size is needed; raises `InputError` where it has none."""
    if not isinstance(camera, Camera):
        raise InputError(f"{name}: 'width' is missing; a camera file has width, height, fx, fy, cx, cy")
    return camera
