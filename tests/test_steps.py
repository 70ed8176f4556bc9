"""The six steps, one by one: against the slow oracle, and by the laws that hold for any silo."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import reference
from siloscope import InputError, SiloPose, UsageError
from siloscope.estimation import steps
from siloscope.simulation.scenarios import scenario

SCENE = scenario("silo-r1")
CAMERA = replace(SCENE.camera, width=160, height=120, fx=142.6, fy=142.6, cx=79.5, cy=59.5)
DEPTH = replace(SCENE, camera=CAMERA).render().depth
"""A silo of Table 2 at a quarter of the resolution: voxels of 0.1 m hold about as many pixels as in a full frame."""

POINTS = steps.back_project(DEPTH, CAMERA)
CLOUD = steps.voxel_grid(POINTS, 0.1)
NEAR = steps.nearest_neighbours(CLOUD, 30)
NORMALS = steps.normals(CLOUD, NEAR)
TENSORS = steps.shape_tensors(CLOUD, NEAR, NORMALS)
CANDIDATES = steps.select_candidates(CLOUD, NEAR, TENSORS)


def up_to_sign(a: Any, b: Any) -> Any:
    """Largest difference of directions (N, 3), whose sign is free."""
    return np.abs(a - b * np.sign((a * b).sum(axis=1, keepdims=True))).max()


def test_back_projection_is_that_of_equations_1_and_2() -> None:
    expected = reference.back_project(DEPTH, CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy)
    assert np.allclose(POINTS, expected, rtol=0, atol=1e-12)
    raw = np.round(DEPTH / 1e-4).astype(np.uint16)
    assert np.allclose(steps.back_project(raw, CAMERA, 1e-4), expected, rtol=0, atol=1e-4)


def test_the_grid_keeps_the_mean_of_every_voxel() -> None:
    assert np.allclose(CLOUD, reference.voxel_grid(POINTS, 0.1), rtol=0, atol=1e-9)


def test_neighbours_are_the_nearest() -> None:
    expected = reference.nearest_neighbours(CLOUD, 30)
    found, nearest = (np.linalg.norm(CLOUD[index] - CLOUD[:, None], axis=2) for index in (NEAR, expected))
    assert np.allclose(found, nearest, rtol=0, atol=1e-12)


def test_normals_are_the_oracles() -> None:
    expected = reference.normals(CLOUD, NEAR)
    assert np.allclose(NORMALS, expected, rtol=0, atol=1e-9)
    assert ((NORMALS * CLOUD).sum(axis=1) <= 0).all()


def test_shape_tensors_are_the_oracles() -> None:
    expected = reference.shape_tensors(CLOUD, NEAR, NORMALS)
    assert np.allclose(TENSORS.k1, expected.k1, rtol=0, atol=1e-8)
    assert np.allclose(TENSORS.k2, expected.k2, rtol=0, atol=1e-8)
    apart = expected.k1 - expected.k2 > 1e-3  # equal curvatures have no directions
    assert up_to_sign(TENSORS.E1[apart], expected.E1[apart]) < 1e-5
    assert up_to_sign(TENSORS.E2[apart], expected.E2[apart]) < 1e-5


@pytest.mark.parametrize("view", steps.VIEWS)
def test_candidates_are_the_oracles(view: str) -> None:
    found = steps.select_candidates(CLOUD, NEAR, TENSORS, view=view)
    index, E1 = reference.select_candidates(CLOUD, NEAR, TENSORS, view=view)
    assert np.array_equal(found.index, index)
    assert np.array_equal(found.E1, E1)


def test_the_direction_is_that_of_all_pairs() -> None:
    E1 = CANDIDATES.E1[:300]
    assert np.allclose(steps.axis_direction(E1), reference.axis_direction(E1), rtol=0, atol=1e-10)


@pytest.mark.parametrize("agreement", [2.0, 3.0, np.inf])
def test_the_candidates_that_agree_are_the_oracles(agreement: float) -> None:
    axis = steps.consistent_direction(CANDIDATES.E1, agreement)
    X, agreeing = reference.consistent_direction(CANDIDATES.E1, agreement)
    assert np.allclose(axis.X, X, rtol=0, atol=1e-10)
    assert np.array_equal(axis.agreeing, agreeing)


def test_axis_points_are_the_oracles() -> None:
    axis = steps.consistent_direction(CANDIDATES.E1)
    walls = CANDIDATES.index[axis.agreeing]
    found = steps.axis_points(CLOUD[walls], NORMALS[walls], axis.X, partners=7)
    expected = reference.axis_points(CLOUD[walls], NORMALS[walls], axis.X, partners=7)
    assert found.shape == expected.shape == (7 * len(walls), 3)
    order = [np.lexsort(np.round(points.T, 6)) for points in (found, expected)]
    assert np.allclose(found[order[0]], expected[order[1]], rtol=0, atol=1e-6)
    a = steps.axis_point(found, axis.X)
    assert np.allclose(a, reference.axis_point(expected, axis.X), rtol=0, atol=1e-9)
    assert abs(a @ axis.X) < 1e-12


def test_all_steps_together_are_the_oracles() -> None:
    found = steps.run(POINTS, grid=0.1)
    expected = reference.locate(POINTS, grid=0.1)
    assert np.allclose(found.pose.T_silo_camera, expected, rtol=0, atol=1e-7)
    assert np.allclose(found.pose.to_silo(found.axis_point), 0, atol=1e-12)
    truth = SCENE.pose.T_silo_camera
    assert np.abs(found.pose.T_silo_camera - truth).max() < 0.01


def test_estimated_vectors_scatter_about_the_axis() -> None:
    axis = steps.consistent_direction(CANDIDATES.E1)
    vectors = steps.estimated_vectors(CANDIDATES.E1[axis.agreeing], 500, seed=1)
    assert np.allclose(np.linalg.norm(vectors, axis=1), 1)
    assert np.median(np.abs(vectors @ axis.X)) > 0.999
    assert steps.estimated_vectors(np.empty((0, 3))).shape == (0, 3)


# What must hold on exact surfaces, to the accuracy of the discretisation.


def wall(radius_at: Any, n_turn: int = 60, n_along: int = 40) -> tuple[Any, Any]:
    """A piece of wall about the z-axis (arc 2 rad, 2 m high) with its exact normals: a lattice, moved a little."""
    rng = np.random.default_rng(7)
    azimuth = np.linspace(-1, 1, n_turn) + rng.uniform(-0.2, 0.2, (n_along, n_turn)) * 2 / n_turn
    z = np.linspace(2, 4, n_along)[:, None] + rng.uniform(-0.2, 0.2, (n_along, n_turn)) * 2 / n_along
    rho = radius_at(z)
    return np.dstack([rho * np.cos(azimuth), rho * np.sin(azimuth), z]).reshape(-1, 3), azimuth.reshape(-1)


@pytest.mark.parametrize("slope", [0.0, 0.7])
def test_cylinder_and_cone_have_the_curvatures_of_properties_1_and_5(slope: float) -> None:
    points, azimuth = wall(lambda z: 1.2 + slope * (5.0 - z))
    near = steps.nearest_neighbours(points, 30)
    normals = steps.normals(points, near)
    tensors = steps.shape_tensors(points, near, normals)
    inner = (np.abs(azimuth) < 0.8) & (np.abs(points[:, 2] - 3.0) < 0.75)
    rho, alpha = np.hypot(points[:, 0], points[:, 1]), np.arctan(slope)
    circle = (np.cos(alpha) / rho)[inner]
    # The camera at the origin is inside: k1 is the circle's. Hoppe's normals are rough by some percent of it.
    assert np.abs(tensors.k1[inner] / circle - 1).max() < 0.12
    assert np.median(np.abs(tensors.k1[inner] / circle - 1)) < 0.02
    assert np.abs(tensors.k2[inner] / circle).max() < 0.12
    assert np.median(np.abs(tensors.k2[inner] / circle)) < 0.02
    radial = points[inner, :2] / rho[inner, None]
    generatrix = np.column_stack([-np.sin(alpha) * radial, np.full(inner.sum(), np.cos(alpha))])
    angle = np.arccos(np.minimum(np.abs((tensors.E2[inner] * generatrix).sum(axis=1)), 1))
    assert np.median(angle) < 0.015
    assert angle.max() < 0.1


def test_exact_normals_give_exact_curvatures_on_a_cylinder() -> None:
    points, azimuth = wall(lambda z: np.full_like(z, 1.5))
    near = steps.nearest_neighbours(points, 20)
    normals = np.column_stack([-np.cos(azimuth), -np.sin(azimuth), np.zeros_like(azimuth)])
    tensors = steps.shape_tensors(points, near, normals)
    inner = (np.abs(azimuth) < 0.8) & (np.abs(points[:, 2] - 3.0) < 0.75)
    # The next term of the circle, h²/(8R²)·x⁴, is all that is left of the error: 0.2 % of k1.
    assert np.abs(tensors.k1[inner] * 1.5 - 1).max() < 3e-3
    assert np.abs(tensors.k2[inner]).max() < 1e-3
    assert np.abs(tensors.E2[inner, 2]).min() > 1 - 1e-6


def test_seen_from_outside_the_other_curvature_is_the_bent_one() -> None:
    points = wall(lambda z: np.full_like(z, 1.5))[0] + np.array([-6.0, 0.0, 0.0])  # the camera looks at the convex side
    near = steps.nearest_neighbours(points, 30)
    tensors = steps.shape_tensors(points, near, steps.normals(points, near))
    assert np.median(tensors.k1) == pytest.approx(0.0, abs=0.01)
    assert np.median(tensors.k2) == pytest.approx(-1 / 1.5, abs=0.02)
    assert len(steps.select_candidates(points, near, tensors, view="inside").index) < 20
    outside = steps.select_candidates(points, near, tensors, view="outside")
    assert np.allclose(steps.consistent_direction(outside.E1).X, [0, 0, 1], rtol=0, atol=5e-3)


# Laws.


def pose_of(points: Any, **settings_: Any) -> SiloPose:
    return steps.run(points, **{"grid": 0.1, **settings_}).pose


POSE = pose_of(POINTS)


@pytest.mark.parametrize("mirror", [(-1, 1, 1), (1, -1, 1), (-1, -1, 1)])
def test_mirroring_the_frame_mirrors_the_answer(mirror: tuple[int, int, int]) -> None:
    mirrored = pose_of(POINTS * mirror)
    assert np.allclose(mirrored.axis_direction, POSE.axis_direction * mirror, rtol=0, atol=1e-9)
    assert np.allclose(mirrored.axis_point, POSE.axis_point * mirror, rtol=0, atol=1e-9)


def test_a_quarter_turn_of_the_frame_turns_the_answer() -> None:
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turned = pose_of(POINTS @ quarter.T)
    assert np.allclose(turned.axis_direction, quarter @ POSE.axis_direction, rtol=0, atol=1e-9)
    # Medians of x and y depend on what x and y are where r_x and r_y don't commute.
    assert np.allclose(turned.axis_point, quarter @ POSE.axis_point, rtol=0, atol=1e-4)


def test_any_turn_of_the_frame_turns_the_answer_up_to_the_grid() -> None:
    turn = SiloPose(0.1, -0.07, 0.0, 0.0).T_silo_camera[:3, :3]
    turned = pose_of(POINTS @ turn.T)
    assert np.allclose(turned.axis_direction, turn @ POSE.axis_direction, rtol=0, atol=4e-3)
    among_walls = [pose.axis_point + 2.5 * pose.axis_direction for pose in (turned, POSE)]
    assert np.allclose(among_walls[0], turn @ among_walls[1], rtol=0, atol=5e-3)


@pytest.mark.parametrize("scale", [0.01, 0.25, 8.0])
def test_scaling_the_frame_scales_the_answer(scale: float) -> None:
    scaled = pose_of(POINTS * scale, grid=0.1 * scale)
    assert np.allclose(scaled.axis_direction, POSE.axis_direction, rtol=0, atol=1e-7)
    assert np.allclose(scaled.axis_point, POSE.axis_point * scale, rtol=0, atol=1e-7 * scale)


def test_the_points_order_does_not_matter() -> None:
    shuffled = pose_of(np.random.default_rng(3).permutation(POINTS))
    assert shuffled == POSE


@pytest.mark.parametrize("threads", [2, 3])
def test_the_number_of_threads_does_not_matter(threads: int) -> None:
    assert pose_of(POINTS, threads=threads) == POSE


@settings(max_examples=40, deadline=None)
@given(hnp.arrays(float, (12, 3), elements=st.floats(-1, 1)))
def test_no_pair_is_needed_for_the_scatter_of_all_pairs(E1: Any) -> None:
    S = E1.T @ E1
    products = np.cross(E1[:, None], E1[None]).reshape(-1, 3)
    adjugate = np.array(
        [[np.linalg.det(np.delete(np.delete(S, i, 0), j, 1)) * (-1) ** (i + j) for i in range(3)] for j in range(3)]
    )
    assert np.allclose(products.T @ products, 2 * adjugate, rtol=0, atol=1e-9)


# Disasters.

BAD: dict[str, tuple[Any, type[Exception], str]] = {
    "points of another shape": (lambda: steps.voxel_grid(np.ones((4, 2))), InputError, "shape"),
    "points of words": (lambda: steps.voxel_grid([["a", "b", "c"]]), InputError, "numbers"),
    "no grid": (lambda: steps.voxel_grid(POINTS, 0.0), UsageError, "grid"),
    "NaN points": (lambda: steps.nearest_neighbours(np.full((40, 3), np.nan)), InputError, "finite"),
    "two neighbours": (lambda: steps.nearest_neighbours(CLOUD, 2), UsageError, "neighbours"),
    "no neighbours": (lambda: steps.normals(CLOUD, NEAR[:-1]), UsageError, "neighbours"),
    "neighbours beyond": (lambda: steps.normals(CLOUD[:40], np.full((40, 6), 40)), UsageError, "neighbours"),
    "negative neighbours": (lambda: steps.normals(CLOUD[:40], np.full((40, 6), -1)), InputError, "neighbours"),
    "other normals": (lambda: steps.shape_tensors(CLOUD, NEAR, NORMALS[:3]), UsageError, "normals"),
    "no share": (lambda: steps.select_candidates(CLOUD, NEAR, TENSORS, 0.0), UsageError, "share"),
    "unknown view": (lambda: steps.select_candidates(CLOUD, NEAR, TENSORS, view="below"), UsageError, "view"),
    "no agreement": (lambda: steps.consistent_direction(CANDIDATES.E1, 0.0), UsageError, "agreement"),
    "no direction": (lambda: steps.axis_points(CLOUD, NORMALS, (0, 0, 0)), InputError, "zero"),
    "no partners": (lambda: steps.axis_points(CLOUD, NORMALS, (0, 0, 1), 0), UsageError, "partners"),
    "no axis points": (lambda: steps.axis_point(np.empty((0, 3)), (0, 0, 1)), InputError, "no estimated"),
    "too few points": (lambda: steps.run(POINTS[:20]), InputError, "finer grid"),
    "depth of objects": (lambda: steps.back_project(np.array([[None]]), CAMERA), InputError, "object"),
    "depth of another size": (lambda: steps.back_project(DEPTH[1:], CAMERA), UsageError, "depth"),
    "raw depth without unit": (lambda: steps.back_project(DEPTH.astype(np.uint16), CAMERA), InputError, "depth_unit"),
    "mask of another size": (lambda: steps.back_project(DEPTH, CAMERA, mask=[[True]]), UsageError, "mask"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_refused_by_name(name: str) -> None:
    call, error, word = BAD[name]
    with pytest.raises(error, match=word):
        call()


hostile = hnp.arrays(
    st.sampled_from([np.float32, np.float64]),
    st.tuples(st.integers(0, 40), st.just(3)),
    elements=st.floats(width=32, allow_nan=True, allow_infinity=True),
)


@settings(max_examples=80, deadline=None)
@given(hostile)
def test_hostile_points_never_crash(points: Any) -> None:
    cloud = steps.voxel_grid(points, 0.5)
    assert np.isfinite(cloud).all()
    near = steps.nearest_neighbours(cloud, 6)
    assert near.shape == (len(cloud), min(6, max(len(cloud) - 1, 0)))
    normals = steps.normals(cloud, near)
    tensors = steps.shape_tensors(cloud, near, normals)
    candidates = steps.select_candidates(cloud, near, tensors)
    assert np.isfinite(candidates.E1).all()
    axis = steps.consistent_direction(candidates.E1)
    assert np.isfinite(axis.X).all()


@pytest.mark.parametrize("layout", ["strided", "Fortran", "big-endian", "float32", "empty"])
def test_every_layout_of_an_array_is_taken(layout: str) -> None:
    forms = {
        "strided": np.repeat(POINTS, 2, axis=0)[::2],
        "Fortran": np.asfortranarray(POINTS),
        "big-endian": POINTS.astype(">f8"),
        "float32": POINTS.astype(np.float32),
        "empty": POINTS[:0],
    }
    cloud = steps.voxel_grid(forms[layout], 0.1)
    assert len(cloud) == (0 if layout == "empty" else pytest.approx(len(CLOUD), abs=3))
