"""The methods of `locate` by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.estimation import shape_tensor, surface
from siloscope.estimation.cloud_uncertainty import WARP, SensorStd
from siloscope.estimation.inputs import Prepared, PreparedPoints
from siloscope.estimation.priors import CLOUD, Priors
from siloscope.estimation.settings import Settings
from siloscope.sensors import UNKNOWN, SensorProfile
from siloscope.types.estimate import Estimate

FEW_TILES = ("no-wall", "no-depth", "direction-unknown", "position-unknown", "poorly-determined")
"""Refusals of a cloud's image whose points may still show a wall: the image of a small thing has few tiles."""


def priors_of(frame: Prepared, settings: Settings) -> Priors:
    """What is known before the frame."""
    if isinstance(frame, PreparedPoints):
        return Priors(CLOUD, settings.diameter, settings.gravity)
    profile = settings.profile if frame.turn is None else replace(settings.profile, map=None)  # no image, no map
    camera_std = settings.intrinsics_std(frame).of_rays(frame.camera)
    return Priors(profile, settings.diameter, settings.gravity, camera_std=camera_std, told_cone=settings.told_cone)


def _surface(frame: Prepared, settings: Settings, config: dict[str, Any]) -> Estimate:
    priors = priors_of(frame, settings)
    if isinstance(frame, PreparedPoints):
        points = _unbiased(frame.points, settings.profile)
        sensor = _sensor_of(frame, settings)
        return surface.fit_points(
            points, priors, grid=settings.grid, threads=settings.threads, sensor=sensor, config=config
        )
    start, ratios = settings.start, settings.ratios
    estimate = surface.fit_depth(frame.depth, frame.camera, priors, start=start, ratios=ratios, config=config)
    return estimate if frame.turn is None else _of_a_cloud(estimate)


def _sensor_of(frame: PreparedPoints, settings: Settings) -> SensorStd | None:
    """What the sensor may have done to all points of a cloud; None where no place is known that has seen it."""
    if frame.camera is None:
        return None
    camera_std = settings.intrinsics_std(frame).of_rays(frame.camera)
    return SensorStd(settings.profile.bias_std, camera_std, WARP if settings.profile is UNKNOWN else 0.0)


def _unbiased(points: NDArray[np.float64], profile: SensorProfile) -> NDArray[np.float64]:
    """Points before the sensor, moved along their rays from the origin to the depth it should have measured."""
    if not any(profile.bias):
        return points
    ahead = points[points[:, 2] > 0.0]
    return np.ascontiguousarray(ahead * (profile.true_depth(ahead[:, 2]) / ahead[:, 2])[:, None])


def _of_a_cloud(estimate: Estimate) -> Estimate:
    """An answer by a cloud's image, without what only an image's pixels have."""
    found = estimate.details
    return estimate if found is None else replace(estimate, details=replace(found, wall=None, pixel_labels=None))


def _shape_tensor(frame: Prepared, settings: Settings, config: dict[str, Any]) -> Estimate:
    chosen = shape_tensor.Settings(grid=settings.grid, neighbours=settings.neighbours, threads=settings.threads)
    if isinstance(frame, PreparedPoints):
        return shape_tensor.fit_points(frame.points, chosen, config)
    return shape_tensor.fit_depth(frame.depth, frame.camera, chosen, config, priors_of(frame, settings))


METHODS: dict[str, Callable[[Prepared, Settings, dict[str, Any]], Estimate]] = {
    "surface": _surface,
    "shape-tensor": _shape_tensor,
}
"""The methods by name."""
