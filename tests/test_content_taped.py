"""A diameter that measuring is told, beside a calibration that was told none."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest

import siloscope
import vessels
from oracle.feed import Feed
from siloscope.content.taped import taped

SEEDS = (3, 5, 8)
FAR = 1.03
"""Depths that are 3 % too long: one and a half deviations of a scale that nobody knows."""


@functools.cache
def empty(seed: int) -> vessels.Seen:
    """A flat bin."""
    return vessels.Seen.draw("flat_empty", seed).with_feed(None)


def stretched(frame: siloscope.Frame) -> siloscope.Frame:
    return replace(frame, depth=np.asarray(frame.depth, np.float32) * np.float32(FAR))


def seen_at(seed: int, level: float) -> vessels.Seen:
    low = empty(seed).vessel.bottom.lowest
    return empty(seed).with_feed(Feed(low - level * (low - 0.9)))


@functools.cache
def calibration(seed: int, diameter: float | None = None) -> siloscope.Calibration:
    """Of four frames by a sensor that nobody knows."""
    frames = [stretched(seen_at(seed, level).again(int(100 * level)).frame) for level in (0.6, 0.4, 0.2, 0.1)]
    return siloscope.calibrate(frames, intrinsics="exact", diameter=diameter)


def diameter(seed: int) -> float:
    return 2.0 * empty(seed).vessel.wall.radius


@pytest.mark.parametrize("seed", SEEDS)
def test_a_told_diameter_puts_the_free_space_right(seed: int) -> None:
    seen, top = seen_at(seed, 0.3), empty(seed).top
    frame = stretched(seen.again(7).frame)
    without = siloscope.measure(frame, calibration(seed), top=top)
    told = siloscope.measure(frame, calibration(seed), top=top, diameter=diameter(seed))
    assert without.ullage is not None
    assert without.ullage_std is not None
    assert told.ullage is not None
    assert told.ullage_std is not None
    assert abs(without.ullage / seen.ullage - 1.0) > 0.03
    assert without.ullage_std / without.ullage == pytest.approx(0.06, rel=0.4)  # the cube of a scale known to 2 %
    assert abs(without.ullage - seen.ullage) < 2.0 * without.ullage_std
    assert abs(told.ullage / seen.ullage - 1.0) < 0.01
    assert told.ullage_std < 0.3 * without.ullage_std
    assert abs(told.ullage - seen.ullage) < 2.0 * told.ullage_std


@pytest.mark.parametrize("seed", SEEDS)
def test_it_is_as_if_the_calibration_had_been_told(seed: int) -> None:
    late, early = taped(calibration(seed), diameter(seed)), calibration(seed, diameter(seed))
    assert late.parameters is not None
    assert early.parameters is not None
    assert late.parameter_covariance is not None
    std = np.sqrt(np.diag(late.parameter_covariance))
    assert late.parameter_covariance[8, 8] < 0.9 * 0.02**2
    told = [0, 1, 2, 3, 4, 8]  # pose, radius, scale
    assert (np.abs(late.parameters - early.parameters)[told] < 1.0 * std[told] + 1e-4).all()


def test_what_it_tells_is_weighed_and_told_once() -> None:
    silo = calibration(3)
    assert taped(silo, None) is silo
    assert taped(silo, 1.5 * diameter(3)) is silo  # another vessel
    twice = replace(silo, config={**silo.config, "diameter": diameter(3)})
    assert taped(twice, diameter(3)) is twice
    once = taped(silo, diameter(3))
    assert once.silo_std.radius is not None
    assert once.silo_std.radius == pytest.approx(0.005, rel=0.1)  # the datasheet's own 10 mm of diameter
    assert once.silo.radius == pytest.approx(0.5 * diameter(3), abs=0.005)
    assert once.parameters is not None
    assert silo.parameters is not None
    lengths = once.parameters[4] * (1.0 + once.parameters[8])  # what the sensor reads stays
    assert lengths == pytest.approx(silo.parameters[4] * (1.0 + silo.parameters[8]), rel=2e-3)
