"""Camera files of every kind give the camera they mean, or are refused by the field's name."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from siloscope import Camera, InputError
from siloscope.io import camera_files
from siloscope.io.camera_sizes import scaled
from siloscope.types.intrinsics import IntrinsicsStd

CAMERA = Camera(640, 480, 390.25, 391.5, 321.75, 239.125)
K = (0.1, -0.05, 1e-3, -2e-5, 0.01)
DISTORTED = Camera(640, 480, 390.25, 391.5, 321.75, 239.125, "brown_conrady", K)

OPEN3D = {"width": 640, "height": 480, "intrinsic_matrix": [390.25, 0, 0, 0, 391.5, 0, 321.75, 239.125, 1]}
ROS = """image_width: 640
image_height: 480
camera_name: depth
camera_matrix:
  rows: 3
  cols: 3
  data: [390.25, 0., 321.75, 0., 391.5, 239.125, 0., 0., 1.]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0.1, -0.05, 1e-3, -2e-05, 0.01]
"""
ECHOED = """header:
  stamp:
    sec: 1
  frame_id: camera_depth_optical_frame
height: 480
width: 640
distortion_model: plumb_bob
d: [0.1, -0.05, 0.001, -2.0e-05, 0.01]
k: [390.25, 0.0, 321.75, 0.0, 391.5, 239.125, 0.0, 0.0, 1.0]
binning_x: 0
roi:
  x_offset: 0
  do_rectify: false
---
height: 1
"""
ENUMERATED = """Device info:
    Name                          :     Intel RealSense D435

Intrinsic Parameters:

 Intrinsic of "Depth" / 640x480 / {Z16}
  Width:        640
  Height:       480
  PPX:          321.75
  PPY:          239.125
  Fx:           390.25
  Fy:           391.5
  Distortion:   Brown Conrady
  Coeffs:       0   0   0   0   0
  FOV (deg):    78.7 x 63.17

 Intrinsic of "Depth" / 848x480 / {Z16}
  Width:        848
  Height:       480
  PPX:          424.5
  PPY:          238.0
  Fx:           424.0
  Fy:           424.0
  Distortion:   Inverse Brown Conrady
  Coeffs:       0.1     0.2     0.003   0.0026  -0.11

 Intrinsic of "Color" / 640x480 / {RGB8/BGR8}
  Width:        640
  Height:       480
  PPX:          1
  PPY:          1
  Fx:           1
  Fy:           1
  Distortion:   Inverse Brown Conrady
  Coeffs:       0   0   0   0   0

Extrinsic from "Depth"    To      "Color" :
 Rotation Matrix:
   0.999749        -0.021599      0.00601
