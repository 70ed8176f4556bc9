"""Clouds: turned to the optical frame, and taken as the depth images that they were or could have been."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import siloscope
from siloscope import Camera, Estimate, Frame, UsageError
from siloscope.cli import main
from siloscope.estimation.pixel_lattice import image_of
from siloscope.estimation.virtual_image import image_from_origin
from siloscope.io.orientation import OPTICAL_AXES, checked_axes, found_turn, optical
from siloscope.io.writers import write_ply
from siloscope.simulation import ASTRA_S, Feed
from siloscope.simulation.scenarios import random_scene

CAMERA = Camera(200, 150, 178.2, 177.4, 101.3, 72.8)
SCENE = replace(random_scene(7, Feed("funnel", 0.3, seed=7), sensor=ASTRA_S), camera=CAMERA)
DEPTH = np.nan_to_num(SCENE.render().measured)
POINTS: NDArray[np.float64] = np.dstack([CAMERA.rays() * DEPTH[..., None], DEPTH])
ROLL = 0.3
"""A turn about the optical axis, after which no rays are those of a camera's pixels."""
ROLLED = np.array([[np.cos(ROLL), -np.sin(ROLL), 0.0], [np.sin(ROLL), np.cos(ROLL), 0.0], [0.0, 0.0, 1.0]])
SENSOR = "orbbec-astra-s"


def numbers(estimate: Estimate) -> list[float | None]:
    """What two ways to the same answer must agree on."""
    assert estimate.ok, estimate.message
    return [estimate.r_x, estimate.r_y, estimate.t_x, estimate.t_y, estimate.silo.radius]


def test_points_of_pixels_give_back_their_image() -> None:
    shuffled = np.random.default_rng(3).permutation(POINTS[DEPTH > 0].astype(np.float32).astype(np.float64))
    found = image_of(shuffled)
    assert found is not None
    depth, camera = found
    assert (camera.fx, camera.fy) == pytest.approx((CAMERA.fx, CAMERA.fy), rel=1e-6)
    assert np.sort(depth[depth > 0]) == pytest.approx(np.sort(DEPTH[DEPTH > 0]), rel=1e-6)
    assert image_of(shuffled @ ROLLED.T) is None


@pytest.mark.parametrize("kind", ["organised", "every second", "shuffled", "float32"])
def test_a_camera_s_cloud_gives_its_image_s_answer(kind: str) -> None:
    cloud = {
        "organised": POINTS,
        "every second": POINTS.reshape(-1, 3)[np.random.default_rng(0).random(POINTS[..., 0].size) < 0.9],
        "shuffled": np.random.default_rng(1).permutation(POINTS.reshape(-1, 3)),
        "float32": POINTS.astype(np.float32),
    }[kind]
    image = siloscope.locate(DEPTH, CAMERA, sensor=SENSOR)
    close = 1e-5 if kind != "every second" else 3e-3
    assert numbers(siloscope.locate(cloud, sensor=SENSOR)) == pytest.approx(numbers(image), abs=close)


@pytest.mark.parametrize("seed", [1, 3, 7])
def test_a_cloud_of_no_camera_is_unbiased_and_its_deviation_is_not_of_its_points(seed: int) -> None:
    scene = random_scene(seed, Feed("funnel", 0.3, seed=seed), sensor=ASTRA_S)
    depth = np.nan_to_num(scene.render().measured)
    points = np.dstack([scene.camera.rays() * depth[..., None], depth])[depth > 0] @ ROLLED.T
    draw, std = np.random.default_rng(seed), []
    for count in (40_000, 100_000):
        estimate = siloscope.locate(draw.choice(points, count, replace=False), sensor=SENSOR)
        assert estimate.ok, estimate.message
        assert estimate.pose is not None
        assert estimate.covariance is not None
        std.append(np.sqrt(np.diag(estimate.covariance))[:2])
        off = np.linalg.norm(estimate.pose.axis_direction - ROLLED @ scene.pose.axis_direction)
        assert off < 3.0 * np.linalg.norm(std[-1])
        assert off < 0.003
        assert estimate.silo.radius == pytest.approx(scene.silo.radius, abs=0.004)
    assert std[0] == pytest.approx(std[1], rel=0.2)


def test_a_virtual_image_keeps_a_plane_exact_and_leaves_edges_out() -> None:
    draw = np.random.default_rng(5)
    rays = np.column_stack([draw.uniform(-0.6, 0.6, (30_000, 2)), np.ones(30_000)])
    near = rays[:, 0] < 0.0
    depth = np.where(near, 2.0, 4.0) / (rays @ np.array([0.2, -0.1, 1.0]))
    found = image_from_origin(rays * depth[:, None])
    assert found is not None
    image, camera = found
    seen = image > 0
    rays_of = np.dstack([camera.rays(), np.ones_like(image)]) @ np.array([0.2, -0.1, 1.0])
    error = np.abs(image * rays_of - np.where(camera.rays()[..., 0] < 0.0, 2.0, 4.0))[seen]
    assert np.mean(seen) > 0.7
    assert error.max() < 1e-5


