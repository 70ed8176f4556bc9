"""The measures of section 2.4.4 against brute force and geometry."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from siloscope import Camera, SiloPose, UsageError, _core
from siloscope.simulation import Scene, Silo
from siloscope.simulation.metrics import (
    area_ratios,
    camera_points,
    cloud_distance,
    pc_average_distance,
    pixel_areas,
    pixel_ratios,
    transform_error,
)
from siloscope.simulation.scenarios import SILO1, SILO2, SILO3

SMALL = Camera(width=96, height=72, fx=85.5, fy=85.5, cx=47.5, cy=35.5)


def moved(pose: SiloPose, r: float, t: float) -> SiloPose:
    return SiloPose(pose.r_x + r, pose.r_y - r, pose.t_x + t, pose.t_y - t)


@pytest.mark.parametrize("shift", [0.0, 1e-4, 0.01, 0.5])
def test_nearest_distances_agree_with_scipy(shift: float) -> None:
    points = SILO3.pose.to_silo(camera_points(replace(SILO3, camera=SMALL).render().depth, SMALL).reshape(-1, 3))
    queries = points + np.array([shift, -shift / 2, shift / 3])
    expected = cKDTree(points).query(queries)[0]
    assert np.allclose(_core.nearest_distances(queries, points, 2), expected, rtol=1e-12, atol=1e-15)


def test_nearest_distances_accept_strided_and_empty_arrays_and_refuse_others() -> None:
    points = np.random.default_rng(0).normal(size=(300, 3))
    fortran, strided = np.asfortranarray(points), np.repeat(points, 2, axis=0)[::2]
    expected = _core.nearest_distances(points[:50] + 0.1, points)
    assert np.array_equal(_core.nearest_distances(fortran[:50] + 0.1, strided), expected)
    assert _core.nearest_distances(np.empty((0, 3)), points).shape == (0,)
    for bad in (np.empty((0, 3)), np.full((4, 3), np.nan), np.zeros((4, 2))):
        with pytest.raises(ValueError, match=r"reference|coordinates|shape"):
            _core.nearest_distances(points, bad)


@pytest.mark.parametrize("scene", [SILO1, SILO2, SILO3])
def test_pc_average_distance_is_equation_11(scene: Scene) -> None:
    depth = replace(scene, camera=SMALL).render().depth
    estimate = moved(scene.pose, 2e-3, 5e-3)
    points = camera_points(depth, SMALL).reshape(-1, 3)
    expected = cKDTree(scene.pose.to_silo(points)).query(estimate.to_silo(points))[0].mean()
    assert math.isclose(pc_average_distance(estimate, scene.pose, depth, SMALL), expected, rel_tol=1e-12)
    assert pc_average_distance(scene.pose, scene.pose, depth, SMALL) == 0.0
    coarse = pc_average_distance(estimate, scene.pose, depth, SMALL, stride=7)
    assert math.isclose(coarse, expected, rel_tol=0.05)
    assert coarse != expected


def test_pixels_without_depth_take_no_part() -> None:
    depth = replace(SILO1, camera=SMALL).render().depth
    estimate = moved(SILO1.pose, 1e-3, 1e-3)
    holes = depth.copy()
    holes[::2], holes[1::4, 5] = 0.0, np.nan
    points = camera_points(depth, SMALL)[np.nan_to_num(holes) > 0]
    expected = cKDTree(SILO1.pose.to_silo(points)).query(estimate.to_silo(points))[0].mean()
    assert math.isclose(pc_average_distance(estimate, SILO1.pose, holes, SMALL), expected, rel_tol=1e-12)


def test_unusable_frames_are_refused() -> None:
    pose = SILO1.pose
    for depth, cause in [(np.zeros((72, 96)), "no pixel"), (np.ones((72, 95)), "shape")]:
        with pytest.raises(UsageError, match=cause):
            pc_average_distance(pose, pose, depth, SMALL)
    with pytest.raises(UsageError, match="stride"):
        pc_average_distance(pose, pose, np.ones((72, 96)), SMALL, stride=0)


def test_clouds_that_can_t_be_compared_are_refused() -> None:
    cloud = np.random.default_rng(1).normal(size=(20, 3))
    assert cloud_distance(cloud, cloud) == 0.0
    for points, reference in [(cloud[:0], cloud), (cloud, cloud[:0]), (cloud, cloud[:, :2]), (cloud * np.nan, cloud)]:
        with pytest.raises(UsageError, match="compare"):
            cloud_distance(points, reference)


def test_a_closed_room_s_pixel_areas_sum_to_its_surface() -> None:
    """A camera with a very wide view straight down sees the whole cone and the cylinder below its image's edge."""
    silo = Silo(1.0, 2.0, 1.0)
    camera = Camera(width=1200, height=1200, fx=300.0, fy=300.0, cx=599.5, cy=599.5)
    frame = Scene(silo, SiloPose(0, 0, 0, 0), camera, None).render()
    areas = pixel_areas(frame.depth, frame.normals, camera)
    cone = math.pi * 1.0 * math.sqrt(2.0)
    assert math.isclose(areas[frame.labels == 2].sum(), cone, rel_tol=1e-3)
    x, y = np.abs(np.moveaxis(camera.rays(), -1, 0))
    ring = (np.hypot(x, y) < 1.9) & (frame.labels == 1)  # cylinder from z = 1/1.9 to 2
    assert math.isclose(areas[ring].sum(), 2 * math.pi * (2.0 - 1.0 / 1.9), rel_tol=2e-3)


def test_areas_do_not_depend_on_the_lens() -> None:
    bent = Camera(640, 480, 400.0, 400.0, 319.5, 239.5, "brown_conrady", (0.08, -0.02, 1e-3, -1e-3, 0.0))
    silo = Silo(1.0, 2.0, 1.0)
    frame = Scene(silo, SiloPose(0.0, -0.1, 0.2, 0.0), bent, None).render()
    cone = pixel_areas(frame.depth, frame.normals, bent)[frame.labels == 2].sum()
    assert math.isclose(cone, math.pi * math.sqrt(2.0), rel_tol=1e-3)


def test_ratios_count_pixels_and_weigh_areas() -> None:
    labels = np.array([[1, 1, 2], [3, 4, 0]], np.uint8)
    ratios = pixel_ratios(labels)
    assert (ratios.cylinder, ratios.cone, ratios.feed) == (0.4, 0.2, 0.2)
    assert pixel_ratios(np.zeros((2, 2), np.uint8)).to_dict() == {"cylinder": 0.0, "cone": 0.0, "feed": 0.0}
    frame = replace(SILO2, camera=SMALL).render()
    weighed = area_ratios(frame.labels, frame.depth, frame.normals, SMALL)
    areas = pixel_areas(frame.depth, frame.normals, SMALL)
    assert math.isclose(weighed.cone, areas[frame.labels == 2].sum() / areas.sum(), rel_tol=1e-12)
    assert math.isclose(weighed.cylinder + weighed.cone + weighed.feed, 1.0, rel_tol=1e-12)


def test_transform_errors_are_estimate_minus_truth() -> None:
    error = transform_error(SiloPose(0.1, 0.2, 0.3, 0.4), SiloPose(0.05, 0.3, 0.1, 0.5))
    assert np.allclose(list(error.to_dict().values()), [0.05, -0.1, 0.2, -0.1], rtol=0, atol=1e-15)
