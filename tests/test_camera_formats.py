"""Calibration files of other programs give the camera they mean, at the size of the frame."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import siloscope
from camera_texts import (
    BOP_CAMERA,
    BOP_IMAGES,
    CAMERA,
    COLMAP,
    DISTORTED,
    FOUR,
    K5,
    KALIBR,
    LENSES,
    MATRIX,
    OPENCV_XML,
    OPENCV_YAML,
    ORB_SLAM,
    PLAIN,
    RECORD3D,
    SENSOR_INFO,
    SIZE,
    rows,
)
from frame_files import png, unfiltered
from siloscope import Camera, InputError
from siloscope.io import camera_files


def camera_of(text: str, size: tuple[int, int] = SIZE) -> Camera:
    return camera_files.choose("camera", camera_files.parse("camera", text).cameras, size)[0]


@pytest.mark.parametrize("text", PLAIN.values(), ids=PLAIN.keys())
def test_calibrations_without_distortion(text: str) -> None:
    assert camera_of(text) == CAMERA


@pytest.mark.parametrize("text", LENSES.values(), ids=LENSES.keys())
def test_calibrations_with_opencv_s_distortion(text: str) -> None:
    assert camera_of(text) == DISTORTED


def test_kalibr_s_cameras_are_told_apart_by_size() -> None:
    depth, wide = camera_of(KALIBR), camera_of(KALIBR, (1280, 800))
    assert depth == Camera(*SIZE, 281.5, 282.25, 161.5, 118.75, "brown_conrady", K5[:4])
    assert (wide.distortion_model, wide.distortion) == ("kannala_brandt", (0.1, 0.2, 0.3, 0.4))
    assert camera_of("%YAML:1.0\n" + KALIBR) == depth


@pytest.mark.parametrize(
    ("line", "model", "distortion"),
    [
        ("SIMPLE_PINHOLE 320 240 281.5 162 119.25", "none", ()),
        ("SIMPLE_RADIAL 320 240 281.5 162 119.25 0.1", "brown_conrady", (0.1,)),
        ("OPENCV 320 240 281.5 281.5 162 119.25 0.1 0.2 0.3 0.4", "brown_conrady", (0.1, 0.2, 0.3, 0.4)),
        ("FULL_OPENCV 320 240 281.5 281.5 162 119.25 1 2 3 4 5 6 7 8", "rational", (1, 2, 3, 4, 5, 6, 7, 8)),
        ("OPENCV_FISHEYE 320 240 281.5 281.5 162 119.25 0.1 0.2 0.3 0.4", "kannala_brandt", (0.1, 0.2, 0.3, 0.4)),
    ],
)
def test_colmap_s_models(line: str, model: str, distortion: tuple[float, ...]) -> None:
    """COLMAP counts from the image's corner: its centres of pixels are at halves."""
    assert camera_of(f"{COLMAP}7 {line}\n") == Camera(*SIZE, 281.5, 281.5, 161.5, 118.75, model, distortion)


@pytest.mark.parametrize("by", [2, 3, 0.5])
def test_a_calibration_of_another_scale_is_scaled_by_edges_not_centres(by: float) -> None:
    size = int(320 * by), int(240 * by)
    camera = camera_of(OPENCV_YAML, size)
    assert (camera.width, camera.height) == size
    assert camera.distortion == K5
    # What is seen at the corner of the image stays at the corner.
    for full, small, side in ((CAMERA.cx, camera.cx, 320), (CAMERA.cy, camera.cy, 240)):
        assert (full + 0.5) / side == pytest.approx((small + 0.5) / (side * by), rel=1e-12)
    assert camera.fx == pytest.approx(281.5 * by)


def test_phones_hand_on_the_intrinsics_of_the_colour_image() -> None:
    """Stray Scanner's matrix has no size, Record3D's has the colour image's; depth is a fraction of either."""
    full: list[list[float]] = [[1689.0, 0, 963.5], [0, 1693.5, 718.0], [0, 0, 1]]
    camera = camera_of(rows(full, ","), (256, 192))
    assert (camera.fx, camera.cx) == (pytest.approx(1689 / 7.5), pytest.approx(964 / 7.5 - 0.5))
    assert camera_of(json.dumps(RECORD3D)) == CAMERA


@pytest.mark.parametrize(
    ("text", "unit"),
    [(json.dumps(BOP_IMAGES), 1e-4), (json.dumps(BOP_CAMERA), 1e-3), (SENSOR_INFO, 1e-3), (ORB_SLAM, 2e-4)],
)
def test_units_of_datasets(text: str, unit: float) -> None:
    assert camera_files.parse("camera", text).depth_unit == pytest.approx(unit)