def test_clouds_from_several_places_stay_clouds() -> None:
    draw = np.random.default_rng(2)
    shell = draw.normal(size=(40_000, 3))
    shell = shell / np.linalg.norm(shell, axis=1)[:, None] + (0.0, 0.0, 4.0)
    assert image_from_origin(shell) is None
    assert image_from_origin(draw.normal(size=(40_000, 3))) is None


@pytest.mark.parametrize("ahead", list(OPTICAL_AXES))
def test_clouds_are_turned_by_where_their_points_lie(ahead: str) -> None:
    turn = checked_axes(",".join(OPTICAL_AXES[ahead]), None)
    assert turn is not None
    written = POINTS[DEPTH > 0] @ turn.rotation  # p_file = rotationᵀ p_optical
    assert found_turn(written) == replace(turn, given=False)
    there = siloscope.locate(written, sensor=SENSOR)
    assert numbers(there) == pytest.approx(numbers(siloscope.locate(POINTS[DEPTH > 0], sensor=SENSOR)), abs=1e-9)
    assert there.config["axes"] == ",".join(OPTICAL_AXES[ahead])
    assert [remark.code for remark in there.quality] == ([] if ahead == "z" else ["axes-found"])
    down = turn.rotation.T @ SCENE.pose.axis_direction
    assert siloscope.locate(written, sensor=SENSOR, gravity=down).ok, "gravity is in the file's frame"


def test_points_all_round_are_turned_by_gravity_or_warned_of() -> None:
    points = np.random.default_rng(0).normal(size=(500, 3))
    assert found_turn(points).axes == OPTICAL_AXES["z"]
    assert found_turn(points, np.array([0.5, 0.2, -9.7])).axes == OPTICAL_AXES["-z"]
    turned = optical(Frame(points=points, gravity=np.array([0.5, 0.2, -9.7])))
    assert turned.gravity == pytest.approx([0.5, -0.2, 9.7])
    assert optical(turned) is turned


def test_an_answer_whose_z_points_away_from_what_is_seen_is_warned_of() -> None:
    outside = POINTS[DEPTH > 0] * (1.0, -1.0, -1.0)
    frame = optical(Frame(points=outside), checked_axes("x,y,z", None))
    estimate = siloscope.locate(frame, grid=0.04)
    assert estimate.ok, estimate.message
    assert "upside-down" in [remark.code for remark in estimate.quality]


@pytest.mark.parametrize(
    ("axes", "up", "why"),
    [("x,y", None, "right, down and forward"), ("x,-y,z", None, "right-handed"), (None, "w", "no axis"),
     ("x,y,z", "z", "one of them"), ("a,b,c", None, "right, down and forward")],
)  # fmt: skip
def test_axes_that_are_none_are_refused(axes: str | None, up: str | None, why: str) -> None:
    with pytest.raises(UsageError, match=why):
        checked_axes(axes, up)


def test_the_left_handed_coordinates_of_an_oak_have_a_name() -> None:
    written = POINTS[DEPTH > 0] * (1.0, -1.0, 1.0)
    there = siloscope.locate(optical(Frame(points=written), checked_axes("oak", None)), sensor=SENSOR)
    assert numbers(there) == pytest.approx(numbers(siloscope.locate(POINTS[DEPTH > 0], sensor=SENSOR)), abs=1e-9)


def test_up_is_the_axis_against_which_z_points() -> None:
    for up, down in (("z", "-z"), ("-z", "z"), ("y", "-y"), ("-x", "x")):
        turn = checked_axes(None, up)
        assert turn is not None
        assert turn.axes == OPTICAL_AXES[down]
        assert np.linalg.det(turn.rotation) == pytest.approx(1.0)


def test_the_command_line_turns_clouds_and_refuses_axes_of_images(tmp_path: Path) -> None:
    write_ply(tmp_path / "viewer.ply", (POINTS[DEPTH > 0] * (1.0, -1.0, -1.0)).astype(np.float32))
    call = ["locate", str(tmp_path / "viewer.ply"), "--sensor", SENSOR]
    assert main(call) == 0
    assert main([*call, "--axes", "x,-y,-z"]) == 0
    assert main([*call, "--up", "y", "--axes", "x,-y,-z"]) == 2
    np.save(tmp_path / "depth.npy", DEPTH)
    assert main(["locate", str(tmp_path / "depth.npy"), "--sensor", SENSOR, "--up", "z"]) == 2
