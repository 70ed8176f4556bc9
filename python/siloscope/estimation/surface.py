"""Method ``surface``: cylinder and cone fitted to the wall, with the sensor's error taken into account."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.parameters import PARAMETERS
from siloscope.reasons import estimate_refusals, sentence
from siloscope.sensors import SensorProfile
from siloscope.types.camera import Camera
from siloscope.types.estimate import Estimate, Ratios, SurfaceDetails
from siloscope.types.frame_factor import FrameFactor
from siloscope.types.pose import SiloPose
from siloscope.types.vessel import geometry_of

OVALITY = PARAMETERS.index("oval_cos")

DIAMETER_STD = 0.002
"""Standard deviation of a tape-measured diameter, m."""

GRAVITY_STD = 0.01
"""Standard deviation of an accelerometer's direction at rest, rad (Table 7 of the paper: 5 to 12 mrad)."""


def fit_depth(
    depth: NDArray[np.float32],
    camera: Camera,
    profile: SensorProfile,
    *,
    diameter: float | None = None,
    diameter_std: float = DIAMETER_STD,
    gravity: NDArray[np.float64] | None = None,
    gravity_std: float = GRAVITY_STD,
    start: Estimate | None = None,
    ratios: bool = True,
    config: dict[str, Any] | None = None,
) -> Estimate:
    """Fit the wall to a depth image.

    Parameters
    ----------
    depth : float32 (H, W), C-contiguous
        Measured depth z in metres; 0 or NaN where there is none.
    camera : Camera
        Intrinsics of the same size.
    profile : SensorProfile
        The sensor's depth error.
    diameter, diameter_std : float, optional
        Measured inner diameter of the silo's cylinder, m.
    gravity : float (3,), optional
        Direction of gravity in the camera frame, any length; used as a prior on the axis and reported against the
        answer without it.
    start : Estimate, optional
        Of another frame of the same camera: the wall is looked for there before it is searched.
    ratios : bool
        Whether to work out how much of the frame is cylinder, cone and feed.
    config : dict, optional
        Effective settings to record in the estimate.
    """
    radius, pull = _priors(diameter, diameter_std, gravity, gravity_std)
    wall = None if start is None or start.details is None else start.details.wall
    frame = (depth, camera.rays(), profile.bias, profile.bias_std, profile.noise, radius, pull)
    found = _core.surface_fit_image(*frame, wall=wall, ratios=ratios)
    if "refusal" in found:
        return refused("surface", found["refusal"], config or {})

    def labelled() -> NDArray[np.uint8]:
        labels: NDArray[np.uint8] = _core.surface_fit_image(*frame, labels=True, wall=wall)["labels"]
        return labels

    return _estimate(found, profile, config or {}, diameter, gravity, labelled)


def fit_points(
    points: NDArray[np.float64],
    *,
    grid: float | None = None,
    diameter: float | None = None,
    diameter_std: float = DIAMETER_STD,
    gravity: NDArray[np.float64] | None = None,
    gravity_std: float = GRAVITY_STD,
    threads: int = 1,
    config: dict[str, Any] | None = None,
) -> Estimate:
    """Fit the wall to a cloud, seen from inside or outside.

    Parameters
    ----------
    points : float64 (N, 3)
        Points in the camera frame, metres; rows that aren't finite are left out. They are taken as they are: without
        rays, no depth bias can be told from them.
    grid : float, optional
        Side of the voxel grid's cells in metres; None for `cell_size`.

    The rest is as for `fit_depth`.
    """
    radius, pull = _priors(diameter, diameter_std, gravity, gravity_std)
    found = _core.surface_fit_cloud(points, grid or cell_size(points), radius, pull, threads)
    if "refusal" in found:
        return refused("surface", found["refusal"], config or {})
    return _estimate(found, SensorProfile("none: a cloud is taken as it is"), config or {}, diameter, gravity)


def cell_size(points: NDArray[np.float64]) -> float:
    """Side of voxel cells for a cloud: the paper's 0.05 m, or a 60th of the cloud where it is small, in metres."""
    finite = points[np.isfinite(points).all(axis=1)]
    if len(finite) == 0:
        return GRID
    extent = float(np.max(np.percentile(finite, 95, axis=0) - np.percentile(finite, 5, axis=0)))
    return min(GRID, extent / 60.0) if extent > 0.0 else GRID


GRID = 0.05
"""Side of the voxel grid's cells, m (step 1 of section 2.3)."""

Prior = tuple[float, float] | None
Pull = tuple[float, float, float, float] | None


def _priors(
    diameter: float | None, diameter_std: float, gravity: NDArray[np.float64] | None, gravity_std: float
) -> tuple[Prior, Pull]:
    """Radius and gravity with their standard deviations, as the core takes them."""
    radius = None if diameter is None else (diameter / 2.0, diameter_std / 2.0)
    if gravity is None:
        return radius, None
    return radius, (float(gravity[0]), float(gravity[1]), float(gravity[2]), gravity_std)


