"""Bins that are not round: a given pose and the corners of an outline."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import realdata
import siloscope
from siloscope.content.outlined import within
from siloscope.errors import UsageError
from siloscope.types.content import Content
from siloscope.vessel.vessel import Vessel

SQUARE = ((-1.0, -0.6), (1.0, -0.6), (1.0, 0.6), (-1.0, 0.6))


def heap(seed: int = 0) -> np.ndarray:
    """Points of a square bin 2 m below the camera, 1 m deep, with a pyramid's heap of 0.4 m over 0.3 m of feed."""
    xy = np.random.default_rng(seed).uniform(-1.3, 1.3, (60_000, 2))
    rise = np.maximum(0.4 - 0.5 * np.hypot(xy[:, 0], xy[:, 1]), 0.0)
    return np.column_stack([xy, 2.7 - rise])


HEAP = math.pi * 0.8**2 * 0.4 / 3.0
CORNER = 0.0032
"""Of the heap beyond the outline's longer sides: two caps 0.2 m deep."""


def _vessel(tmp_path: Path, text: str = "") -> Path:
    file = tmp_path / "bin.toml"
    corners = ", ".join(f"[{x}, {y}]" for x, y in SQUARE)
    file.write_text(f"outline = [{corners}]\n{text}")
    return file


def test_a_square_bin_has_ullage_and_with_a_floor_a_volume(tmp_path: Path) -> None:
    frame, pose = siloscope.Frame(points=heap()), siloscope.SiloPose(0.0, 0.0, 0.0, 0.0)
    free = siloscope.measure(frame, vessel=_vessel(tmp_path, "top = 2.0\n"), pose=pose)
    xy = np.random.default_rng(1).uniform((-1.0, -0.6), (1.0, 0.6), (400_000, 2))
    inside = float(np.maximum(0.4 - 0.5 * np.hypot(*xy.T), 0.0).mean()) * 2.4
    assert free.volume is None
    assert free.missing == ("bottom",)
    assert free.ullage == pytest.approx(0.7 * 2.4 - inside, abs=5e-3)
    full = siloscope.measure(
        frame, vessel=_vessel(tmp_path, "top = 2.0\ncylinder = 1.0\n[bottom]\nkind = 'flat'\n"), pose=pose
    )
    assert full.volume == pytest.approx(0.3 * 2.4 + inside, abs=5e-3)
    assert full.capacity == pytest.approx(2.4, rel=1e-6)
    assert (full.volume or 0.0) + (full.ullage or 0.0) == pytest.approx(2.4)


def test_the_pose_s_deviation_is_in_the_volume_s(tmp_path: Path) -> None:
    """What a turned pose does to the ullage of a tilted surface, by measuring with it."""
    points = heap()
    points[:, 2] += 0.2 * points[:, 0]
    frame, vessel = siloscope.Frame(points=points), _vessel(tmp_path, "top = 1.5\n")

    def ullage(*pose: float, std: tuple[float, float] | None = None) -> Content:
        return siloscope.measure(frame, vessel=vessel, pose=siloscope.SiloPose(*pose), pose_std=std)

    sure, vague = ullage(0.0, 0.0, 0.0, 0.0, std=(0.0, 0.0)), ullage(0.0, 0.0, 0.0, 0.0)
    assert sure.ullage_parts is not None
    assert sure.ullage_parts.pose == 0.0
    assert sure.assumed == ()
    assert "mrad" in vague.assumed[0]
    for std, moved in (
        ((4e-3, 0.0), ((4e-3, 0, 0, 0), (0, 4e-3, 0, 0))),
        ((0.0, 0.02), ((0, 0, 0.02, 0), (0, 0, 0, 0.02))),
    ):
        change = math.hypot(*((ullage(*pose).ullage or 0.0) - (sure.ullage or 0.0) for pose in moved))
        parts = ullage(0.0, 0.0, 0.0, 0.0, std=std).ullage_parts
        assert parts is not None
        assert parts.pose == pytest.approx(change, rel=0.1, abs=3e-4)


def test_without_a_pose_there_is_nothing_to_go_by(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="pose"):
        siloscope.measure(siloscope.Frame(points=heap()), vessel=_vessel(tmp_path))
    with pytest.raises(UsageError, match="outline"):
        siloscope.measure(siloscope.Frame(points=heap()), pose=siloscope.SiloPose(0.0, 0.0, 0.0, 0.0))


def test_an_outline_elsewhere_is_refused(tmp_path: Path) -> None:
    content = siloscope.measure(
        siloscope.Frame(points=heap()), vessel=_vessel(tmp_path), pose=siloscope.SiloPose(0.0, 0.0, 50.0, 0.0)
    )
    assert content.reason == "too-little-seen"


def test_places_in_a_polygon() -> None:
    """An L: the notch is outside."""
    corners = np.array([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], float)
    places = np.array([(0.5, 0.5), (1.5, 0.5), (0.5, 1.5), (1.5, 1.5), (-0.1, 0.5)])
    assert within(places, corners).tolist() == [True, True, True, False, False]


def _of_balls(count: int) -> Content:
    """A real box with so many balls; each scan is placed by its own extent, as the box was moved in between."""
    with siloscope.open(realdata.path("ball_series_livox", f"deep_{count}_balls.pcd")) as source:
        frame = source[0]
    points = np.asarray(frame.points, float).reshape(-1, 3)
    low, high = np.percentile(points[np.isfinite(points).all(axis=1)][:, :2], (1, 99), axis=0)
    x, y = 0.5 * (low + high)
    box = Vessel(top=1.8, outline=((-0.18, -0.11), (0.18, -0.11), (0.18, 0.11), (-0.18, 0.11)))
    return siloscope.measure(frame, vessel=box, pose=siloscope.SiloPose(math.pi, 0.0, -x, y))


def test_equal_additions_of_balls_are_equal_volumes() -> None:
    """25, 50, 75 and 100 steel balls: the three differences agree within their stated deviations."""
    readings = [_of_balls(count) for count in (25, 50, 75, 100)]
    ullage = np.array([content.ullage for content in readings], float)
    std = np.array([content.ullage_std for content in readings], float)
    added, deviation = -np.diff(ullage), np.hypot(std[1:], std[:-1])
    assert (added > 2e-3).all()
    for i, j in ((0, 1), (1, 2), (0, 2)):
        assert abs(added[i] - added[j]) < math.hypot(deviation[i], deviation[j])
    assert np.ptp(added) < 0.3 * added.mean()


def test_the_crater_of_a_real_bin_has_a_volume_of_free_space() -> None:
    """6.2 m square, the surface 9 to 10 m below the sensor."""
    with siloscope.open(realdata.path("bin_content_livox", "last_overhead_concave.pcd")) as source:
        frame = source[0]
    bin_ = Vessel(top=8.0, outline=((2.0, -3.0), (7.0, -3.0), (7.0, 2.0), (2.0, 2.0)))
    content = siloscope.measure(frame, vessel=bin_, pose=siloscope.SiloPose(math.pi, 0.0, 0.0, 0.0))
    assert content.ok
    assert content.shape is not None
    assert content.shape.form == "funnel"
    assert math.degrees(content.shape.flank) == pytest.approx(23.5, abs=3.0)
    assert 0.8 * 25.0 < (content.ullage or 0.0) < 2.0 * 25.0
