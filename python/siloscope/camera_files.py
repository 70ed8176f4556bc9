"""Camera files: intrinsics as JSON (ours, Open3D's, librealsense's), TOML, ROS ``camera_info`` YAML, or the text of
``rs-enumerate-devices -c``. The content decides which, not the name.
"""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from siloscope.camera import Camera
from siloscope.errors import InputError

LARGEST_FILE = 1 << 20
"""Bytes; no camera file is longer."""

DISTORTION_NAMES = {
    "none": "none",
    "pinhole": "none",
    "brown conrady": "brown_conrady",
    "plumb bob": "brown_conrady",
    "inverse brown conrady": "inverse_brown_conrady",
    "rational": "rational",
    "rational polynomial": "rational",
    "equidistant": "kannala_brandt",
    "kannala brandt": "kannala_brandt",
    "kannala brandt4": "kannala_brandt",
    "fisheye": "kannala_brandt",
}
"""What others call the distortion models (in lower case, words apart by one space) and what they are called here."""

_ZERO_IS_PINHOLE = ("modified brown conrady",)
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


def load(path: str | PathLike[str], size: tuple[int, int] | None = None) -> Camera:
    """The camera of a file; `size` (width, height) chooses where it lists several. Raises `InputError`."""
    cameras = read(path).cameras
    fitting = [camera for camera in cameras if size in (None, (camera.width, camera.height))]
    if len(fitting) == 1:
        return fitting[0]
    known = ", ".join(f"{camera.width} x {camera.height}" for camera in cameras)
    wanted = "which is meant" if size is None else f"none or several are {size[0]} x {size[1]}"
    raise InputError(f"{path}: has cameras of {known}; {wanted}; keep the one of your depth stream in the file")


def read(path: str | PathLike[str]) -> CameraFile:
    """All that a camera file says; raises `InputError` naming the file and the field."""
    return parse(str(path), _text(Path(path)))


def parse(name: str, text: str) -> CameraFile:
    """Reads the text of a camera file in any of the formats; `name` is for messages."""
    if text.lstrip().startswith("{"):
        return parse_json(name, text)
    if re.search(r'^\s*Intrinsic of "', text, re.MULTILINE):
        return CameraFile(_from_enumeration(name, text))
    return _from_fields(name, _toml_or_yaml(name, text))


def parse_json(name: str, text: str) -> CameraFile:
    """Reads the text of a JSON camera file."""
    try:
        fields = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{name}: not valid JSON ({error}); check the camera file") from None
    return _from_fields(name, fields)


def from_matrix(name: str, matrix: Any, width: int, height: int) -> Camera:
    """A pinhole camera from its (3, 3) matrix ``[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]``."""
    return _from_fields(name, {"K": np.asarray(matrix).tolist(), "width": width, "height": height}).cameras[0]


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
    return _from_fields(name, fields).cameras[0]


def distortion_model(name: str, model: str, coefficients: Sequence[float]) -> str:
    """Our name of a distortion model, whoever named it; unknown ones are refused by name."""
    words = re.sub(r"[\s_.\-]+", " ", model.strip().lower()).removeprefix("distortion ").strip()
    known = DISTORTION_NAMES.get(words)
    if words in _ZERO_IS_PINHOLE and not any(coefficients):
        known = "none"
    if known is None and words == "":
        known = "none" if not any(coefficients) else None
    if known is None:
        names = ", ".join(sorted(DISTORTION_NAMES))
        raise InputError(
            f"{name}: unknown distortion model '{model}' with coefficients {list(coefficients)}; known are {names}"
        )
    return known


def dump(camera: Camera, path: str | PathLike[str], depth_unit: float | None = None) -> None:
    """Writes a camera file: TOML for ``.toml``, ROS ``camera_info`` for ``.yaml``, else JSON with named fields.

    `depth_unit` (metres per raw unit) goes into TOML and JSON; ROS has no place for it.
    """
    path = Path(path)
    fields = camera.to_dict() | ({} if depth_unit is None else {"depth_unit": depth_unit})
    if path.suffix == ".toml":
        text = "".join(f"{key} = {json.dumps(value)}\n" for key, value in fields.items())
    elif path.suffix in (".yaml", ".yml"):
        text = _ros_yaml(camera)
    else:
        text = json.dumps(fields, indent=2) + "\n"
    path.write_text(text, encoding="utf-8")


