"""Orbbec recordings, made from the layout in the SDK's sources: what follows the image is taken as far as it goes."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bags
import siloscope
from foxglove_files import rvl
from siloscope import Camera, InputError

RAWS = list(np.random.default_rng(6).integers(0, 65536, (3, 48, 64), dtype=np.uint16))
K1_TO_P2 = (0.1, -0.02, 0.003, 0.4, 0.05, 0.006, 1e-3, 2e-3)


@pytest.mark.parametrize("tail", [{"unit": None}, {"unit": 0.0, "bit_size": False}, {"unit": 0.0}])
def test_depth_and_camera_whatever_follows_the_image(tmp_path: Path, tail: dict[str, Any]) -> None:
    with siloscope.open(bags.orbbec(tmp_path / "o.bag", RAWS, **tail)) as source:
        frames = list(source)
    assert np.array_equal([frame.depth for frame in frames], RAWS)
    camera = source.camera
    assert camera == Camera(64, 48, 57.0, 57.25, 31.5, 23.25)
    assert source.provenance["device"] == "Orbbec Astra 2"
    assert source.provenance["serial_number"] == "AARY123"
    assert source.provenance["firmware"] == "2.8.20"
    assert source.problems == []


@pytest.mark.parametrize(
    ("options", "unit", "origin"),
    [
        ({"unit": 0.0}, 0.001, "SDK default"),
        ({"unit": 0.00025}, 0.00025, "image"),
        ({"unit": 0.25}, 0.00025, "image"),
        ({"unit": 1.0}, 0.001, "image"),
        ({"properties": {176: struct.pack("<f", 0.25)}}, 0.00025, "property: depth unit"),
        ({"properties": {75: struct.pack("<i", 1)}}, 0.0008, "property: depth precision level"),
    ],
)
def test_the_unit_is_the_images_else_the_propertys_else_a_millimetre(
    tmp_path: Path, options: dict[str, Any], unit: float, origin: str
) -> None:
    frame = next(iter(siloscope.open(bags.orbbec(tmp_path / "o.bag", RAWS, **options))))
    assert frame.depth_unit == pytest.approx(unit, rel=1e-6)
    assert frame.provenance["depth_unit_from"].startswith(origin)


def test_time_is_the_computers_where_recorded(tmp_path: Path) -> None:
    source = siloscope.open(bags.orbbec(tmp_path / "o.bag", RAWS, unit=0.0))
    assert source.timestamps == pytest.approx([1.7e9, 1.7e9 + 0.033, 1.7e9 + 0.066], abs=1e-5)


@pytest.mark.parametrize(
    ("number", "model", "d"),
    [
        (3, "brown_conrady", (0.1, -0.02, 1e-3, 2e-3, 0.003)),
        (4, "rational", (0.1, -0.02, 1e-3, 2e-3, 0.003, 0.4, 0.05, 0.006)),
    ],
)
def test_distortion_is_in_the_sdks_order(tmp_path: Path, number: int, model: str, d: tuple[float, ...]) -> None:
    k = K1_TO_P2 if model == "rational" else (*K1_TO_P2[:3], 0.0, 0.0, 0.0, *K1_TO_P2[6:])
    camera = siloscope.open(bags.orbbec(tmp_path / "o.bag", RAWS, distortion=k, model=number)).camera
    assert camera is not None
    assert camera.distortion_model == model
    assert camera.distortion == pytest.approx(d, rel=1e-6)


def test_gravity_goes_through_the_accelerometers_extrinsics(tmp_path: Path) -> None:
    """The fixture's rotation takes x, y, z of the accelerometer to y, z, x of the camera."""
    path = bags.orbbec(tmp_path / "o.bag", RAWS, accel=np.array([-9.8, 0.1, 0.2]))
    np.testing.assert_allclose(siloscope.open(path).gravity, [-0.2, 9.8, -0.1], atol=1e-6)


@pytest.mark.parametrize("fx", [0.0, float("nan")])
def test_nan_and_zero_intrinsics_are_refused_by_name_but_the_users_win(tmp_path: Path, fx: float) -> None:
    path = bags.orbbec(tmp_path / "o.bag", RAWS, fx=fx)
    with pytest.raises(InputError, match=r"stream profile: .*camera"):
        siloscope.open(path)
    camera = Camera(64, 48, 57.0, 57.0, 31.5, 23.5)
    assert next(iter(siloscope.open(path, camera=camera))).camera == camera


def test_an_encoding_that_is_not_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="'RLE', which is not read; record with format Y16"):
        list(siloscope.open(bags.orbbec(tmp_path / "o.bag", RAWS, encoding="RLE")))


def test_rvl_is_unpacked_and_damaged_rvl_is_named(tmp_path: Path) -> None:
    source = siloscope.open(bags.orbbec(tmp_path / "rvl.bag", RAWS, unit=0.001, encoding="RVL", packed=rvl))
    for frame, raw in zip(source, RAWS, strict=True):
        assert np.array_equal(np.asarray(frame.depth), raw)
        assert frame.depth_unit == pytest.approx(0.001)
    cut = bags.orbbec(tmp_path / "cut.bag", RAWS, encoding="RVL", packed=lambda raw: rvl(raw)[:40])
    with pytest.raises(InputError, match="damaged RVL"):
        list(siloscope.open(cut))


def test_sdk_version_1_calls_its_camera_cam0(tmp_path: Path) -> None:
    source = siloscope.open(bags.orbbec(tmp_path / "o.bag", RAWS, camera="cam0", unit=0.001))
    assert source.provenance["stream"] == "cam0/depth"
    assert np.array_equal(next(iter(source)).depth, RAWS[0])
