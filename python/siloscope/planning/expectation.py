"""What one frame from a place would say: the fit's covariance for exact depths with one draw of the noise."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from siloscope.errors import SiloscopeError, UsageError
from siloscope.locate import locate
from siloscope.measure import measure
from siloscope.planning.places import Placement
from siloscope.planning.view import Interior, exact_depth
from siloscope.sensors import SensorProfile
from siloscope.types.calibration import Calibration
from siloscope.types.camera import Camera
from siloscope.types.estimate import Estimate
from siloscope.types.intrinsics import IntrinsicsStd, named
from siloscope.vessel.vessel import Vessel

FEW = 0.5
"""Fraction of the picture without a depth from which on a warning is due."""


@dataclass(frozen=True)
class View:
    """Vessel, camera and sensor of a plan."""

    vessel: Vessel
    inside: Interior
    camera: Camera
    sensor: SensorProfile
    intrinsics: IntrinsicsStd

    @classmethod
    def of(
        cls,
        vessel: Vessel,
        drop: float,
        sensor: SensorProfile,
        camera: Camera | None = None,
        intrinsics: str | IntrinsicsStd | None = None,
    ) -> View:
        """A view with the profile's nominal camera unless one is given.

        Raises
        ------
        UsageError
            If the vessel lacks lengths, or neither camera nor nominal intrinsics are known.
        """
        if camera is None and not sensor.intrinsics:
            raise UsageError(f"profile {sensor.name} has no nominal intrinsics; give the camera's own (--camera)")
        seeing = camera or sensor.intrinsics[0]
        if isinstance(intrinsics, str):
            known = named(intrinsics, seeing)
        else:
            known = intrinsics or (named("calibrated", seeing) if camera else sensor.nominal_std(seeing))
        return cls(vessel, Interior.of(vessel, drop), seeing, sensor, known)


@dataclass(frozen=True)
class Expected:
    """One placement at one level."""

    level: float
    """Where the feed meets the wall, as a fraction of the height from the lowest point to the upper edge."""
    reason: str | None
    """Why such a frame is refused; None where it is answered."""
    std: dict[str, float] | None
    """Standard deviations of r_x, r_y (rad), t_x, t_y (m)."""
    axis_std: float | None
    """Standard deviation of the axis' place at the vessel's lowest point, m."""
    warnings: tuple[str, ...] = ()
    volume_std: float | None = None
    """Standard deviation of the volume with the plan's calibration, m³."""
    ullage_std: float | None = None
    level_std: float | None = None
    """Standard deviation of the mean level, m."""
    coverage: float | None = None
    """Fraction of the feed's surface in view."""
    estimate: Estimate | None = field(default=None, repr=False, compare=False)
    depth: Any = field(default=None, repr=False, compare=False)

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        hidden = ("estimate", "depth", "warnings")
        return {**{k: v for k, v in vars(self).items() if k not in hidden}, "warnings": list(self.warnings)}


def expected(view: View, placement: Placement, level: float) -> Expected:
    """The pose's deviations: what noise, form, intrinsics and bias leave open to the fit of one frame.

    The frame has the same draw of the noise at every place: in depths without any the fit sees forms of the wall in
    micrometres that no frame shows.
    """
    depth = exact_depth(view.inside, view.camera, placement.pose, level)
    warnings = [*out_of_range(view, depth), *little_in_view(depth)]
    read = with_noise(view.sensor, depth, within_range(view, depth))
    estimate = locate(read, view.camera, sensor=view.sensor, intrinsics=view.intrinsics)
    if estimate.covariance is None:
        return Expected(level, estimate.reason, None, None, tuple(warnings), estimate=estimate, depth=read)
    std = dict(zip(("r_x", "r_y", "t_x", "t_y"), np.sqrt(np.diag(estimate.covariance)).tolist(), strict=True))
    axis = axis_std(estimate.covariance, view.inside.lowest)
    return Expected(level, None, std, axis, tuple(warnings), estimate=estimate, depth=read)


def axis_std(covariance: Any, z: float) -> float:
    """Root of the mean variance of the axis' place along x and y, z metres below the camera: t + z · tilt."""
    x, y = np.array([0.0, -z, 1.0, 0.0]), np.array([z, 0.0, 0.0, 1.0])
    return math.sqrt(0.5 * float(x @ covariance @ x + y @ covariance @ y))


def within_range(view: View, depth: Any) -> Any:
    """What the sensor reads: its bias added, nothing beyond its range."""
    low, high = view.sensor.range
    offset, scale, quadratic = view.sensor.bias
    read = depth + np.where(depth > 0.0, offset + scale * depth + quadratic * depth**2, 0.0)
    return np.where((read >= low) & (read <= high), read, 0.0)


def with_noise(sensor: SensorProfile, depth: Any, read: Any) -> Any:
    """Depths with the noise of a sensor whose law is known, the same draw each time."""
    if sensor.noise is None:
        return read
    floor, constant, linear, quadratic, factor, power = sensor.noise
    sigma = np.maximum(floor, constant + linear * depth + quadratic * depth**2 + factor * depth**power)
    drawn = np.random.default_rng(0).standard_normal(depth.shape)
    return np.where(read > 0.0, read + sigma * drawn, 0.0)


def out_of_range(view: View, depth: Any) -> list[str]:
    """Surfaces that the sensor does not reach."""
    low, high = view.sensor.range
    seen = depth[depth > 0.0]
    made = []
    if seen.size and (near := float(np.mean(seen < low))) > 0.01:
        made.append(f"{100 * near:.0f} % of the view is nearer than the sensor's {low:g} m")
    if seen.size and (far := float(np.mean(seen > high))) > 0.01:
        made.append(f"{100 * far:.0f} % of the view is beyond the sensor's {high:g} m")
    return made


def little_in_view(depth: Any) -> list[str]:
    """A view of which much goes to the roof."""
    lost = float(np.mean(depth <= 0.0))
    return [f"{100 * lost:.0f} % of the picture looks at the roof"] if lost > FEW else []


def with_content(view: View, seen: Expected, calibration: Calibration) -> Expected:
    """The same with the deviations of the content that a calibration from these frames would give."""
    try:
        content = measure(
            seen.depth, calibration, view.camera, sensor=view.sensor, vessel=view.vessel, top=view.inside.top
        )
    except SiloscopeError as error:
        return replace(seen, warnings=(*seen.warnings, f"no content: {error}"))
    return replace(
        seen,
        volume_std=content.volume_std,
        ullage_std=content.ullage_std,
        level_std=content.level.std if content.level is not None else None,
        coverage=content.coverage,
    )
