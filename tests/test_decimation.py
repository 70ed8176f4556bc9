"""A quarter of a frame's pixels: the same rays, the same answer, a larger deviation; and how `calibrate` uses it."""

from __future__ import annotations

import functools
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from siloscope import Calibration, Camera, Estimate, Frame, calibrate, locate
from siloscope.estimation.decimation import STEP, decimated
from siloscope.simulation import ASTRA_S, Feed, Scene, discharge
from siloscope.simulation.scenarios import scenario

PROFILE = "orbbec-astra-s"
SILO = replace(scenario("silo1"), sensor=ASTRA_S)


@functools.cache
def frame(scene: Scene) -> Frame:
    seen = scene.render(threads=2)
    return Frame(depth=np.nan_to_num(seen.measured).astype(np.float32), camera=seen.camera)


@pytest.mark.parametrize("size", [(640, 480), (641, 481)])
def test_the_thinned_camera_sees_every_second_ray(size: tuple[int, int]) -> None:
    camera = Camera(*size, 525.0, 520.0, 317.3, 241.1, "brown_conrady", (0.02, -0.01, 0.001, 0.002, 0.003))
    depth = np.random.default_rng(1).uniform(1.0, 2.0, (size[1], size[0]))
    few = decimated(Frame(depth=depth, camera=camera, depth_unit=0.5, source="here"), None)
    assert few is not None
    assert few.camera is not None
    np.testing.assert_array_equal(few.depth, depth[::STEP, ::STEP])
    np.testing.assert_allclose(few.camera.rays(), camera.rays()[::STEP, ::STEP], atol=1e-14)
    assert (few.depth_unit, few.source) == (0.5, "here")


def test_an_array_is_thinned_with_the_camera_that_is_given() -> None:
    seen = frame(SILO)
    assert seen.depth is not None
    few, same = decimated(seen.depth, seen.camera), decimated(seen, None)
    assert few is not None
    assert same is not None
    assert few.camera == same.camera
    np.testing.assert_array_equal(few.depth, same.depth)


def test_what_can_not_be_decimated() -> None:
    camera = Camera(320, 240, 260.0, 260.0, 160.0, 120.0)
    wide = replace(camera, width=640, height=480)
    assert decimated(np.ones((480, 640)), None) is None
    assert decimated(Frame(depth=np.ones((240, 320)), camera=camera), None) is None
    assert decimated(Frame(depth=np.ones((240, 320)), camera=wide), None) is None
    assert decimated(Frame(points=np.ones((9, 3))), wide) is None
    assert decimated("frame.png", wide) is None


@pytest.mark.parametrize("known", [{"sensor": PROFILE}, {"diameter": 2.5}])
def test_a_quarter_of_the_pixels_says_the_same_with_a_larger_deviation(known: dict[str, Any]) -> None:
    ratios = []
    for scene in discharge(SILO, 6, 0.4, 0.05):
        few = decimated(frame(scene), None)
        assert few is not None
        one, other = (locate(seen, intrinsics="exact", **known) for seen in (frame(scene), few))
        assert one.covariance is not None
        assert other.covariance is not None
        std = np.sqrt(np.diag(other.covariance))
        steps = np.array([getattr(one.pose, name) - getattr(other.pose, name) for name in ("r_x", "r_y", "t_x", "t_y")])
        assert (np.abs(steps) < 3.5 * std).all()
        ratios.append(std / np.sqrt(np.diag(one.covariance)))
    if "sensor" in known:
        assert 1.15 < np.median(ratios) < 2.8  # twice for the noise alone; the wall's form is as open as before


@functools.cache
def sequence() -> tuple[Frame, ...]:
    scenes = list(discharge(SILO, 12, 0.4, 0.05))
    full = replace(SILO, feed=Feed(level=1.0))
    return tuple(frame(scene) for scene in [*scenes[:8], full, *scenes[8:]])


def asked(monkeypatch: pytest.MonkeyPatch, whole: int, **settings: Any) -> tuple[Calibration, list[tuple[int, bool]]]:
    """A calibration, and each look that it took: the image's width, and whether it gave an answer."""
    looks = []

    def watched(seen: Frame, *given: Any, **named: Any) -> Estimate:
        estimate = locate(seen, *given, **named)
        looks.append((np.shape(seen.depth)[1], estimate.ok))
        return estimate

    module = sys.modules["siloscope.calibrate"]
    with monkeypatch.context() as patch:
        patch.setattr(module, "locate", watched)
        patch.setattr(sys.modules["siloscope.fusion.schedule"], "FULL_RES_FRAMES", whole)
        return calibrate(sequence(), sensor=PROFILE, **settings), looks


def test_later_frames_are_asked_for_a_quarter_of_their_pixels(monkeypatch: pytest.MonkeyPatch) -> None:
    whole, _ = asked(monkeypatch, 1000)
    found, looks = asked(monkeypatch, 5)
    refused = [(320, False), (640, False)]  # all the pixels are asked before a frame is refused
    assert looks == [(640, True)] * 5 + [(320, True)] * 3 + refused + [(320, True)] * 4
    assert [record.status for record in found.frames] == [record.status for record in whole.frames]
    assert [record.reason for record in found.frames] == [record.reason for record in whole.frames]
    assert found.covariance is not None
    assert whole.covariance is not None
    std = np.sqrt(np.diag(found.covariance))
    assert found.pose is not None
    assert whole.pose is not None
    for name, deviation in zip(("r_x", "r_y", "t_x", "t_y"), std, strict=True):
        assert abs(getattr(found.pose, name) - getattr(whole.pose, name)) < 3.0 * deviation
    assert (std > np.sqrt(np.diag(whole.covariance))).all()
    assert found.config["camera"] == whole.config["camera"]


def test_the_jobs_change_nothing_here_either(monkeypatch: pytest.MonkeyPatch) -> None:
    alone, _ = asked(monkeypatch, 5)
    found, _ = asked(monkeypatch, 5, jobs=3)
    assert [record.to_dict() for record in found.frames] == [record.to_dict() for record in alone.frames]
    np.testing.assert_array_equal(found.parameters, alone.parameters)
