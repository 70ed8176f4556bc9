"""Method ``surface``: cylinder and cone fitted to the wall, with the sensor's error taken into account."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.estimation.cloud_uncertainty import SensorStd, sensor_covariance
from siloscope.estimation.priors import DEPTH_BIAS, Priors
from siloscope.estimation.steps import cell_size
from siloscope.parameters import BIAS, OVALITY, PARAMETERS
from siloscope.types.camera import Camera
from siloscope.types.depth_frame import DepthFrame
from siloscope.types.estimate import Estimate, PixelLabels, SurfaceDetails, ratios_of, refused, timing_ms
from siloscope.types.frame_factor import FrameFactor
from siloscope.types.pose import SiloPose
from siloscope.types.vessel import geometry_of


def fit_depth(
    depth: NDArray[np.float32],
    camera: Camera,
    priors: Priors,
    *,
    start: Estimate | None = None,
    ratios: bool = True,
    config: dict[str, Any] | None = None,
) -> Estimate:
    """Fit the wall to a depth image.

    Parameters
    ----------
    depth : float32 (H, W)
        Measured depth z in metres; 0 or NaN where there is none.
    camera : Camera
        Intrinsics of the same size.
    priors : Priors
        What is known before; gravity is also reported against the answer.
    start : Estimate, optional
        Of another frame of the same camera: the wall is looked for there before it is searched.
    ratios : bool
        Whether to work out how much of the frame is cylinder, cone and feed.
    config : dict, optional
        Effective settings to record in the estimate.
    """
    frame = DepthFrame(depth, camera, camera.rays())
    wall = None if start is None or start.details is None else start.details.wall
    found = _core.fit_depth(frame, priors, wall, ratios)
    if isinstance(found, _core.Refusal):
        return refused("surface", found, config)
    more = None if found.inside else sensor_covariance(found, SensorStd((0.0, 0.0, 0.0), priors.camera_std))
    return _estimate(found, priors, config, PixelLabels(found, frame), more)


def fit_points(
    points: NDArray[np.float64],
    priors: Priors,
    *,
    grid: float | None = None,
    threads: int = 1,
    sensor: SensorStd | None = None,
    config: dict[str, Any] | None = None,
) -> Estimate:
    """Fit the wall to a cloud, seen from inside or outside.

    Parameters
    ----------
    points : float64 (N, 3)
        Points in the camera frame, metres; rows that aren't finite are left out. They are taken as they are: without
        rays, no depth bias can be told from them.
    priors : Priors
        What is known before, the profile being `CLOUD`.
    grid : float, optional
        Side of the voxel grid's cells in metres; None for `cell_size`.
    threads : int
        Threads for what can be shared.
    sensor : SensorStd, optional
        What the sensor may have done to all points, where one in the origin has seen them.
    config : dict, optional
        Effective settings to record in the estimate.
    """
    found = _core.fit_points(points, priors, grid or cell_size(points), threads)
    if isinstance(found, _core.Refusal):
        return refused("surface", found, config)
    more = None if sensor is None else sensor_covariance(found, sensor)
    return _estimate(found, priors, config, more=more)


def _estimate(
    fit: _core.SurfaceFit,
    priors: Priors,
    config: dict[str, Any] | None,
    labels: PixelLabels | None = None,
    more: NDArray[np.float64] | None = None,
) -> Estimate:
    values = dict(zip(PARAMETERS, (v if np.isfinite(v) else None for v in fit.parameters.tolist()), strict=True))
    pose = SiloPose(*(float(v) for v in fit.parameters[:4]))
    covariance = fit.covariance if more is None else fit.covariance + more
    if priors.profile.map is not None:
        covariance = priors.profile.map.widened(covariance)
    slope, intercept = values["cone_slope"], values["cone_intercept"]
    cone = None if slope is None or intercept is None else (slope, intercept)
    silo, silo_std = geometry_of(values["radius"], cone, covariance)
    extra = {"sensor": _sensor(fit, covariance, priors), "fit": _quality(fit, slope)}
    if fit.models:
        extra |= _vessels(fit)
    if priors.gravity is not None:
        extra["gravity"] = _gravity_check(pose, priors.gravity)
    seen = fit.coverage
    return Estimate(
        "ok",
        "surface",
        pose=pose,
        covariance=covariance[:4, :4].copy(),
        silo=silo,
        silo_std=silo_std,
        pixel_ratios=None if seen is None else ratios_of(seen.counts),
        area_ratios=None if seen is None else ratios_of(seen.areas),
        config=config or {},
        timing_ms=timing_ms(fit.stages),
        extra=extra,
        details=SurfaceDetails(fit.points, fit.residuals, fit.warm_start, labels, FrameFactor.of(fit.factor)),
    )


def _vessels(fit: _core.SurfaceFit) -> dict[str, Any]:
    """The vessel models with their probabilities, and the deviations without what a camera's frames have in common."""
    relative = np.sqrt(np.diag(fit.covariance_relative))[:4]
    return {
        "models": [{"model": name, "probability": probability} for name, probability in fit.models],
        "std_relative": dict(zip(PARAMETERS[:4], relative.tolist(), strict=True)),
    }


def _sensor(fit: _core.SurfaceFit, covariance: NDArray[np.float64], priors: Priors) -> dict[str, Any]:
    """The depth error that the answer rests on: given, or estimated with the pose."""
    free = fit.free[DEPTH_BIAS]
    std = np.sqrt(np.diag(covariance))[DEPTH_BIAS]
    return {
        "profile": priors.profile.name,
        "bias": dict(zip(BIAS, fit.parameters[DEPTH_BIAS].tolist(), strict=True)),
        "bias_std": dict(zip(BIAS, np.where(free, std, priors.profile.bias_std).tolist(), strict=True)),
        "bias_estimated": [n for n, f in zip(BIAS, free, strict=True) if f],
    }


def _quality(fit: _core.SurfaceFit, cone_slope: float | None) -> dict[str, Any]:
    wall = fit.diagnostics
    return {
        "wall_patches": wall.tiles,
        "chi_square": fit.chi_square,
        "misfit": fit.model_error_std,
        "cone_slope": cone_slope,
        "ovality": float(np.hypot(*fit.parameters[OVALITY])) if fit.free[OVALITY].any() else None,
        "seen_from": "inside" if fit.inside else "outside",
        "arc": wall.arc,
        "turn": wall.turn,
        "bend": wall.bend,
        "camera_error": fit.camera_error,
    }


def _gravity_check(pose: SiloPose, gravity: NDArray[np.float64]) -> dict[str, float]:
    """The accelerometer's own angles beside the answer's (Table 7)."""
    from_gravity = SiloPose.from_axis(gravity, np.zeros(3))
    down = np.asarray(gravity, float) / np.linalg.norm(gravity)
    angle = float(np.arccos(np.clip(abs(down @ pose.axis_direction), 0.0, 1.0)))  # both are lines
    return {"r_x": from_gravity.r_x, "r_y": from_gravity.r_y, "angle_to_axis": angle}
