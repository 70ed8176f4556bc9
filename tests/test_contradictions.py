"""Inputs that say something against each other: refused or remarked, unless the caller trusts one of them."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import siloscope
from siloscope import Camera, Frame, UsageError, sensors
from siloscope.cli import main
from siloscope.estimation.input_checks import camera_remarks, hole_remarks, range_remarks
from siloscope.estimation.prior_checks import diameter_off, prior_remarks
from siloscope.estimation.priors import Priors
from siloscope.io.camera_sizes import scaled
from siloscope.io.writers import write_camera, write_png
from siloscope.reasons import REMARKS
from siloscope.simulation import Feed, sensor_model
from siloscope.simulation.scenarios import random_scene, scenario
from siloscope.types.intrinsics import CALIBRATED

sys.path.append(str(Path(__file__).parents[1]))
from benchmarks.contradictions import WRONG, outcomes, right

PROFILE = "realsense-d435"
CAMERA = scaled(next(c for c in sensors.load(PROFILE).intrinsics if c.width == 640), (160, 120))
SCENE = replace(scenario("silo2"), camera=CAMERA, sensor=replace(sensor_model(PROFILE), unit=0.001), seed=4)
DEPTH = np.nan_to_num(SCENE.render().measured)
RAW: NDArray[np.uint16] = np.rint(DEPTH / 0.001).astype(np.uint16)
DIAMETER = 2.0 * SCENE.silo.radius
KNOWN: dict[str, Any] = {"sensor": PROFILE, "depth_unit": 0.001}


def before_its_own_camera(sensor: str, name: str) -> tuple[Camera, NDArray[np.uint16]]:
    """A sensor's nominal camera at 160 x 120 pixels, and a scenario before it, mm."""
    own = scaled(next(c for c in sensors.load(sensor).intrinsics if c.width == 640), (160, 120))
    scene = replace(scenario(name), camera=own, sensor=replace(sensor_model(sensor), unit=0.001), seed=4)
    return own, np.rint(np.nan_to_num(scene.render().measured) / 0.001).astype(np.uint16)


def codes(estimate: siloscope.Estimate) -> list[tuple[str, str]]:
    """Codes with their severity."""
    return [(remark.code, remark.severity) for remark in estimate.quality]


def test_right_inputs_are_not_remarked_on() -> None:
    estimate = siloscope.locate(RAW, CAMERA, **KNOWN, diameter=DIAMETER, gravity=SCENE.pose.axis_direction)
    assert estimate.ok, estimate.message
    assert estimate.quality == ()
    assert estimate.to_dict()["quality"] == []


@pytest.mark.parametrize("factor", [0.05, 0.1, 6.0, 10.0])
def test_depth_out_of_the_sensors_range_is_refused(factor: float) -> None:
    estimate = siloscope.locate(RAW, CAMERA, sensor=PROFILE, depth_unit=0.001 * factor)
    assert estimate.reason == "outside-sensor-range"
    assert estimate.pose is None
    assert estimate.message is not None
    assert "depth unit" in estimate.message
    assert ("outside-sensor-range", "refusal") in codes(estimate)


@pytest.mark.parametrize(("farthest", "told"), [(9.9, []), (13.0, ["warning"]), (15.0, ["refusal"])])
def test_a_surface_a_little_beyond_the_range_is_a_warning(farthest: float, told: list[str]) -> None:
    depth = np.linspace(1.0, farthest, 160 * 120, dtype=np.float32).reshape(120, 160)
    assert [remark.severity for remark in range_remarks(depth, sensors.load(PROFILE))] == told


def test_a_sensor_that_measures_too_far_is_judged_by_the_true_depth() -> None:
    """The paper's Silo 2: 7.2 m away, 8.2 m as its Astra S measures, which reaches 8 m."""
    own, _ = before_its_own_camera("orbbec-astra-s", "silo2")
    seen = replace(scenario("silo2"), feed=None, camera=own, sensor=sensor_model("orbbec-astra-s")).render()
    depth = np.nan_to_num(seen.measured).astype(np.float32)
    assert np.mean(depth > 8.0) > 0.05
    assert range_remarks(depth, sensors.load("orbbec-astra-s")) == ()
    assert range_remarks(1.3 * depth, sensors.load("orbbec-astra-s"))[0].severity == "warning"
    assert range_remarks(1.3 * depth, sensors.load("orbbec-astra-s"), 1.0)[0].refuses
    assert range_remarks(4.0 * depth, sensors.load("orbbec-astra-s"))[0].refuses


