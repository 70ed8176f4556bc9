"""The methods of `locate` by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from siloscope.estimation import shape_tensor, surface
from siloscope.estimation.inputs import Prepared, PreparedPoints
from siloscope.estimation.priors import CLOUD, Priors
from siloscope.estimation.settings import Settings
from siloscope.types.estimate import Estimate


def _surface(frame: Prepared, settings: Settings, config: dict[str, Any]) -> Estimate:
    profile = CLOUD if isinstance(frame, PreparedPoints) else settings.profile
    priors = Priors(profile, settings.diameter, settings.gravity)
    if isinstance(frame, PreparedPoints):
        return surface.fit_points(frame.points, priors, grid=settings.grid, threads=settings.threads, config=config)
    if settings.vessels == "any":
        camera_std = settings.intrinsics_std(frame).of_rays(frame.camera)
        priors = replace(priors, any_vessel=True, camera_std=camera_std)
    start, ratios = settings.start, settings.ratios
    return surface.fit_depth(frame.depth, frame.camera, priors, start=start, ratios=ratios, config=config)


def _shape_tensor(frame: Prepared, settings: Settings, config: dict[str, Any]) -> Estimate:
    chosen = shape_tensor.Settings(grid=settings.grid, neighbours=settings.neighbours, threads=settings.threads)
    if isinstance(frame, PreparedPoints):
        return shape_tensor.fit_points(frame.points, chosen, config)
    return shape_tensor.fit_depth(frame.depth, frame.camera, chosen, config)


METHODS: dict[str, Callable[[Prepared, Settings, dict[str, Any]], Estimate]] = {
    "surface": _surface,
    "shape-tensor": _shape_tensor,
}
"""The methods by name."""
