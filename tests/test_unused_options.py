"""Options that can't act on an input are noted, and no other."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import siloscope
from siloscope import Camera, Estimate
from siloscope.simulation import ASTRA_S, Feed
from siloscope.simulation.scenarios import random_scene

CAMERA = Camera(200, 150, 178.2, 177.4, 101.3, 72.8)
SCENE = replace(random_scene(7, Feed("funnel", 0.3, seed=7), sensor=ASTRA_S), camera=CAMERA)
DEPTH = np.nan_to_num(SCENE.render().measured)
POINTS = np.dstack([CAMERA.rays() * DEPTH[..., None], DEPTH])


def unused(estimate: Estimate) -> list[str]:
    """Options that were noted as unused."""
    notes = [remark for remark in estimate.quality if remark.code == "option-unused"]
    assert {note.severity for note in notes} <= {"note"}
    return [note.seen.split(":")[0] for note in notes]


def test_the_grid_of_an_image_and_of_a_cloud_with_rays() -> None:
    assert unused(siloscope.locate(DEPTH, CAMERA)) == []
    assert unused(siloscope.locate(DEPTH, CAMERA, grid=0.05)) == ["grid"]
    assert unused(siloscope.locate(POINTS, grid=0.05)) == ["grid"]
    drawn = np.random.default_rng(0).permutation(POINTS.reshape(-1, 3))[:1_500]
    assert unused(siloscope.locate(drawn, grid=0.05)) == []


def test_a_gridded_cloud_has_its_images_answer() -> None:
    by_image, by_cloud = siloscope.locate(DEPTH, CAMERA), siloscope.locate(POINTS, grid=0.05)
    assert by_cloud.pose is not None
    assert by_image.pose is not None
    assert [by_cloud.r_x, by_cloud.t_x] == pytest.approx([by_image.r_x, by_image.t_x], abs=1e-5)


def test_a_diameter_without_a_cylinder_in_view() -> None:
    scene = replace(random_scene(4, Feed("gaussian", 0.05, seed=4), sensor=ASTRA_S), camera=CAMERA)
    depth = np.nan_to_num(scene.render().measured)
    points = scene.pose.to_silo(np.dstack([CAMERA.rays() * depth[..., None], depth]))
    cone = np.where(points[..., 2] > (scene.silo.geometry.cylinder_bottom or 0.0) + 0.05, depth, 0.0)
    known: dict[str, Any] = {"sensor": "orbbec-astra-s", "gravity": scene.pose.axis_direction}
    told = siloscope.locate(cone, CAMERA, diameter=2.0 * scene.silo.radius, **known)
    assert told.ok, told.message
    assert told.silo.radius is None
    assert unused(told) == ["diameter"]
    assert unused(siloscope.locate(cone, CAMERA, **known)) == []


def test_the_six_steps_take_a_sensor_for_their_deviations_alone() -> None:
    settings: dict[str, Any] = {
        "sensor": "orbbec-astra-s",
        "diameter": 2.0,
        "gravity": (0, 0, 1),
        "intrinsics": "exact",
        "grid": 0.05,
    }
    told = siloscope.locate(DEPTH, CAMERA, method="shape-tensor", **settings)
    assert unused(told) == ["diameter", "gravity"]
    plain = siloscope.locate(DEPTH, CAMERA, method="shape-tensor", grid=0.05)
    assert unused(plain) == []
    for option in ("sensor", "intrinsics"):
        alone = siloscope.locate(DEPTH, CAMERA, method="shape-tensor", grid=0.05, **{option: settings[option]})
        assert alone.pose == plain.pose
        assert not np.allclose(alone.covariance, plain.covariance, rtol=0.01, atol=0.0)
    drawn = np.random.default_rng(0).permutation(POINTS.reshape(-1, 3))
    cloud = siloscope.locate(drawn, method="shape-tensor", **settings)
    assert unused(cloud) == ["sensor", "diameter", "gravity", "intrinsics"]
