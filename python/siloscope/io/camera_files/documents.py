"""Documents of named fields that hold one camera or several: whose layout it is, and where the cameras are."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any

from siloscope.errors import InputError
from siloscope.io.camera_files.fields import CameraFile, from_fields

_KALIBR_CAMERA = re.compile(r"cam\d+")
_KALIBR_MODELS = ("pinhole",)
_KALIBR_LENSES = {"radtan": "plumb_bob", "equidistant": "equidistant", "none": "none"}

Fields = Mapping[str, Any]


def from_document(name: str, document: Any, *, calibration: bool = False) -> CameraFile:
    """The cameras and unit of a document; raises `InputError` naming the field that can't be used."""
    if not isinstance(document, Mapping):
        return from_fields(name, document)
    layouts: tuple[Callable[[str, Fields], list[Any]], ...] = (_kalibr, _stereo, _orb_slam, _bop_images, _depthai)
    several = next((found for layout in layouts if (found := layout(name, document))), None)
    if several is None:
        return from_fields(name, document, calibration=calibration or "dw" in document)  # Record3D's depth is smaller
    return joined([from_fields(name, fields, calibration=True) for fields in several])


def joined(files: list[CameraFile]) -> CameraFile:
    """Several cameras as one file, equal ones once."""
    cameras = dict.fromkeys(camera for file in files for camera in file.cameras)
    units = {file.depth_unit for file in files}
    return CameraFile(tuple(cameras), units.pop() if len(units) == 1 else None)


def _kalibr(name: str, document: Fields) -> list[Any]:
    """Kalibr's camchain: ``cam0``, ``cam1``, … with intrinsics [fx, fy, cx, cy] and resolution."""
    keys = [key for key in document if isinstance(key, str) and _KALIBR_CAMERA.fullmatch(key)]
    cameras = {key: document[key] for key in keys if isinstance(document[key], Mapping)}
    return [_kalibr_camera(f"{name}: {key}", camera) for key, camera in cameras.items() if "intrinsics" in camera]


def _kalibr_camera(name: str, camera: Fields) -> Fields:
    model, lens = camera.get("camera_model", "pinhole"), camera.get("distortion_model", "none")
    if model not in _KALIBR_MODELS or lens not in _KALIBR_LENSES:
        raise InputError(
            f"{name}: Kalibr's model '{model}-{lens}' is not read; calibrate with pinhole-radtan or pinhole-equi"
        )
    focal, size = camera["intrinsics"], camera.get("resolution", [])
    if not (isinstance(focal, list) and len(focal) == 4 and isinstance(size, list) and len(size) in (0, 2)):
        raise InputError(f"{name}: 'intrinsics' has four numbers and 'resolution' two; correct the camera file")
    fields = dict(zip(("fx", "fy", "cx", "cy"), focal, strict=True))
    fields |= dict(zip(("width", "height"), size, strict=False))
    return fields | {"distortion_model": _KALIBR_LENSES[lens], "D": camera.get("distortion_coeffs") or []}


def _stereo(name: str, document: Fields) -> list[Any]:
    """OpenCV's ``intrinsics.yml`` of a stereo pair: M1, D1, M2, D2."""
    size = {key: document[key] for key in ("image_width", "image_height") if key in document}
    pairs = [(document.get(f"M{i}"), document.get(f"D{i}", [])) for i in (1, 2)]
    return [{**size, "camera_matrix": m, "dist": d} for m, d in pairs if isinstance(m, Mapping | list)]


def _orb_slam(name: str, document: Fields) -> list[Any]:
    """ORB-SLAM's settings: ``Camera.fx``, or ``Camera1.fx``, with the depth's units a metre as ``DepthMapFactor``."""
    prefix = next((prefix for prefix in ("Camera.", "Camera1.") if f"{prefix}fx" in document), None)
    if prefix is None:
        return []
    camera = {key.removeprefix(prefix): value for key, value in document.items() if str(key).startswith(prefix)}
    size = {key: document[f"Camera.{key}"] for key in ("width", "height") if f"Camera.{key}" in document}
    units = [document[key] for key in ("DepthMapFactor", "RGBD.DepthMapFactor") if key in document]
    fisheye = document.get("Camera.type") == "KannalaBrandt8"
    known = {**camera, **size, "distortion_model": "equidistant" if fisheye else "plumb_bob"}
    return [known | ({"depth_scale": units[0]} if units else {})]


def _bop_images(name: str, document: Fields) -> list[Any]:
    """``scene_camera.json`` of the BOP datasets: an entry an image, each with its own intrinsics."""
    entries = list(document.values())
    images = [entry for entry in entries if isinstance(entry, Mapping) and "cam_K" in entry]
    return images if len(images) == len(entries) else []


def _depthai(name: str, document: Fields) -> list[Any]:
    """The calibration that OAK cameras store: pairs of a socket and its camera."""
    pairs = document.get("cameraData")
    pairs = list(pairs.items()) if isinstance(pairs, Mapping) else pairs
    if not isinstance(pairs, list):
        return []
    cameras = [pair[1] for pair in pairs if isinstance(pair, list | tuple) and len(pair) == 2]
    return [_depthai_camera(camera) for camera in cameras if isinstance(camera, Mapping) and camera.get("width")]


def _depthai_camera(camera: Fields) -> Fields:
    model = "fisheye" if camera.get("cameraType") in (1, "Fisheye", "FISHEYE") else ""
    coefficients = camera.get("distortionCoeff") or []
    lens = {"distortion_model": model, "D": coefficients[:4]} if model else {"dist": coefficients}
    return {"K": camera.get("intrinsicMatrix"), "width": camera["width"], "height": camera.get("height"), **lens}
