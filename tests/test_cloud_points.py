"""Clouds that are fitted as points: unbiased, as sure as they are, and told of where an option does not act."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import siloscope
from siloscope import SiloPose
from siloscope.estimation.cloud_uncertainty import displacements
from siloscope.estimation.virtual_image import camera_at_origin, image_from_origin
from siloscope.simulation import ASTRA_S, Feed
from siloscope.simulation.scenarios import random_scene

SENSOR = "orbbec-astra-s"


def cylinder(noise: float, seed: int = 0) -> NDArray[np.float64]:
    """Points of a whole cylinder of radius 1.2 m, 5 m beside the origin, with noise across, m."""
    draw = np.random.default_rng(seed)
    angle, radius = draw.uniform(0.0, 2.0 * np.pi, 60_000), draw.normal(1.2, noise, 60_000)
    return np.column_stack([5.0 + radius * np.cos(angle), radius * np.sin(angle), draw.uniform(0.5, 3.0, 60_000)])


@pytest.mark.parametrize("grid", [0.03, 0.05, 0.1])
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_tiles_of_a_cloud_have_no_chords(grid: float, noise: float) -> None:
    """Means of voxels of 0.1 m lie 0.3 mm inside a wall of 1.2 m, and noise sorts points into voxels."""
    estimate = siloscope.locate(cylinder(noise), grid=grid)
    assert estimate.ok, estimate.message
    assert estimate.silo.radius == pytest.approx(1.2, abs=1e-8 + 4.0 * noise / np.sqrt(60_000))
    assert estimate.silo_std.radius is not None
    assert estimate.silo_std.radius < 2e-5 + 4.0 * noise / np.sqrt(60_000)


def few(seed: int, count: int) -> tuple[NDArray[np.float64], SiloPose, float]:
    """So many points of a simulated frame, the pose and the radius."""
    scene = random_scene(seed, Feed("funnel", 0.2, seed=seed), sensor=ASTRA_S)
    depth = np.nan_to_num(scene.render().measured)
    points = np.dstack([scene.camera.rays() * depth[..., None], depth])[depth > 0]
    return np.random.default_rng(seed).permutation(points)[:count], scene.pose, scene.silo.radius


@pytest.mark.parametrize("seed", [1, 3, 7])
def test_few_points_say_how_little_they_know_of_their_sensor(seed: int) -> None:
    points, pose, radius = few(seed, 1_900)
    assert image_from_origin(points) is None
    assert camera_at_origin(points) is not None
    estimate = siloscope.locate(points, sensor=SENSOR)
    exact = siloscope.locate(points, sensor=SENSOR, intrinsics="exact")
    assert estimate.ok, estimate.message
    assert estimate.covariance is not None
    assert exact.covariance is not None
    assert (np.diag(estimate.covariance) > np.diag(exact.covariance) * (3.0, 3.0, 1.0, 1.0)).all()
    assert estimate.pose is not None
    off = [estimate.pose.r_x - pose.r_x, estimate.pose.r_y - pose.r_y]
    assert np.linalg.norm(off) < 3.0 * np.sqrt(np.trace(estimate.covariance[:2, :2]))
    assert estimate.silo.radius == pytest.approx(radius, abs=4.0 * (estimate.silo_std.radius or 0.0))
    unknown = siloscope.locate(points)
    assert not unknown.ok or (unknown.silo_std.radius or 0.0) > 0.005


def test_surveyed_clouds_have_no_sensor_in_their_deviation() -> None:
    surveyed = cylinder(0.003)
    assert camera_at_origin(surveyed) is None
    estimate = siloscope.locate(surveyed)
    assert estimate.ok, estimate.message
    assert estimate.config.get("rays") is None
    assert camera_at_origin(np.vstack([few(3, 5_000)[0], -few(3, 5_000)[0]])) is None, "behind the origin too"


def test_displacements_are_derivatives_of_a_measured_point() -> None:
    points = np.array([[0.3, -0.4, 2.0], [-0.5, 0.1, 3.0], [0.2, 0.2, 1.0]])
    moves, step = displacements(points), 1e-6
    x, y, z = points.T
    ratio = np.column_stack([x / z, y / z, np.ones(3)])
    assert moves[0] == pytest.approx(((ratio * (1.0 + step, 1.0, 1.0) - ratio) * z[:, None]) / step)
    radial = 1.0 + step * (ratio[:, 0] ** 2 + ratio[:, 1] ** 2)
    distorted = np.column_stack([ratio[:, 0] * radial, ratio[:, 1] * radial, np.ones(3)])
    assert moves[4] == pytest.approx((distorted - ratio) * z[:, None] / step, abs=1e-9)
    for k, bias in enumerate((np.ones(3), z, z**2)):
        assert moves[5 + k] == pytest.approx(ratio * bias[:, None])
    assert np.abs(moves[8:] / (ratio * z[:, None])).max() == pytest.approx(1.0)