def test_trusted_depth_is_answered_with_a_warning() -> None:
    estimate = siloscope.locate(RAW, CAMERA, sensor=PROFILE, depth_unit=0.006, trust="range")
    assert estimate.ok, estimate.message
    assert ("outside-sensor-range", "warning") in codes(estimate)


@pytest.mark.parametrize("factor", [0.5, 1.25])
def test_a_unit_that_the_makers_do_not_set_is_a_warning(factor: float) -> None:
    estimate = siloscope.locate(RAW, CAMERA, sensor=PROFILE, depth_unit=0.001 * factor)
    assert codes(estimate) == [("unusual-depth-unit", "warning")]


def test_millimetres_of_a_sensor_that_counts_otherwise_are_a_note() -> None:
    own, raw = before_its_own_camera("realsense-l515", "silo2")
    estimate = siloscope.locate(raw, own, sensor="realsense-l515", depth_unit=0.001)
    assert codes(estimate) == [("millimetre-depth-unit", "note")]


def test_metres_and_a_recordings_own_unit_are_no_unusual_unit() -> None:
    fine = np.rint(DEPTH / 0.0005).astype(np.uint16)
    told = siloscope.Frame(depth=fine, camera=CAMERA, depth_unit=0.0005, provenance={"depth_unit_from": "recording"})
    for data in (DEPTH, told):
        assert codes(siloscope.locate(data, CAMERA, sensor=PROFILE)) == []


@pytest.mark.parametrize("factor", [0.7, 1.12])
def test_a_diameter_against_the_profile_is_refused_with_the_numbers(factor: float) -> None:
    estimate = siloscope.locate(RAW, CAMERA, **KNOWN, diameter=factor * DIAMETER)
    assert codes(estimate) == [("diameter-contradicted", "refusal")]
    assert estimate.reason == "diameter-contradicted"
    assert f"{factor * DIAMETER:g} m" in str(estimate.message)
    trusting = siloscope.locate(RAW, CAMERA, **KNOWN, diameter=factor * DIAMETER, trust=["diameter"])
    assert trusting.ok
    assert codes(trusting) == [("diameter-contradicted", "warning")]


def test_colour_intrinsics_are_found_out_by_the_tape() -> None:
    for by in (1.2, 1.4):
        colour = replace(CAMERA, fx=by * CAMERA.fx, fy=by * CAMERA.fy)
        assert not siloscope.locate(RAW, colour, **KNOWN, diameter=DIAMETER).ok


@pytest.mark.parametrize(("name", "by"), [("silo2", 0.67), ("silo3", 1.2)])
def test_a_refused_frame_is_told_of_another_streams_camera(name: str, by: float) -> None:
    own, raw = before_its_own_camera(PROFILE, name)
    assert siloscope.locate(raw, own, **KNOWN).quality == ()
    estimate = siloscope.locate(raw, replace(own, fx=by * own.fx, fy=by * own.fy), **KNOWN)
    assert not estimate.ok
    assert codes(estimate) == [("another-streams-camera", "warning")]
    assert "check the camera file" in str(estimate.message)


def test_a_tape_far_off_a_sensor_without_a_profile_is_refused() -> None:
    assert siloscope.locate(1.05 * DEPTH, CAMERA, diameter=DIAMETER).quality == ()  # the tape fixes the scale
    assert siloscope.locate(1.3 * DEPTH, CAMERA, diameter=DIAMETER).reason == "diameter-contradicted"
    trusting = siloscope.locate(1.3 * DEPTH, CAMERA, diameter=DIAMETER, trust="diameter-contradicted")
    assert codes(trusting) == [("diameter-contradicted", "warning")]
    assert trusting.silo.radius == pytest.approx(DIAMETER / 2.0, abs=0.003)


def test_a_tape_within_what_a_sensor_may_be_off_is_not_blamed() -> None:
    free = siloscope.locate(DEPTH, CAMERA)
    for by, blamed in ((0.98, False), (1.05, False), (0.8, True), (1.25, True)):
        off = diameter_off(free, Priors(sensors.UNKNOWN, by * DIAMETER))
        assert (off is not None) == blamed, by
    assert diameter_off(free, Priors(sensors.load(PROFILE), 1.15 * DIAMETER)) == pytest.approx(
        -0.15 * DIAMETER, rel=0.1
    )


