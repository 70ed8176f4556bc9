"""Camera files that are lines of text: bare matrices, COLMAP, ScanNet, RealSense's Viewer, and printed intrinsics."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from siloscope.errors import InputError

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_PRINTED = re.compile(
    rf"\[\s*(\d+)x(\d+)\s+p\[({_NUMBER})\s+({_NUMBER})\]\s+f\[({_NUMBER})\s+({_NUMBER})\]\s+([^\[\]]*?)\s*\[([^\]]*)\]"
)
_PRINTED_OLD = re.compile(
    rf"width: (\d+), height: (\d+), ppx: ({_NUMBER}), ppy: ({_NUMBER}), fx: ({_NUMBER}), fy: ({_NUMBER}), "
    r"model: ([^,]*), coeffs: \[([^\]]*)\]"
)
_COLMAP = re.compile(rf"^\s*\d+\s+([A-Z][A-Z_]+)\s+(\d+)\s+(\d+)((?:\s+{_NUMBER})+)\s*$", re.MULTILINE)
_COLMAP_MODELS = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
    "FULL_OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    "OPENCV_FISHEYE": ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"),
    "SIMPLE_RADIAL_FISHEYE": ("f", "cx", "cy", "k1"),
    "RADIAL_FISHEYE": ("f", "cx", "cy", "k1", "k2"),
}
_COLMAP_CENTRE = 0.5
"""COLMAP's coordinates begin at the corner of the image, so its pixel centres are at halves."""

_SCANNET = {
    "width": ("depthwidth", "m_depthwidth"),
    "height": ("depthheight", "m_depthheight"),
    "fx": ("fx_depth",),
    "fy": ("fy_depth",),
    "cx": ("mx_depth",),
    "cy": ("my_depth",),
    "intrinsic_matrix": ("m_calibrationdepthintrinsic",),
    "depth_scale": ("m_depthshift",),
}

Fields = dict[str, Any]


Reader = Callable[[str, str], list[Fields]]


def stream_cameras(name: str, text: str) -> list[Fields]:
    """The cameras of a stream in lines of text, as named fields; empty where the text is of another kind."""
    return _printed(name, text) or _viewer(name, text)


def calibrations(name: str, text: str) -> list[Fields]:
    """The cameras of a calibration in lines of text, as named fields; empty where the text is of another kind.

    Raises `InputError` for a kind that is known but can't be used.
    """
    readers: tuple[Reader, ...] = (_colmap, _scannet, _bare_matrix)
    return next((found for read in readers if (found := read(name, text))), [])


def _printed(name: str, text: str) -> list[Fields]:
    """Intrinsics as ``print(profile.intrinsics)`` of pyrealsense2 shows them."""
    match = _PRINTED.search(text) or _PRINTED_OLD.search(text)
    if match is None:
        return []
    keys = ("width", "height", "ppx", "ppy", "fx", "fy", "model")
    coefficients = match[8].replace(",", " ").split()
    return [{**dict(zip(keys, match.groups()[:7], strict=True)), "coeffs": coefficients}]


def _viewer(name: str, text: str) -> list[Fields]:
    """The ``…_metadata.csv`` that RealSense's Viewer writes beside a snapshot."""
    pairs = {key: value.strip() for key, value in _pairs(text, ",").items()}
    if not {"resolution x", "fx", "ppx"} <= pairs.keys():
        return []
    theirs = {"width": "resolution x", "height": "resolution y"} | {key: key for key in ("fx", "fy", "ppx", "ppy")}
    return [{ours: pairs.get(key, "") for ours, key in theirs.items()} | {"model": pairs.get("distorsion", "")}]


def _pairs(text: str, sign: str) -> dict[str, str]:
    """What stands after the first sign of every line, by what stands before it in lower case."""
    parts = (line.partition(sign) for line in text.splitlines())
    return {key.strip().lower(): value for key, _, value in parts}


def _colmap(name: str, text: str) -> list[Fields]:
    """COLMAP's ``cameras.txt``."""
    lines = _COLMAP.findall(text)
    return [_colmap_camera(name, model, width, height, numbers.split()) for model, width, height, numbers in lines]


def _colmap_camera(name: str, model: str, width: str, height: str, numbers: Sequence[str]) -> Fields:
    keys = _COLMAP_MODELS.get(model)
    if keys is None or len(keys) != len(numbers):
        known = ", ".join(_COLMAP_MODELS)
        raise InputError(
            f"{name}: COLMAP's camera model '{model}' with {len(numbers)} parameters is not read; undistort the images "
            f"first, or use one of {known}"
        )
    fields: Fields = dict(zip(keys, numbers, strict=True))
    focal = fields.pop("f", None)
    fields |= {} if focal is None else {"fx": focal, "fy": focal}
    fields |= {key: float(fields[key]) - _COLMAP_CENTRE for key in ("cx", "cy")}
    lens = "fisheye" if "FISHEYE" in model else "rational" if model == "FULL_OPENCV" else "plumb_bob"
    return {**fields, "width": width, "height": height, "distortion_model": lens}


def _scannet(name: str, text: str) -> list[Fields]:
    """ScanNet's ``scene….txt`` and the ``_info.txt`` of its sensor files: ``key = value`` a line."""
    pairs = {key: value.split() for key, value in _pairs(text, "=").items()}
    found = {ours: pairs[key] for ours, keys in _SCANNET.items() for key in keys if pairs.get(key)}
    if not {"width", "height"} <= found.keys() or not ("fx" in found or "intrinsic_matrix" in found):
        return []
    matrix = found.pop("intrinsic_matrix", None)
    fields: Fields = {key: words[0] for key, words in found.items()}
    return [{**fields, "K": _three_by_three(name, matrix)} if matrix else fields]


def _bare_matrix(name: str, text: str) -> list[Fields]:
    """A 3 × 3 or 4 × 4 matrix, or the 3 × 4 of a projection, row by row, apart by blanks, commas or brackets."""
    plain = re.sub(r"#.*$", "", text, flags=re.MULTILINE)
    words = re.sub(r"[\[\]();,]|array|matrix", " ", plain).split()
    if len(words) not in (9, 12, 16) or not all(re.fullmatch(_NUMBER, word) for word in words):
        return []
    return [{"K": _three_by_three(name, words)}]


def _three_by_three(name: str, words: Sequence[str]) -> list[str]:
    """The intrinsics in a matrix of three or four columns; one with a translation is no camera."""
    if len(words) == 9:
        return list(words)
    if len(words) not in (12, 16) or any(float(word) for word in words[3:12:4]):
        raise InputError(f"{name}: a matrix of {len(words)} numbers with a translation is a pose; give the intrinsics")
    return [word for row in (0, 4, 8) for word in words[row : row + 3]]


def bop_unit(fields: Mapping[str, Any]) -> float | None:
    """Metres per raw unit of a BOP dataset's camera file, whose depth_scale makes millimetres; None for other files."""
    keys = set(fields)
    is_bop = "cam_K" in keys or keys == {"cx", "cy", "depth_scale", "fx", "fy", "height", "width"}
    scale = fields.get("depth_scale")
    if not is_bop or not isinstance(scale, int | float) or isinstance(scale, bool) or not 0.05 <= scale <= 1:
        return None
    return scale * 1e-3
