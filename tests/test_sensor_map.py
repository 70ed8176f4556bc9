"""A map of the sensor's error: what it corrects, that it is kept only where it foretells, and who uses it."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import siloscope
from silos import SMALL
from siloscope import Calibration, sensors
from siloscope.cli import main
from siloscope.errors import InputError
from siloscope.io import writers
from siloscope.types.sensor_map import SensorMap
from siloscope.validation.mapping import GRID, Mapping, Waves, with_map
from test_validate import LEVELS, PROFILE, depths, warped

ERROR = 0.004
TOLD: dict[str, Any] = {"camera": SMALL, "intrinsics": "exact"}
TRUE = (0.5, 0.2)
"""Where the camera hangs."""


@cache
def frames() -> tuple[np.ndarray, ...]:
    return tuple(warped(depth, ERROR) for depth in depths())


@cache
def learned() -> Mapping:
    return siloscope.sensor_map(frames(), sensor=PROFILE, **TOLD)


def flat(power: int = 1, error: float = 0.01) -> SensorMap:
    return SensorMap(power, np.full((3, 4), error), np.zeros((3, 4)), np.diag([1e-6] * 7))


def off(found: Calibration) -> float:
    assert found.pose is not None
    return float(np.hypot(found.pose.t_x - TRUE[0], found.pose.t_y - TRUE[1]))


@pytest.mark.parametrize("power", [1, 2])
def test_a_map_takes_away_what_it_says(power: int) -> None:
    depth = np.linspace(0.5, 8.0, 48).reshape(6, 8)
    draws = np.random.default_rng(1)
    made = replace(flat(power), error=draws.uniform(-0.01, 0.01, (3, 4)))
    read = depth + made.over(depth.shape) * depth**power
    assert np.abs(made.corrected(read.astype(np.float32)) - depth).max() < 1e-5
    assert not made.corrected(np.zeros((6, 8), np.float32)).any()


def test_a_map_is_the_same_at_every_size_of_the_image() -> None:
    v, u = np.meshgrid(*(np.linspace(0.0, 3.0, n) for n in GRID), indexing="ij")
    made = replace(flat(), error=0.01 * np.sin(u + 0.3) * np.cos(v))
    large, small = made.over((480, 640)), made.over((240, 320))
    assert np.allclose(large[[0, 0, -1, -1], [0, -1, 0, -1]], made.error[[0, 0, -1, -1], [0, -1, 0, -1]])
    assert np.abs(large[::2, ::2] - small).max() < 1.5e-4


def test_waves_have_the_variance_that_is_told() -> None:
    waves = Waves((320, 240), 8)
    variance, draws = waves.variances(0.01, 0.3), np.random.default_rng(3)
    places = draws.uniform(0.0, 1.0, (2, 400))
    fields = waves.at(*places) @ (np.sqrt(variance)[:, None] * draws.standard_normal((len(variance), 300)))
    assert 0.0085 < fields.std() < 0.0115
    near = waves.at(np.array([0.4, 0.4 + 0.15]), np.array([0.5, 0.5]))  # 0.3 halves of the width apart: one length
    correlation = (near[0] * variance) @ near[1] / ((near[0] ** 2) @ variance)
    assert abs(correlation - np.exp(-0.5)) < 0.06


def test_a_warped_sensor_is_mapped_and_its_pose_mended() -> None:
    assert learned().map is not None, learned().message
    assert learned().held_out < 0.4
    plain = siloscope.calibrate(frames(), sensor=PROFILE, **TOLD)
    mapped = siloscope.calibrate(frames(), sensor=learned().profile, **TOLD)
    assert off(mapped) < 0.7 * off(plain)
    assert mapped.covariance is not None
    std = np.sqrt(np.diag(mapped.covariance))[2:]
    assert off(mapped) < 4.0 * np.hypot(*std)


def test_frames_that_were_not_learned_from_are_mended_too() -> None:
    half = siloscope.sensor_map(frames()[::2], sensor=PROFILE, **TOLD)
    assert half.map is not None, half.message
    before, after = [], []
    for depth, exact in zip(frames()[1::2], depths()[1::2], strict=True):
        smooth = half.map.corrected(depth) / exact - 1.0
        before.append(np.std(depth / exact - 1.0))
        after.append(np.std(smooth))
    assert np.mean(after) < 0.75 * np.mean(before)


def test_no_map_is_made_of_a_sensor_that_is_right() -> None:
    found = siloscope.sensor_map(depths(), sensor=PROFILE, **TOLD)
    assert found.map is None
    assert found.profile.map is None
    assert "no pattern" in found.message


@pytest.mark.parametrize("fault", ["bend", "centre"])
def test_no_map_is_made_of_what_is_no_sensors(fault: str) -> None:
    camera = replace(SMALL, cx=SMALL.cx + 3.0) if fault == "centre" else SMALL
    made = depths(0.004) if fault == "bend" else depths()
    found = siloscope.sensor_map(made, sensor=PROFILE, camera=camera, intrinsics="exact")
    assert found.map is None


def test_a_map_that_foretells_nothing_is_not_kept() -> None:
    """Each level has an error of its own."""
    signs = (1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0)
    made = [warped(depth, sign * ERROR) for depth, sign in zip(depths(), signs, strict=True)]
    found = siloscope.sensor_map(made, sensor=PROFILE, **TOLD)
    assert found.map is None


def test_few_frames_give_no_map() -> None:
    found = siloscope.sensor_map(frames()[:3], sensor=PROFILE, **TOLD)
    assert found.map is None
    assert "fewer than 4" in found.message


def test_locate_and_measure_use_the_map() -> None:
    mapped, frame = learned().profile, frames()[-1]
    assert mapped.map is not None
    by_map = siloscope.locate(frame, sensor=mapped, **TOLD)
    by_hand = siloscope.locate(mapped.map.corrected(frame), sensor=PROFILE, **TOLD)
    assert by_map.pose == by_hand.pose
    assert by_map.config["sensor"]["map"]["power"] == mapped.map.power
    assert (np.diag(by_map.covariance) > np.diag(by_hand.covariance)).all()
    calibration = siloscope.calibrate(frames(), sensor=mapped, bottom="cone", **TOLD)
    plain = replace(calibration, config={**calibration.config, "sensor": PROFILE.to_dict()})
    read = siloscope.measure(frame, calibration, SMALL)
    named = siloscope.measure(frame, calibration, SMALL, sensor="orbbec-astra-s")
    kept = sensors.with_map(PROFILE, calibration.config["sensor"]).map  # to a tenth of a micrometre as it was learned
    assert kept is not None
    corrected = siloscope.measure(kept.corrected(frame), plain, SMALL)
    assert read.volume == pytest.approx(corrected.volume, rel=1e-9)
    assert named.volume == read.volume


def test_a_map_survives_its_file_and_a_calibration_names_its_sensor(tmp_path: Path) -> None:
    mapped = learned().profile
    calibration = siloscope.calibrate(frames(), sensor=mapped, **TOLD)
    calibration.save(tmp_path / "silo.json")
    read = sensors.load(tmp_path / "silo.json")
    assert read.map is not None
    assert np.abs(read.map.error - mapped.map.error).max() < 1e-7
    assert read.map == pickle.loads(pickle.dumps(read.map))
    more = siloscope.calibrate(frames()[:2], camera=SMALL, continue_from=tmp_path / "silo.json")
    assert more.config["sensor"] == json.loads((tmp_path / "silo.json").read_text())["config"]["sensor"]


def test_a_map_that_is_none_is_named(tmp_path: Path) -> None:
    calibration = siloscope.calibrate(frames(), sensor=replace(PROFILE, map=flat()), **TOLD)
    calibration.save(tmp_path / "silo.json")
    broken = json.loads((tmp_path / "silo.json").read_text())
    broken["config"]["sensor"]["map"]["error"][0][0] = 3.0
    (tmp_path / "silo.json").write_text(json.dumps(broken))
    with pytest.raises(InputError, match=r"map\.error"):
        Calibration.load(tmp_path / "silo.json")


def test_the_command_maps_and_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for number, depth in enumerate(frames()):
        Image.fromarray(np.rint(1000.0 * depth).astype(np.uint16)).save(tmp_path / f"{number}.png")
    writers.write_camera(SMALL, tmp_path / "camera.json")
    words = ["--camera", str(tmp_path / "camera.json"), "--depth-unit", "0.001", "--intrinsics", "exact"]
    files = [str(tmp_path / f"{number}.png") for number in range(len(LEVELS))]
    out = tmp_path / "silo.json"
    assert main(["calibrate", *files, *words, "--sensor", "orbbec-astra-s", "--sensor-map", "-o", str(out)]) == 0
    assert "sensor mapped: the residuals of held-out frames fall to" in capsys.readouterr().err
    found = Calibration.load(out)
    assert "sensor-mapped" in found.quality
    assert "map" in found.config["sensor"]
    assert main(["locate", files[-1], *words, "--sensor", str(out), "--json"]) == 0
    assert "map" in json.loads(capsys.readouterr().out)["config"]["sensor"]


def test_a_calibration_tells_that_no_map_was_kept() -> None:
    found = siloscope.calibrate(depths(), sensor=PROFILE, **TOLD)
    assert "sensor-not-mapped" in with_map(found, siloscope.sensor_map(depths(), sensor=PROFILE, **TOLD)).quality