@pytest.mark.parametrize("aside", [(0.15, 0.0, 0.0), (-0.1, 0.2, 0.0)])
def test_gravity_aside_of_the_axis_is_refused(aside: tuple[float, float, float]) -> None:
    down = SCENE.pose.axis_direction + aside
    recorded = siloscope.Frame(depth=RAW, camera=CAMERA, depth_unit=0.001, gravity=9.81 * down)
    for told in ({"data": RAW, **KNOWN, "gravity": down}, {"data": recorded, "sensor": PROFILE}):
        estimate = siloscope.locate(camera=CAMERA, **told)
        assert estimate.reason == "gravity-contradicts"
        trusting = siloscope.locate(camera=CAMERA, trust="gravity", **told)
        assert trusting.ok
        assert codes(trusting) == [("gravity-contradicts", "warning")]


def test_an_accelerometers_reading_is_turned_round_and_told() -> None:
    estimate = siloscope.locate(RAW, CAMERA, **KNOWN, gravity=-SCENE.pose.axis_direction)
    assert estimate.ok
    assert codes(estimate) == [("gravity-behind", "warning")]


def test_intrinsics_that_no_sensor_has_are_warned_of() -> None:
    longer = replace(CAMERA, fx=1.05 * CAMERA.fx)
    aside = replace(CAMERA, cx=CAMERA.cx + 0.2 * CAMERA.width)
    assert [remark.code for remark in camera_remarks(longer)] == ["focal-lengths-differ"]
    assert [remark.code for remark in camera_remarks(aside)] == ["principal-point-aside"]
    assert camera_remarks(replace(CAMERA, fx=1.01 * CAMERA.fx, cx=CAMERA.cx + 0.1 * CAMERA.width)) == ()


def test_intrinsics_that_the_wall_needs_otherwise_are_refused() -> None:
    estimate = siloscope.locate(RAW, CAMERA, **KNOWN, diameter=DIAMETER)
    priors = Priors(sensors.load(PROFILE), DIAMETER, camera_std=CALIBRATED.of_rays(CAMERA))
    errors = {"intrinsics-contradicted": [0.011, -0.006, 0.0, 0.0, 0.0], None: [0.004, -0.004, 0.01, 0.0, 1.0]}
    for code, error in errors.items():
        pulled = replace(estimate, extra={**estimate.extra, "fit": {**estimate.extra["fit"], "camera_error": error}})
        assert [remark.code for remark in prior_remarks(pulled, priors)] == ([] if code is None else [code])


def test_raw_disparity_of_the_first_kinect_is_refused() -> None:
    raw = np.where(RAW > 0, 600, 2047).astype(np.uint16)
    raw[:5] = 2047
    estimate = siloscope.locate(raw, CAMERA, depth_unit=0.001)
    assert estimate.reason == "kinect-raw"


def test_ray_lengths_and_disparities_taken_for_depth_are_named() -> None:
    stretch = np.sqrt(1.0 + np.sum(CAMERA.rays() ** 2, axis=2))
    seen = {"ray-length-as-depth": DEPTH * stretch, "disparity-as-depth": np.where(DEPTH > 0, 2.0 / DEPTH, 0.0)}
    for code, values in seen.items():
        estimate = siloscope.locate(values, CAMERA, sensor=PROFILE, trust="range")
        assert not estimate.ok
        assert (code, "warning") in codes(estimate), (code, estimate.quality)
        assert estimate.message is not None
        assert REMARKS[code][1] in estimate.message


def test_a_reading_by_chance_is_no_hint() -> None:
    """A cone alone, refused without gravity; bent as by ray lengths, it is a cylinder of which tiles disagree."""
    told = right(396)
    estimate = told.locate()
    assert estimate.reason == "cone-alone"
    assert codes(estimate) == []


def test_a_camera_of_another_sensor_is_warned_of_where_nothing_confirms_it() -> None:
    longer = replace(CAMERA, fx=1.5 * CAMERA.fx, fy=1.5 * CAMERA.fy)
    seen = replace(SCENE, camera=longer).render()
    depth = np.nan_to_num(seen.measured)
    warning = ("another-streams-camera", "warning")
    assert warning in codes(siloscope.locate(depth, longer, sensor=PROFILE))
    assert warning not in codes(siloscope.locate(depth, longer, sensor=PROFILE, diameter=DIAMETER)), "the tape fits"
    assert warning not in codes(siloscope.locate(Frame(depth=depth, camera=longer), sensor=PROFILE)), "its recording's"
    assert warning not in codes(siloscope.locate(depth, longer))


