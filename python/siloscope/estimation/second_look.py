"""What a refused frame would show if one of its inputs were not as told."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from siloscope.estimation.input_checks import CONTRADICTION
from siloscope.estimation.inputs import Prepared, PreparedDepth
from siloscope.estimation.methods import priors_of
from siloscope.estimation.prior_checks import diameter_off, gravity_off, prior_remarks, way_remarks
from siloscope.estimation.settings import Settings
from siloscope.io.camera_sizes import scaled
from siloscope.sensors import SensorProfile
from siloscope.types.camera import Camera
from siloscope.types.estimate import Estimate
from siloscope.types.remark import Remark

Run = Callable[[Prepared, Settings, dict[str, Any]], Estimate]
"""A method of `locate`."""

LEAST = 1e-3
"""Least value that has an inverse worth asking, m."""

LEAST_WALL = 0.1
"""Fraction of the pixels that must be wall if depths were read otherwise."""

MOST_CHI_SQUARE = 1.25
"""Reduced chi-square of their tiles: frames read as they are have 0.7 to 1.25, right ones read wrongly 1.3 to 2.5."""

TYPICAL = 2.0
"""Median depth to which disparities are brought, whose scale is not known, m."""


def looked_at_again(
    run: Run, estimate: Estimate, prepared: Prepared, settings: Settings
) -> tuple[Estimate, list[Remark]]:
    """An answer with what it says against its priors; what a refused frame says if one of them is left out."""
    if estimate.ok:
        said = [*prior_remarks(estimate, priors_of(prepared, settings)), *way_remarks(estimate, prepared, settings)]
        return estimate, [*said, *_another_camera(estimate, prepared, settings)]
    for remark, free in without_priors(run, prepared, settings, estimate.config):
        return free, [remark]
    if settings.start is None:
        return estimate, list(other_readings(run, prepared, settings, estimate.config))
    return estimate, []


def without_priors(
    run: Run, prepared: Prepared, settings: Settings, config: dict[str, Any]
) -> Iterator[tuple[Remark, Estimate]]:
    """The prior that keeps a refused frame from an answer and contradicts it, and the answer without it."""
    priors = priors_of(prepared, settings)
    if settings.gravity is not None:
        free = run(prepared, replace(settings, gravity=None), config)
        if free.ok and (aside := gravity_off(free, priors)) is not None:
            yield (
                Remark("gravity-contradicts", f"without it the axis is {math.degrees(aside[0]):.1f}° off it", True),
                free,
            )
    if settings.diameter is not None:
        free = run(prepared, replace(settings, diameter=None), config)
        if free.ok and (off := diameter_off(free, priors)) is not None:
            seen = f"without it the diameter seen is {settings.diameter + off:.3f} m, not {settings.diameter:g} m"
            yield Remark("diameter-contradicted", seen, True), free


def other_readings(run: Run, prepared: Prepared, settings: Settings, config: dict[str, Any]) -> Iterator[Remark]:
    """Warnings of a refused image that gives an answer if its values are something else than depth."""
    if not isinstance(prepared, PreparedDepth) or prepared.turn is not None:
        return
    free = replace(settings, gravity=None, diameter=None, ratios=False, start=None)
    held = replace(settings, ratios=True, start=None), free
    usual = usual_camera(prepared.camera, settings.profile)
    if usual is not None and run(replace(prepared, camera=usual), free, config).ok:
        figures = _beside(prepared.camera, usual, settings.profile)
        yield Remark("another-streams-camera", f"{figures}, with which the frame gives an answer")
        return
    stretch = np.sqrt(1.0 + np.sum(prepared.camera.rays() ** 2, axis=2))
    if _convinces(run, prepared, held, config, prepared.depth / stretch):
        yield Remark("ray-length-as-depth", "read as ray lengths, the frame gives an answer")
    seen = prepared.depth > LEAST
    if seen.any():
        scale = TYPICAL * float(np.median(prepared.depth[seen]))
        inverse = np.where(seen, scale / np.where(seen, prepared.depth, 1.0), 0.0)
        if _convinces(run, prepared, (replace(held[0], diameter=None), free), config, inverse):
            yield Remark("disparity-as-depth", "read as disparities, the frame gives an answer")


def _another_camera(estimate: Estimate, prepared: Prepared, settings: Settings) -> Iterator[Remark]:
    """A warning of an answer by a camera that is none of the sensor's: bare walls and cones fit any focal length.

    A recording's own camera is taken as it is, for depth that is aligned to colour has the colour camera's; so is one
    with which the diameter seen is the one given.
    """
    confirmed = settings.diameter is not None and estimate.silo.radius is not None
    if confirmed or not isinstance(prepared, PreparedDepth) or not prepared.camera_given:
        return
    usual = usual_camera(prepared.camera, settings.profile)
    if usual is not None:
        yield Remark("another-streams-camera", _beside(prepared.camera, usual, settings.profile))


def _beside(camera: Camera, usual: Camera, profile: SensorProfile) -> str:
    return f"fx {camera.fx:.5g}, about {usual.fx:.5g} is {profile.name}'s at this size"


def usual_camera(camera: Camera, profile: SensorProfile) -> Camera | None:
    """The profile's camera at an image's size, to a rounded row; None where it has none, or one whose devices may be
    the given one."""
    size, std = (camera.width, camera.height), profile.nominal_std(camera).f
    usual = [scaled(one, size) for one in profile.intrinsics if abs(one.height * size[0] / one.width - size[1]) < 1.0]
    if not usual or any(abs(math.log(camera.fx / one.fx)) <= CONTRADICTION * std for one in usual):
        return None
    return usual[0]


def _convinces(
    run: Run, prepared: PreparedDepth, settings: tuple[Settings, Settings], config: dict[str, Any], depth: Any
) -> bool:
    """Whether other depths give an answer with what is told and without, of which no chance is the cause.

    Some refused frames answer by chance when they are bent: with little wall, and tiles that disagree.
    """
    other = replace(prepared, depth=np.ascontiguousarray(depth, np.float32))
    told, free = settings
    found = run(other, told, config)
    if not found.ok or found.pixel_ratios is None or prior_remarks(found, priors_of(other, told)):
        return False
    if not run(other, free, config).ok:
        return False
    wall = found.pixel_ratios.cylinder + found.pixel_ratios.cone
    return wall > LEAST_WALL and found.extra["fit"]["chi_square"] < MOST_CHI_SQUARE