def refused(method: str, slug: str, config: dict[str, Any]) -> Estimate:
    """An estimate without an answer; the message says what the reason means and what to try."""
    message = sentence(estimate_refusals()[slug])
    return Estimate("refused", method, reason=slug, message=message, config=config)


def _estimate(
    found: dict[str, Any],
    profile: SensorProfile,
    config: dict[str, Any],
    diameter: float | None,
    gravity: NDArray[np.float64] | None,
    labelled: Callable[[], NDArray[np.uint8]] | None = None,
) -> Estimate:
    pose = SiloPose(*found["pose"])
    covariance = found["covariance"]
    silo, silo_std = geometry_of(found["radius"], found["cone"], covariance)
    extra = {"sensor": _sensor(found, profile), "fit": _quality(found)}
    if gravity is not None:
        extra["gravity"] = _gravity_check(pose, gravity)
    return Estimate(
        "ok",
        "surface",
        pose=pose,
        covariance=covariance[:4, :4].copy(),
        silo=silo,
        silo_std=silo_std,
        pixel_ratios=_ratios(found.get("pixel_counts")),
        area_ratios=_ratios(found.get("areas")),
        config=config,
        timing_ms={name.replace(" ", "_"): ms for name, ms in found["timing"]},
        extra=extra,
        evidence=_evidence(found, profile, diameter, gravity),
        details=SurfaceDetails(found["points"], found["residuals"], found["wall"], labelled),
    )


def _ratios(counts: Any) -> Ratios | None:
    """Shares of cylinder, cone and feed among everything seen; None for clouds, whose points are no pixels."""
    seen = 0.0 if counts is None else sum(counts[1:])
    return Ratios(*(counts[k] / seen for k in (1, 2, 3))) if seen > 0 else None


def _sensor(found: dict[str, Any], profile: SensorProfile) -> dict[str, Any]:
    """The depth error that the answer rests on: given, or estimated with the pose."""
    free = found["free"][7:10]
    std = np.sqrt(np.diag(found["covariance"]))[7:10]
    names = ("offset", "scale", "quadratic")
    return {
        "profile": profile.name,
        "bias": dict(zip(names, found["bias"], strict=True)),
        "bias_std": dict(zip(names, np.where(free, std, profile.bias_std).tolist(), strict=True)),
        "bias_estimated": [n for n, f in zip(names, free, strict=True) if f],
    }


def _quality(found: dict[str, Any]) -> dict[str, Any]:
    evidence = found["evidence"]
    return {
        "wall_patches": evidence["patches"],
        "chi_square": found["chi_square"],
        "misfit": found["misfit"],
        "cone_slope": None if found["cone"] is None else found["cone"][0],
        "ovality": float(np.hypot(*found["ovality"])) if any(found["free"][10:]) else None,
        "seen_from": "inside" if found["inside"] else "outside",
        "arc": evidence["arc"],
        "turn": evidence["turn"],
        "bend": evidence["bend"],
    }


def _gravity_check(pose: SiloPose, gravity: NDArray[np.float64]) -> dict[str, float]:
    """The accelerometer's own angles beside the answer's (Table 7)."""
    from_gravity = SiloPose.from_axis(gravity, np.zeros(3))
    down = np.asarray(gravity, float) / np.linalg.norm(gravity)
    angle = float(np.arccos(np.clip(abs(down @ pose.axis_direction), 0.0, 1.0)))  # both are lines
    return {"r_x": from_gravity.r_x, "r_y": from_gravity.r_y, "angle_to_axis": angle}


def _evidence(
    found: dict[str, Any], profile: SensorProfile, diameter: float | None, gravity: NDArray[np.float64] | None
) -> FrameFactor:
    slope, intercept = found["cone"] or (np.nan, np.nan)
    radius = np.nan if found["radius"] is None else found["radius"]
    prior = found["prior"]
    free = np.array(found["free"]) | (np.arange(len(PARAMETERS)) >= OVALITY) & (prior > 0.0)
    expected = np.full(len(PARAMETERS), np.nan)
    expected[7:10] = profile.bias
    expected[OVALITY:] = 0.0
    if diameter is not None:
        expected[4] = diameter / 2.0
    if gravity is not None:
        tilt = SiloPose.from_axis(gravity, np.zeros(3))
        expected[:2] = tilt.r_x, tilt.r_y
    return FrameFactor(
        parameters=np.array([*found["pose"], radius, slope, intercept, *found["bias"], *found["ovality"]])
        + found["step"],
        information=found["information"],
        gradient=found["gradient"],
        scatter=found["scatter"],
        noise=found["noise_share"],
        free=free,
        prior_mean=expected,
        prior_information=prior,
        scale_std=0.0 if free[8] else profile.bias_std[1],
        linearization_point=found["base"],
        rays=found["rays"],
    )
