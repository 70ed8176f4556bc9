"""A frame that starts from another frame's wall says what it says from nothing, and so does a whole calibration."""

from __future__ import annotations

import functools
import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import siloscope
from siloscope import Calibration, Estimate, Frame, calibrate
from siloscope.fusion.schedule import FULL_SEARCH_PERIOD
from siloscope.simulation import ASTRA_S, Defects, Feed, Scene, Silo, discharge
from siloscope.simulation.scenarios import scenario
from siloscope.types.pose import SiloPose

PROFILE = "orbbec-astra-s"
FEEDS = ("gaussian", "funnel", "funnel+tilted+lumpy+rathole")
SILO = replace(scenario("silo1"), sensor=ASTRA_S)
WALL = replace(SILO, feed=Feed(level=0.1), seed=11)


locate = functools.partial(siloscope.locate, intrinsics="exact")
"""Deviations of the intrinsics, which frames have in common, would hide differences."""


@functools.cache
def frame(scene: Scene) -> Frame:
    seen = scene.render(threads=2)
    return Frame(depth=np.nan_to_num(seen.measured).astype(np.float32), camera=seen.camera)


@functools.cache
def located(scene: Scene, sensor: str | None = PROFILE, diameter: float | None = None) -> Estimate:
    return locate(frame(scene), sensor=sensor, diameter=diameter)


def emptying(name: str, feed: str, steps: int = 7, defects: Defects | None = None) -> tuple[Scene, ...]:
    scene = replace(scenario(name), sensor=ASTRA_S, feed=Feed(feed), defects=defects or Defects())
    return tuple(discharge(scene, steps, 0.5, 0.02))


def is_searched(led: Estimate, alone: Estimate) -> bool:
    """Whether the start was of no use: then the answer is that from nothing, to the last bit."""
    return led.pose == alone.pose


def parts(estimate: Estimate) -> tuple[bool, bool]:
    assert estimate.silo is not None
    return estimate.silo.radius is None, estimate.silo.apex is None


def gap(one: Estimate, other: Estimate) -> float:
    """Largest difference of two answers in the standard deviations of the first."""
    assert one.evidence is not None
    assert other.evidence is not None
    assert one.covariance is not None
    pose = np.abs(one.evidence.state - other.evidence.state)[:4] / np.sqrt(np.diag(one.covariance))
    return float(pose.max())


@pytest.mark.parametrize("known", [{}, {"sensor": None}, {"sensor": None, "diameter": 2.5}])
@pytest.mark.parametrize("feed", FEEDS)
def test_the_start_changes_no_answer_of_a_discharge(feed: str, known: dict[str, Any]) -> None:
    scenes = emptying("silo1", feed)
    alone = [located(scene, **known) for scene in scenes]
    start = next(estimate for estimate in reversed(alone) if estimate.ok)
    led = [locate(frame(scene), **{"sensor": PROFILE, **known}, start=start) for scene in scenes]
    assert [estimate.reason for estimate in led] == [estimate.reason for estimate in alone]
    gaps = []
    for one, other in zip(alone, led, strict=True):
        if one.ok:
            assert parts(one) == parts(other)
            same = one.extra["models"][0]["model"] == other.extra["models"][0]["model"]
            ratio = np.diag(other.covariance) / np.diag(one.covariance)
            assert ratio.max() < 1.25
            assert ratio.min() > 0.8 or not same  # of a cone that is known, few tiles tell something
            gaps.append(gap(one, other))
    assert max(gaps) < 0.35
    assert np.median(gaps) < 0.1
    assert not all(map(is_searched, led, alone))


def test_a_frame_that_was_not_searched_took_the_short_way() -> None:
    scene = replace(WALL, seed=12)
    led = locate(frame(scene), sensor=PROFILE, start=located(WALL))
    assert not is_searched(led, located(scene))
    assert gap(located(scene), led) < 0.1


@pytest.mark.parametrize(("d_rx", "d_tx"), [(0.3, 0.0), (0.02, 0.0), (0.0, 0.3), (-0.1, -0.15)])
def test_a_moved_camera_is_searched_for(d_rx: float, d_tx: float) -> None:
    pose = SILO.pose
    moved = replace(WALL, pose=SiloPose(pose.r_x + d_rx, pose.r_y, pose.t_x + d_tx, pose.t_y), seed=13)
    led = locate(frame(moved), sensor=PROFILE, start=located(WALL))
    assert is_searched(led, located(moved))
    np.testing.assert_array_equal(led.covariance, located(moved).covariance)


@pytest.mark.parametrize("shift", [0.0005, 0.003])
def test_a_camera_moved_by_millimetres_is_measured_where_it_is(shift: float) -> None:
    pose = SILO.pose
    moved = replace(WALL, pose=SiloPose(pose.r_x, pose.r_y + shift / 3.0, pose.t_x + shift, pose.t_y), seed=13)
    led = locate(frame(moved), sensor=PROFILE, start=located(WALL))
    assert gap(located(moved), led) < 0.2