"""
TOML = "width = 640\nheight = 480\nfx = 390.25\nfy = 391.5\ncx = 321.75\ncy = 239.125\ndepth_unit = 0.001\n"
LIBREALSENSE = {
    "width": 640, "height": 480, "fx": 390.25, "fy": 391.5, "ppx": 321.75, "ppy": 239.125,
    "model": "distortion.brown_conrady", "coeffs": list(K),
}  # fmt: skip


def parsed(text: str) -> Camera:
    (camera,) = camera_files.parse("camera", text).cameras
    assert isinstance(camera, Camera)
    return camera


def test_open3d_is_read_column_by_column() -> None:
    assert parsed(json.dumps(OPEN3D)) == CAMERA
    assert parsed(json.dumps({"class_name": "PinholeCameraParameters", "intrinsic": OPEN3D})) == CAMERA


def test_a_matrix_written_by_rows_under_the_same_key_is_told_by_its_zeros() -> None:
    rows = [[390.25, 0, 321.75], [0, 391.5, 239.125], [0, 0, 1]]
    assert parsed(json.dumps({**OPEN3D, "intrinsic_matrix": rows})) == CAMERA


@pytest.mark.parametrize("text", [ROS, ECHOED])
def test_ros_camera_info(text: str) -> None:
    assert parsed(text) == DISTORTED


def test_librealsense_fields() -> None:
    assert parsed(json.dumps(LIBREALSENSE)) == DISTORTED


def test_toml_with_a_unit() -> None:
    assert camera_files.parse("camera", TOML) == camera_files.CameraFile((CAMERA,), 0.001)


@pytest.mark.parametrize(("scale", "unit"), [(1000.0, 0.001), (0.001, 0.001), (5000, 0.0002)])
def test_depth_scale_in_both_meanings(scale: float, unit: float) -> None:
    assert camera_files.parse("camera", json.dumps({**OPEN3D, "depth_scale": scale})).depth_unit == unit


def test_coefficients_by_name_keep_their_model_s_order() -> None:
    named = {key: OPEN3D[key] for key in OPEN3D} | {"distortion_model": "plumb_bob", "k1": 0.1, "k3": 0.01}
    assert parsed(json.dumps(named)).distortion == (0.1, 0.0, 0.0, 0.0, 0.01)
    fisheye = named | {"distortion_model": "fisheye"}
    assert parsed(json.dumps(fisheye)).distortion == (0.1, 0.0, 0.01)


def test_enumerated_text_chooses_the_depth_stream_of_the_frame_s_size(tmp_path: Path) -> None:
    path = tmp_path / "camera.txt"
    path.write_text(ENUMERATED)
    small, wide = camera_files.load(path, (640, 480)), camera_files.load(path, (848, 480))
    assert (small.fx, small.cx, small.distortion_model) == (390.25, 321.75, "none")
    assert wide.distortion_model == "inverse_brown_conrady"
    assert wide.distortion == (0.1, 0.2, 0.003, 0.0026, -0.11)
    with pytest.raises(InputError, match="640 x 480, 848 x 480; which is meant"):
        camera_files.load(path)


NAMES = {
    "plumb_bob": "brown_conrady",
    "Brown Conrady": "brown_conrady",
    "distortion.inverse_brown_conrady": "inverse_brown_conrady",
    "Inverse Brown Conrady": "inverse_brown_conrady",
    "rational_polynomial": "rational",
    "equidistant": "kannala_brandt",
    "Kannala Brandt4": "kannala_brandt",
    "fisheye": "kannala_brandt",
}


@pytest.mark.parametrize(("theirs", "ours"), NAMES.items())
def test_every_spelling_of_a_model_is_known(theirs: str, ours: str) -> None:
    assert camera_files.distortion_model("camera", theirs, [0.1]) == ours


BAD = {
    "no JSON": ("{", "JSON"),
    "no fields": ("just words", "no named fields"),
    "list": ("- 1\n- 2\n", "no named fields"),
    "broken YAML": ("a: [1, 2", "neither JSON"),
    "no width": (json.dumps({"fx": 1}), "'width' is missing"),
    "no focal length": (json.dumps({"width": 640, "height": 480}), "'fx' is missing"),
    "NaN": (json.dumps(LIBREALSENSE | {"fx": float("nan")}), "'fx' is nan"),
    "zero": (json.dumps(LIBREALSENSE | {"fy": 0}), "fy is 0.0"),
    "all zero": (ROS.replace("390.25, 0., 321.75, 0., 391.5, 239.125, 0., 0., 1.", ", ".join("0" * 9)), "fx is 0"),
    "no centre": (json.dumps(LIBREALSENSE | {"ppx": 0, "ppy": 0}), "cx and cy are both 0"),
    "word": (json.dumps(LIBREALSENSE | {"fx": "wide"}), "'fx' is 'wide', not a number"),
    "yes": (json.dumps(LIBREALSENSE | {"fx": True}), "'fx' is True, not a number"),
    "half a pixel": (json.dumps(LIBREALSENSE | {"width": 640.5}), "width"),
    "huge": (json.dumps(LIBREALSENSE | {"width": 10**300}), "width"),
    "short matrix": (json.dumps(OPEN3D | {"intrinsic_matrix": [1, 2, 3]}), "3 numbers, not 9"),
    "skew": (json.dumps(OPEN3D | {"intrinsic_matrix": [390, 0, 0, 5, 390, 0, 320, 240, 1]}), "skew"),
    "unknown model": (json.dumps(LIBREALSENSE | {"model": "distortion.ftheta"}), "'distortion.ftheta'"),
    "modified": (json.dumps(LIBREALSENSE | {"model": "Modified Brown Conrady"}), "Modified Brown Conrady"),
    "no model": (json.dumps(LIBREALSENSE | {"model": ""}), "without a model"),
    "none but some": (json.dumps(LIBREALSENSE | {"model": "none"}), "has no coefficients"),
    "too many": (json.dumps(LIBREALSENSE | {"coeffs": [0.1] * 9}), "coefficients"),
    "coefficients": (json.dumps(LIBREALSENSE | {"coeffs": 0.1}), "'coeffs' is 0.1"),
    "infinite coefficient": (json.dumps(LIBREALSENSE | {"coeffs": [float("inf")]}), r"'coeffs\[0\]' is inf"),
    "binned": (ECHOED.replace("binning_x: 0", "binning_x: 2"), "binning_x"),
    "cropped": (ECHOED.replace("x_offset: 0", "x_offset: 8"), "roi"),
    "unit": (TOML.replace("0.001", "-1.0"), "depth unit"),
    "scale of 1": (json.dumps(OPEN3D | {"depth_scale": 1}), "depth unit"),
    "only colour": (ENUMERATED.replace('"Depth"', '"Color"'), "no intrinsics of a Depth stream"),
    "deep JSON": ('{"a":' * 5000, "JSON"),
    "deep YAML": ("a: " + "[" * 5000, "neither JSON"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "cause"), BAD.values(), ids=BAD.keys())
def test_bad_camera_files_are_refused_by_name(tmp_path: Path, text: str, cause: str) -> None:
    path = tmp_path / "camera.any"
    path.write_text(text)
    with pytest.raises(InputError, match=rf"camera\.any.*{cause}"):
        camera_files.read(path)


@pytest.mark.parametrize("content", [b"", b"   \n", b"\xff\xfe\x00", b"#" * (1 << 21)])
def test_no_camera_file_at_all(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "camera.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"camera\.json: is "):
        camera_files.read(path)
    with pytest.raises(InputError, match="no such camera file"):
        camera_files.read(tmp_path / "missing.json")


sides = st.integers(1, 20_000)
lengths = st.floats(0.1, 1e5)
coefficients = st.lists(st.floats(-2, 2), min_size=1, max_size=4).map(tuple)
models = st.sampled_from(["brown_conrady", "inverse_brown_conrady", "rational", "kannala_brandt"])


@given(st.builds(Camera, sides, sides, lengths, lengths, lengths, lengths, models, coefficients))
def test_what_is_written_is_read_again(tmp_path_factory: pytest.TempPathFactory, camera: Camera) -> None:
    folder = tmp_path_factory.mktemp("cameras")
    unused = camera.distortion_model != "kannala_brandt" and not any(camera.distortion)
    expected = replace(camera, distortion_model="none", distortion=()) if unused else camera
    for suffix in (".json", ".toml", ".yaml"):
        if suffix == ".yaml" and camera.distortion_model == "inverse_brown_conrady":
            with pytest.raises(InputError, match="ROS has no"):
                camera_files.dump(camera, folder / f"camera{suffix}")
            continue
        camera_files.dump(camera, folder / f"camera{suffix}", depth_unit=0.00025)
        assert camera_files.load(folder / f"camera{suffix}") == expected
    assert camera_files.read(folder / "camera.toml").depth_unit == 0.00025


@pytest.mark.parametrize(
    ("changed", "cause"),
    [
        ({"width": "640"}, "width"),
        ({"width": None}, "width"),
        ({"height": float("nan")}, "height"),
        ({"height": float("inf")}, "height"),
        ({"height": 480.5}, "height"),
        ({"fx": "570"}, "fx"),
        ({"cy": float("nan")}, "cy"),
        ({"distortion_model": "brown_conrady", "distortion": ("x",)}, "distortion"),
        ({"distortion_model": "mirror"}, "mirror"),
    ],
)
def test_a_camera_that_can_not_be_is_refused_by_field(changed: dict[str, object], cause: str) -> None:
    plain: dict[str, object] = {"width": 640, "height": 480, "fx": 570.3, "fy": 570.3, "cx": 319.5, "cy": 239.5}
    with pytest.raises(InputError, match=cause):
        Camera(**{**plain, **changed})  # type: ignore[arg-type]


STATED = IntrinsicsStd(0.001, 0.5, 0.002)


@pytest.mark.parametrize("suffix", [".json", ".toml"])
def test_a_camera_keeps_how_exactly_it_is_known(suffix: str, tmp_path: Path) -> None:
    known = replace(DISTORTED, intrinsics_std=STATED)
    camera_files.dump(known, path := tmp_path / f"camera{suffix}")
    assert camera_files.load(path) == known
    assert Camera(**known.to_dict()) == known
    assert "intrinsics_std" not in DISTORTED.to_dict()


def test_the_principal_points_deviation_goes_with_the_pixels() -> None:
    half = scaled(replace(CAMERA, intrinsics_std=STATED), (320, 240))
    assert half.intrinsics_std == IntrinsicsStd(0.001, 0.25, 0.002)
    assert half.intrinsics_std.of_rays(half) == pytest.approx(STATED.of_rays(CAMERA))


@pytest.mark.parametrize("wrong", ["exact", 0.5, {}, {"f": -0.1}, {"f": True}, {"fx": 0.1}, {"c": float("nan")}])
def test_deviations_that_are_none_are_named(wrong: object, tmp_path: Path) -> None:
    path = tmp_path / "camera.json"
    path.write_text(json.dumps({**CAMERA.to_dict(), "intrinsics_std": wrong}))
    with pytest.raises(InputError, match=r"camera.json: intrinsics_std"):
        camera_files.load(path)