def _text(path: Path) -> str:
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
        return data.decode("utf-8-sig")
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
            f"{name}: neither JSON, TOML, ROS camera_info YAML nor rs-enumerate-devices text ({cause}); "
            "give the intrinsics in one of these"
        ) from None


def _from_fields(name: str, fields: Any) -> CameraFile:
    if not isinstance(fields, Mapping):
        raise InputError(f"{name}: no named fields; a camera file has width, height, fx, fy, cx, cy")
    nested = [fields[key] for key in _NESTED_NAMES if isinstance(fields.get(key), Mapping)]
    inner = nested[0] if nested and not _has_focal_length(fields) else fields
    _refuse_crops(name, inner)
    values = {key: _number(name, key, _field(name, inner, key)) for key in ("width", "height")}
    values |= _focal_lengths(name, inner)
    if values["cx"] == 0 == values["cy"]:
        raise InputError(f"{name}: cx and cy are both 0; give the sensor's own intrinsics with --camera FILE")
    k = _coefficients(name, inner)
    model = next((inner[key] for key in _MODEL_NAMES if isinstance(inner.get(key), str)), "")
    unit = depth_unit_of(name, inner) or depth_unit_of(name, fields)
    return CameraFile((_camera(name, values, distortion_model(name, model, k), k),), unit)


def _camera(name: str, values: dict[str, float], model: str, k: list[float]) -> Camera:
    try:
        return Camera(**values, distortion_model=model, distortion=() if model == "none" else tuple(k))  # type: ignore[arg-type]
    except (InputError, OverflowError, ValueError) as error:
        raise InputError(f"{name}: {error}") from None


def _has_focal_length(fields: Mapping[str, Any]) -> bool:
    return any(key in fields for key in (*_FIELD_NAMES["fx"], *_MATRIX_NAMES, "intrinsic_matrix"))


def _field(name: str, fields: Mapping[str, Any], key: str) -> Any:
    for alias in _FIELD_NAMES[key]:
        if alias in fields:
            return fields[alias]
    raise InputError(f"{name}: '{key}' is missing; a camera file has width, height, fx, fy, cx, cy")


def _number(name: str, key: str, value: Any) -> float:
    try:
        if isinstance(value, bool | str):
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


def _coefficients(name: str, fields: Mapping[str, Any]) -> list[float]:
    key = next((key for key in _COEFFICIENT_NAMES if key in fields), None)
    value = fields[key] if key else []
    if isinstance(value, Mapping):
        value = value.get("data")
    if value is None:
        return []
    if not isinstance(value, list | tuple):
        raise InputError(f"{name}: '{key}' is {value!r}, not a list of numbers; correct the camera file")
    return [_number(name, f"{key}[{i}]", item) for i, item in enumerate(value)]


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


def _from_enumeration(name: str, text: str) -> tuple[Camera, ...]:
    """The depth cameras of ``rs-enumerate-devices -c``, one a resolution, equal ones once."""
    blocks = re.split(r'^\s*Intrinsic of "', text, flags=re.MULTILINE)[1:]
    depth = [block for block in blocks if block.startswith("Depth")]
    if not depth:
        raise InputError(
            f"{name}: no intrinsics of a Depth stream; run rs-enumerate-devices -c with the camera connected"
        )
    return tuple(dict.fromkeys(_from_block(name, block) for block in depth))


def _from_block(name: str, block: str) -> Camera:
    pairs = re.findall(
        r"^[ \t]*(Width|Height|PPX|PPY|Fx|Fy|Distortion|Coeffs):[ \t]*(.*?)[ \t\r]*$", block, re.MULTILINE
    )
    words = {key.lower(): value for key, value in reversed(pairs)}
    fields: dict[str, Any] = {
        key: _parsed(words[key]) for key in ("width", "height", "ppx", "ppy", "fx", "fy") if key in words
    }
    fields |= {"model": words.get("distortion", ""), "coeffs": [_parsed(k) for k in words.get("coeffs", "").split()]}
    return _from_fields(name, fields).cameras[0]


def _parsed(word: str) -> float | str:
    try:
        return float(word)
    except ValueError:
        return word


_ROS_NAMES = {
    "none": "plumb_bob",
    "brown_conrady": "plumb_bob",
    "rational": "rational_polynomial",
    "kannala_brandt": "equidistant",
}


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