@pytest.mark.parametrize("name", ["brim-full", "flat-wall", "room-corner", "square-shaft", "sphere", "noise"])
def test_what_is_refused_is_refused_for_the_same_reason(name: str) -> None:
    scene = replace(scenario(name), seed=5)
    assert not located(scene).ok
    assert locate(frame(scene), sensor=PROFILE, start=located(WALL)).reason == located(scene).reason


def test_a_part_that_comes_into_view_or_goes_is_seen_so() -> None:
    steep = replace(scenario("silo1"), silo=Silo(1.25, 3.0, 1.6), sensor=ASTRA_S)  # no feed lies as steep as its cone
    high, low = (replace(steep, feed=Feed(level=level)) for level in (0.6, 0.1))
    assert parts(located(high)) != parts(located(low))
    for scene, other in ((high, low), (low, high)):
        led = locate(frame(scene), sensor=PROFILE, start=located(other))
        assert parts(led) == parts(located(scene))
        assert gap(located(scene), led) < 0.2


def test_an_oval_wall_stays_oval() -> None:
    oval = replace(WALL, defects=Defects(ovality=0.01))
    again = replace(oval, seed=21)
    for start in (located(oval), located(WALL)):
        led = locate(frame(again), sensor=PROFILE, start=start)
        assert gap(located(again), led) < 0.1
        assert led.extra["fit"]["ovality"] == pytest.approx(located(again).extra["fit"]["ovality"], rel=0.05)


def test_a_rough_wall_is_the_same_where_the_depths_bend_is_not_known() -> None:
    rough = replace(WALL, defects=Defects(ovality=0.008, upright_seams=8, dents=5, bolts=20, seam_spacing=1.2))
    first, again = located(rough, sensor=None), located(replace(rough, seed=22), sensor=None)
    led = locate(frame(replace(rough, seed=22)), start=first)
    assert gap(again, led) < 0.35


def test_a_start_that_tells_no_wall_is_no_start() -> None:
    refused = located(replace(scenario("flat-wall"), seed=5))
    for start in (refused, replace(located(WALL), details=None)):
        led = locate(frame(WALL), sensor=PROFILE, start=start)
        assert is_searched(led, located(WALL))


def ruined(scene: Scene) -> Frame:
    """A lid before the camera."""
    seen = frame(scene)
    assert seen.depth is not None
    return replace(seen, depth=np.full_like(seen.depth, 0.7))


@functools.cache
def sequence() -> tuple[Frame, ...]:
    """A discharge with lids in between, and a camera that moves in the middle of it."""
    pose = SILO.pose
    moved = replace(SILO, pose=SiloPose(pose.r_x + 0.02, pose.r_y, pose.t_x + 0.03, pose.t_y), seed=77)
    scenes = [*discharge(SILO, 20, 0.45, 0.25), *discharge(moved, 28, 0.25, 0.02)]
    frames = [frame(scene) for scene in scenes]
    for number in (0, 5, 32, 33):
        frames[number] = ruined(scenes[number])
    return tuple(frames)


def fused(frames: Sequence[Frame | Estimate], jobs: int = 1) -> Calibration:
    return calibrate(frames, sensor=PROFILE, jobs=jobs, intrinsics="exact")


def test_the_jobs_change_nothing() -> None:
    alone = fused(sequence())
    for jobs in (2, 7):
        found = fused(sequence(), jobs)
        assert [record.to_dict() for record in found.frames] == [record.to_dict() for record in alone.frames]
        np.testing.assert_array_equal(found.parameters, alone.parameters)
        np.testing.assert_array_equal(found.covariance, alone.covariance)


def test_a_calibration_says_what_its_frames_say_from_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        sys.modules["siloscope.fusion.schedule"], "FULL_RES_FRAMES", len(sequence())
    )  # a quarter says less
    distinct = {frame.digest: frame for frame in sequence()}.values()  # a frame given twice counts once
    each = [locate(frame, sensor=PROFILE) for frame in distinct]
    alone, found = calibrate(each, intrinsics="exact"), fused(sequence())
    assert [record.status for record in found.frames] == [record.status for record in alone.frames]
    assert [move.index for move in found.moves] == [move.index for move in alone.moves] == [19]
    assert found.parameters is not None
    assert found.parameter_covariance is not None
    assert alone.parameter_covariance is not None
    seen = np.diag(alone.parameter_covariance) > 0.0
    std = np.sqrt(np.diag(alone.parameter_covariance))
    assert (np.abs(found.parameters - alone.parameters)[seen] < 0.1 * std[seen]).all()
    np.testing.assert_allclose(np.diag(found.parameter_covariance), std**2, rtol=0.05)


def test_most_frames_are_not_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    searched: list[bool] = []

    def watched(*given: Any, **named: Any) -> Estimate:
        estimate = locate(*given, **named)
        searched.append(is_searched(estimate, locate(*given, **{**named, "start": None})))
        return estimate

    calibrating = sys.modules["siloscope.calibrate"]
    monkeypatch.setattr(calibrating, "locate", watched)
    runs = 2
    fused([frame(scene) for scene in discharge(SILO, runs * FULL_SEARCH_PERIOD, 0.2, 0.1)])
    assert searched.count(True) == runs