BAD = {
    "pose": (rows([*FOUR[:2], [0, 0, 1, 2.5], [0, 0, 0, 1]], " "), "translation is a pose"),
    "COLMAP's thin prism": (COLMAP + "1 THIN_PRISM_FISHEYE 9 9 1 1 1 1 1 1 1 1 1 1 1 1\n", "THIN_PRISM_FISHEYE"),
    "COLMAP with too few": (COLMAP + "1 PINHOLE 320 240 281.5 162\n", "'PINHOLE' with 2 parameters"),
    "Kalibr's omni": (KALIBR.replace("camera_model: pinhole", "camera_model: omni"), "cam0: .*model 'omni-radtan'"),
    "Kalibr with three": (KALIBR.replace("[281.5, 282.25, 161.5,", "[281.5, 161.5,"), "four numbers"),
    "entities": ('<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "c">]><opencv_storage/>', "entities"),
    "other XML": ("<?xml version='1.0'?><html></html>", "root is 'html'"),
    "cut XML": (OPENCV_XML[:300], "damaged OpenCV file"),
    "cut YAML": (OPENCV_YAML[:320], "damaged OpenCV file|numbers, not 9"),
    "thin prism of OpenCV": (json.dumps({"K": MATRIX, "dist": [0.1] * 12}), "coefficients"),
    "only the size": (json.dumps({"K": MATRIX, "width": 320}), "'height' is missing"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "cause"), BAD.values(), ids=BAD.keys())
def test_calibrations_that_can_not_be_used_are_refused_by_name(text: str, cause: str) -> None:
    with pytest.raises(InputError, match=f"^camera: ?.*({cause})"):
        camera_of(text)


def test_what_does_not_fit_the_frame_says_what_is_missing() -> None:
    with pytest.raises(InputError, match=r"names no image size.*161\.5, 118\.75.*write 'width' and 'height'"):
        camera_of(rows(MATRIX, " "), (1000, 700))
    with pytest.raises(InputError, match="320 x 200 pixels but the camera 320 x 240; give the camera of this stream"):
        camera_of(OPENCV_YAML, (320, 200))
    with pytest.raises(InputError, match="2 different cameras of this size"):
        camera_of(KALIBR.replace("[1280, 800]", "[320, 240]"))
    exact = json.dumps(CAMERA.to_dict())
    with pytest.raises(InputError, match=r"scaled to 160 x 120 it is fx 140\.75, fy 141\.125, cx 80\.5, cy 59\.125"):
        camera_of(exact, (160, 120))


def test_a_text_of_utf_16_as_windows_shells_write_it(tmp_path: Path) -> None:
    path = tmp_path / "camera.txt"
    path.write_text(PLAIN["printed by pyrealsense2"], encoding="utf-16")
    assert camera_files.load(path) == CAMERA


def test_a_calibration_beside_and_given_is_told(tmp_path: Path) -> None:
    raw = np.full((120, 160), 900, np.uint16)
    (tmp_path / "depth").mkdir()
    for i in range(2):
        (tmp_path / "depth" / f"{i:06}.png").write_bytes(png(160, 120, unfiltered(raw)))
    (tmp_path / "camera_matrix.csv").write_text(rows([[1689.0, 0, 963.5], [0, 1693.5, 718.0], [0, 0, 1]], ","))
    with siloscope.open(tmp_path, depth_unit=0.001) as source:
        (frame, _) = source
        assert source.describe()["camera_from"] == "camera_matrix.csv, scaled from 1920 x 1440"
    assert frame.camera is not None
    assert frame.camera.fx == pytest.approx(1689 / 12)
    (tmp_path / "opencv.yml").write_text(OPENCV_YAML)
    with siloscope.open(tmp_path, camera=tmp_path / "opencv.yml", depth_unit=0.001) as source:
        frame = next(iter(source))
        assert source.describe()["camera"]["fx"] == 281.5 / 2
    assert re.fullmatch("given, scaled from 320 x 240", frame.provenance["camera_from"])


@pytest.mark.parametrize("names", [("mtx", "dist"), ("camera_matrix", "dist_coeffs"), ("K", "D")])
def test_calibrations_stored_by_numpy_are_read(tmp_path: Path, names: tuple[str, str]) -> None:
    matrix = np.array([[310.5, 0.0, 161.2], [0.0, 309.8, 118.9], [0.0, 0.0, 1.0]])
    coefficients = np.array([[0.1, -0.02, 0.001, 0.002, 0.0]])
    stored: dict[str, Any] = {names[0]: matrix, names[1]: coefficients, "rvecs": np.zeros((3, 3, 1))}
    np.savez(tmp_path / "calib.npz", **stored)
    camera = camera_files.load(tmp_path / "calib.npz", (320, 240))
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (310.5, 309.8, 161.2, 118.9)
    assert camera.distortion[:4] == (0.1, -0.02, 0.001, 0.002)
    np.save(tmp_path / "K.npy", matrix)
    assert camera_files.load(tmp_path / "K.npy", (320, 240)).fx == 310.5


def test_numpy_files_that_are_no_calibration_are_named(tmp_path: Path) -> None:
    np.savez(tmp_path / "frames.npz", depth=np.zeros((4, 4)))
    np.save(tmp_path / "text.npy", np.array("K"))
    np.savez(tmp_path / "long.npz", K=np.zeros((600, 600)))
    whole = (tmp_path / "frames.npz").read_bytes()
    (tmp_path / "cut.npz").write_bytes(whole[: len(whole) // 2])
    causes = {"frames.npz": "has depth, no camera matrix", "text.npy": "no camera matrix", "long.npz": "too long",
              "cut.npz": "damaged"}  # fmt: skip
    for name, cause in causes.items():
        with pytest.raises(InputError, match=f"{name}: .*{cause}"):
            camera_files.load(tmp_path / name, (320, 240))
