"""The named scenes show what they are named for."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from siloscope import Camera, UsageError, sensors
from siloscope.simulation import ASTRA_S, DEFECTS, PERFECT, Defects, SensorModel, defects, sensor_model
from siloscope.simulation.scenarios import (
    COMPARISON_SILO,
    SCENARIOS,
    SILO1,
    SILO_R1_PRINTED,
    random_big_scene,
    random_scene,
    scenario,
)

SMALL = Camera(width=96, height=72, fx=85.5, fy=85.5, cx=47.5, cy=35.5)
NO_SILO = ("brim-full", "flat-wall", "room-corner", "square-shaft", "sphere", "noise", "nothing")


def shrunk(name: str, factor: int = 4) -> np.ndarray:
    """Label shares 0 to 4 of a scenario at a fraction of its resolution."""
    scene = scenario(name)
    c = scene.camera
    small = Camera(c.width // factor, c.height // factor, c.fx / factor, c.fy / factor, c.cx / factor, c.cy / factor)
    labels = replace(scene, camera=small, sensor=PERFECT).render().labels
    return np.bincount(labels.ravel(), minlength=5) / labels.size


@pytest.mark.parametrize("name", [name for name in SCENARIOS if name not in NO_SILO])
def test_silos_show_their_wall_and_cone(name: str) -> None:
    shares = shrunk(name)
    assert shares[2] > 0.1
    assert shares[0] == 0.0
    assert (shares[3] > 0) == (not name.startswith("comparison"))


@pytest.mark.parametrize("name", NO_SILO)
def test_worlds_without_wall_show_none(name: str) -> None:
    shares = shrunk(name)
    assert shares[1] == 0.0
    assert shares[2] == 0.0


def test_the_corner_is_in_the_middle_of_its_frame() -> None:
    scene = replace(scenario("room-corner"), camera=SMALL)
    frame = scene.render()
    normals = np.round(frame.normals @ scene.pose.T_silo_camera[:3, :3].T, 9)
    assert len(np.unique(normals.reshape(-1, 3), axis=0)) == 3
    middle = normals[35:37, 47:49].reshape(-1, 3)
    assert len(np.unique(middle, axis=0)) >= 2


def test_table_2_as_printed_looks_away_and_negated_looks_at_the_axis() -> None:
    def miss(name: str) -> float:
        pose, silo = scenario(name).pose, scenario(name).silo
        optical = pose.T_silo_camera[:3, 2]
        at_apex = np.array([pose.t_x, pose.t_y]) + optical[:2] / optical[2] * silo.height
        return float(np.hypot(*at_apex))

    assert SILO_R1_PRINTED.pose.r_y == 0.16
    assert miss("silo-r1") < 0.1
    assert miss("silo-r1-printed") > 1.4


def test_names_may_be_written_as_in_the_paper() -> None:
    assert scenario("Silo1") == SILO1
    assert scenario("SiloR1") == scenario("silo-r1")


def test_the_comparison_has_the_turns_of_table_7_and_the_sensors_own_cameras() -> None:
    d455 = scenario("comparison-d455")
    assert (d455.pose.r_x, d455.pose.r_y) == (0.07588, 0.31265)
    assert d455.camera == sensors.load("realsense-d455").camera(848, 480)
    cameras = {scenario(f"comparison-{s}").camera.width for s in ("astra", "d415", "d455", "l515")}
    assert cameras == {640, 1280, 848, 1024}
    assert d455.silo == COMPARISON_SILO
    assert math.isclose(COMPARISON_SILO.height, 3.35)


def test_big_scenes_have_the_sizes_they_promise() -> None:
    for seed in range(20):
        scene = random_big_scene(seed)
        assert 6.0 <= scene.silo.radius <= 12.0
        assert 15.0 <= scene.silo.height <= 30.0
    for seed in range(20):
        scene = random_scene(seed)
        assert 0.9 <= scene.silo.radius <= 2.2
    lidar = random_big_scene(0).camera
    assert math.isclose(2 * math.degrees(math.atan(512 / lidar.fx)), 70.0)
    assert np.all(random_big_scene(0).sensor.sigma_at(np.array([1.0, 30.0])) == 0.01)


@pytest.mark.parametrize("name", sensors.names())
def test_sensor_models_are_their_profiles(name: str) -> None:
    profile, model = sensors.load(name), sensor_model(name)
    for depth in (0.7, 2.0, 5.0):
        sigma = profile.sigma(depth) or 0.0
        assert math.isclose(float(model.sigma_at(depth)), sigma, rel_tol=1e-12)
        offset, scale, quadratic = profile.bias
        assert math.isclose(float(model.bias_at(depth)), offset + scale * depth + quadratic * depth**2, rel_tol=1e-12)


def test_devices_of_one_sensor_differ_as_the_profile_says() -> None:
    profile = sensors.load("realsense-d415")
    scales = np.array([sensor_model("d415", device).bias[1] for device in range(300)])
    assert abs(scales.std() / profile.bias_std[1] - 1) < 0.2
    assert abs(scales.mean()) < 4 * profile.bias_std[1] / math.sqrt(300)
    assert sensor_model("d415", 3) == sensor_model("realsense-d415", 3)


def test_astra_s_and_perfect_are_the_paper_s() -> None:
    assert sensor_model("astra-s") == sensor_model("orbbec-astra-s") == ASTRA_S
    assert sensor_model("perfect") == SensorModel()
    with pytest.raises(UsageError, match="unknown sensor"):
        sensor_model("eye")


def test_defects_by_name() -> None:
    assert defects("corrugated") == Defects(corrugation_depth=0.013)
    both = defects("oval+ladder", seed=4)
    assert (both.ovality, both.ladder, both.seed) == (0.01, True, 4)
    assert defects("all").auger
    for name in DEFECTS:
        labels = replace(SILO1, camera=SMALL, feed=None, defects=defects(name, 1)).render().labels
        assert (labels > 0).mean() > 0.999
    with pytest.raises(UsageError, match="unknown defect"):
        defects("oval,rust")
