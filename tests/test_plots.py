"""Pictures: every kind can be drawn, is not empty, and leaves no global state behind."""

from __future__ import annotations

import io

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from siloscope import SiloGeometry
from siloscope.reporting import plots
from siloscope.reporting.plots.directions import angles
from siloscope.reporting.plots.profile import wall_distance
from siloscope.simulation import SimulatedFrame
from siloscope.simulation.metrics import LABELS, camera_points
from siloscope.simulation.scenarios import scenario


@pytest.fixture(scope="module")
def seen() -> SimulatedFrame:
    return scenario("silo3").render()


def cloud(seen: SimulatedFrame) -> tuple[np.ndarray, np.ndarray]:
    there = seen.measured_labels > 0
    return camera_points(seen.measured, seen.camera)[there], seen.measured_labels[there]


def pixels(figure: Figure) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(plots.png(figure, dpi=60))).convert("RGB"))


def colours(figure: Figure) -> int:
    return len(np.unique(pixels(figure).reshape(-1, 3), axis=0))


def test_every_picture_shows_something(seen: SimulatedFrame) -> None:
    points, labels = cloud(seen)
    silo = seen.scene.silo.geometry
    wall = (labels == LABELS["cylinder"]) | (labels == LABELS["cone"])
    vectors = np.random.default_rng(0).normal(seen.pose.axis_direction, 0.05, (5000, 3))
    vectors /= np.linalg.norm(vectors, axis=1)[:, None]
    level, rows = np.linspace(0.9, 0.1, 9), np.random.default_rng(1).normal(0, 1e-3, (9, 4))
    rows[:2] = np.nan
    for figure in (
        plots.depth_map(seen.measured),
        plots.clouds(points, points, seen.pose, silo),
        plots.candidates(points, wall, seen.pose, silo),
        plots.directions(vectors, seen.pose.axis_direction),
        plots.profile(seen.pose.to_silo(points), wall, silo),
        plots.errors(level, rows, np.full((9, 4), 1e-3)),
        plots.ratios(level, np.full((9, 3), 1 / 3), {"one": np.abs(rows[:, 0]), "other": np.abs(rows[:, 1])}),
    ):
        assert colours(figure) > 50


def test_pictures_survive_what_was_not_seen(seen: SimulatedFrame) -> None:
    points, labels = cloud(seen)
    known = (SiloGeometry(), SiloGeometry(1.5), SiloGeometry(1.5, 1.9, None))
    for silo, few in zip(known, (points[:0], points[:1], points[:300]), strict=True):
        plots.png(plots.clouds(few, few, seen.pose, silo), dpi=30)
        plots.png(plots.profile(seen.pose.to_silo(few), labels[: len(few)] == 1, silo), dpi=30)
        plots.png(plots.candidates(few, labels[: len(few)] == 1, seen.pose, silo), dpi=30)
    plots.png(plots.depth_map(np.full((4, 5), np.nan)), dpi=30)
    plots.png(plots.directions(np.zeros((0, 3)), seen.pose.axis_direction), dpi=30)


def test_depth_runs_from_blue_to_yellow() -> None:
    near, far = (np.array(plots.depth.blue_to_yellow()(x)[:3]) for x in (0.0, 1.0))
    assert near[2] > 2 * near[0]
    assert far[0] > 2 * far[2]
    assert far[1] > 2 * far[2]
    ramp = plots.depth.blue_to_yellow()(np.linspace(0, 1, 64))[:, :3] @ [0.2126, 0.7152, 0.0722]
    assert np.all(np.diff(ramp) > 0), "lightness must rise with depth"


def test_pictures_leave_no_global_state(seen: SimulatedFrame) -> None:
    before = dict(mpl.rcParams)
    plots.png(plots.depth_map(seen.measured), dpi=30)
    assert dict(mpl.rcParams) == before


def test_wall_distance_is_zero_on_the_wall_and_metric_off_it(seen: SimulatedFrame) -> None:
    points, labels = cloud(seen)
    silo = seen.scene.silo.geometry
    placed = seen.pose.to_silo(points)
    r, z = np.hypot(placed[:, 0], placed[:, 1]), placed[:, 2]
    wall = (labels == LABELS["cylinder"]) | (labels == LABELS["cone"])
    assert np.abs(wall_distance(r[wall], z[wall], silo)).max() < 1e-9
    assert wall_distance(np.array([1.5 + 0.01]), np.array([1.0]), silo)[0] == pytest.approx(0.01)
    slant = np.arctan2(1.5, 2.6)
    on_cone = np.array([0.75]), np.array([1.9 + 1.3])
    off = on_cone[0] - 0.02 * np.cos(slant), on_cone[1] - 0.02 * np.sin(slant)
    assert wall_distance(*on_cone, silo)[0] == pytest.approx(0.0, abs=1e-12)
    assert wall_distance(*off, silo)[0] == pytest.approx(-0.02)


def test_angles_ignore_the_vectors_sign() -> None:
    axis = np.array([0.0, 0.0, 1.0])
    tilted = np.array([[np.sin(0.1), 0.0, np.cos(0.1)]])
    assert angles(np.vstack([tilted, -tilted, axis[None]]), axis) == pytest.approx([np.degrees(0.1)] * 2 + [0.0])