def test_filled_holes_are_named_and_coarse_values_are_not() -> None:
    filled = DEPTH.astype(np.float32)
    filled[20:90, 60:100] = filled[20:90, 59:60]
    assert [remark.code for remark in hole_remarks(filled)] == ["hole-filled"]
    assert list(hole_remarks(DEPTH.astype(np.float32))) == []
    assert list(hole_remarks(DEPTH.round(1).astype(np.float32))) == []
    assert ("hole-filled", "warning") in codes(siloscope.locate(filled, CAMERA, sensor=PROFILE))


def test_what_can_be_trusted_has_a_name() -> None:
    with pytest.raises(UsageError, match="known are range, camera, bias, diameter, gravity"):
        siloscope.locate(RAW, CAMERA, **KNOWN, trust="everything")


def test_right_frames_of_many_silos_lie_in_their_sensors_range() -> None:
    for seed in range(24):
        name = ("orbbec-astra", "realsense-d455", "realsense-l515")[seed % 3]
        feed = Feed("gaussian", 0.05 + 0.02 * seed, seed=seed) if seed % 5 else None
        seen = replace(random_scene(seed, feed, sensor=sensor_model(name, seed)), camera=CAMERA).render()
        depth = np.nan_to_num(seen.measured).astype(np.float32)
        assert range_remarks(depth, sensors.load(name)) == (), (seed, name)
        assert range_remarks(10.0 * depth, sensors.load(name)) != (), (seed, name)


@pytest.mark.parametrize("kind", list(WRONG))
def test_mistakes_in_frames_of_many_silos_are_never_silent(kind: str) -> None:
    silent = [(seed, codes) for seed, result, codes in outcomes(kind, 6, first=2_000) if result == "silent"]
    assert silent == []


def test_right_frames_of_many_silos_are_not_blamed() -> None:
    found = list(outcomes("right", 15, first=2_000))
    assert [told for told in found if told[1] in ("contradicted", "warned")] == []
    assert sum(result == "silent" for _, result, _ in found) > 8


def test_calibrate_measure_and_track_refuse_and_trust_alike(tmp_path: Path) -> None:
    wrong: dict[str, Any] = {"sensor": PROFILE, "depth_unit": 0.006}
    refused = siloscope.calibrate([RAW], camera=CAMERA, **wrong)
    assert not refused.ok
    assert refused.message is not None
    assert "check depth unit" in refused.message
    trusting = siloscope.calibrate([RAW], camera=CAMERA, **wrong, trust="range")
    assert trusting.ok
    assert {"outside-sensor-range", "unusual-depth-unit"} <= set(trusting.quality)
    trusting.save(tmp_path / "silo.json")
    told = {
        remark["code"]: remark["severity"] for remark in json.loads((tmp_path / "silo.json").read_text())["quality"]
    }
    assert told["outside-sensor-range"] == "warning"
    assert siloscope.Calibration.load(tmp_path / "silo.json").quality == trusting.quality

    right = siloscope.calibrate([RAW], camera=CAMERA, **KNOWN)
    for calibration in (None, right):
        content = siloscope.measure(RAW, calibration, CAMERA, **wrong, density=750.0)
        assert content.reason == "outside-sensor-range"
        assert content.message is not None
        assert "calibration" not in content.message
        assert [remark.severity for remark in content.quality] == ["refusal", "warning"]
    kept = siloscope.measure(RAW, right, CAMERA, **wrong, trust="range")
    assert kept.reason != "outside-sensor-range"
    assert "outside-sensor-range" in [remark.code for remark in kept.quality]
    frame = siloscope.Frame(depth=RAW, camera=CAMERA, depth_unit=0.006, provenance={"depth_unit_from": "given"})
    assert siloscope.track([frame], right, sensor=PROFILE).readings[0].reason == "outside-sensor-range"


def test_the_command_line_refuses_and_trusts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_png(tmp_path / "frame.png", RAW)
    write_camera(CAMERA, tmp_path / "camera.json")
    call = ["locate", str(tmp_path / "frame.png"), "--camera", str(tmp_path / "camera.json"), "--sensor", PROFILE]
    assert main([*call, "--depth-unit", "0.006", "--json"]) == 4
    document = json.loads(capsys.readouterr().out)
    assert document["reason"] == "outside-sensor-range"
    assert [remark["severity"] for remark in document["quality"]] == ["refusal", "warning"]
    assert set(document["quality"][0]) >= {"code", "message", "severity"}
    assert main([*call, "--depth-unit", "0.006", "--trust", "range"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert f"warning: {REMARKS['outside-sensor-range'][0]}" in shown
