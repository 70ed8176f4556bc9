"""How far an answer pulls what was known before it: sensor, tape, intrinsics, gravity."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from siloscope.estimation.input_checks import CONTRADICTION
from siloscope.estimation.inputs import Prepared, PreparedPoints
from siloscope.estimation.priors import Priors
from siloscope.estimation.settings import Settings
from siloscope.parameters import BIAS
from siloscope.sensors import UNKNOWN
from siloscope.types.estimate import Estimate
from siloscope.types.remark import Remark

WALL_FORM = 0.002
"""Standard deviation of the fitted diameter from the taped one as real walls are formed, as a fraction."""

CONTRADICTION_OF_FOUR = 5.87
"""The same for four numbers together: chi-square of 4 degrees of freedom that is as rare as 5 standard deviations."""


def prior_remarks(estimate: Estimate, priors: Priors) -> tuple[Remark, ...]:
    """Every remark on an answer of the method ``surface``."""
    if not estimate.ok or estimate.method != "surface":
        return ()
    return (
        *_scale(estimate, priors),
        *_radius(estimate, priors),
        *_bias(estimate, priors),
        *_intrinsics(estimate, priors),
        *_gravity(estimate, priors),
    )


def _scale(estimate: Estimate, priors: Priors) -> Iterator[Remark]:
    """The tape against the sensor: the depth scale that it needs."""
    profile, std = priors.profile, priors.profile.bias_std[1]
    if priors.diameter is None or std == 0.0:
        return
    sensor = estimate.extra["sensor"]
    scale = sensor["bias"]["scale"] - profile.bias[1]
    if abs(scale) <= CONTRADICTION * math.hypot(std, priors.camera_std[0], sensor["bias_std"]["scale"]):
        return
    name = "a sensor without a profile" if profile is UNKNOWN else profile.name
    figures = f"with {priors.diameter:g} m the depth scale would be off by {100 * scale:+.1f} %"
    yield Remark("diameter-contradicted", f"{figures}, that of {name} is known to {100 * std:.2g} %", True)


def _radius(estimate: Estimate, priors: Priors) -> Iterator[Remark]:
    """The tape against the wall where the depth scale is exact, and does not give."""
    if priors.diameter is None or priors.profile.bias_std[1] > 0.0:
        return
    off = diameter_off(estimate, priors)
    if off is not None:
        percent, seen = 100.0 * off / priors.diameter, priors.diameter + off
        figures = f"the diameter seen is {seen:.3f} m, {percent:+.1f} % off the {priors.diameter:g} m given"
        yield Remark("diameter-contradicted", figures, True)


def diameter_off(estimate: Estimate, priors: Priors) -> float | None:
    """How far the diameter seen is off the one given, m; None where that is no contradiction."""
    radius, std = estimate.silo.radius, estimate.silo_std.radius
    if priors.diameter is None or radius is None or std is None:
        return None
    allowed = math.hypot(WALL_FORM, priors.profile.bias_std[1]) * priors.diameter
    off = 2.0 * radius - priors.diameter
    return off if abs(off) > CONTRADICTION * math.hypot(2.0 * std, priors.diameter_std, allowed) else None


def _bias(estimate: Estimate, priors: Priors) -> Iterator[Remark]:
    """The parts of the depth error beside its scale against the sensor's profile."""
    bias, profile = estimate.extra["sensor"]["bias"], priors.profile
    for k in (0, 2):
        name, std = BIAS[k], profile.bias_std[k]
        off = bias[name] - profile.bias[k]
        if std > 0.0 and abs(off) > CONTRADICTION * std:
            figures = f"{name} {bias[name]:.4f}, {abs(off) / std:.0f} standard deviations of {profile.name}"
            yield Remark("depth-bias-contradicted", figures, True)


def _intrinsics(estimate: Estimate, priors: Priors) -> Iterator[Remark]:
    """Focal lengths and principal point as the wall has them, against those given.

    The first distortion coefficient is left out: walls have forms that look like it. So is a cone alone, which shows
    too little to tell its form from the camera's.
    """
    errors = estimate.extra["fit"]["camera_error"]
    if errors is None or estimate.silo.radius is None:
        return
    known = [(off, std) for off, std in zip(errors[:4], priors.camera_std[:4], strict=True) if std > 0.0]
    pulls = [off / std for off, std in known]
    if math.hypot(*pulls) > CONTRADICTION_OF_FOUR:
        named = ", ".join(f"{name} by {100 * off:+.1f} %" for name, off in zip(("fx", "fy"), errors[:2], strict=True))
        aside = " and ".join(f"{100 * off:+.1f} %" for off in errors[2:4])
        figures = f"{named}, cx and cy by {aside} of the focal length; {math.hypot(*pulls):.0f} standard deviations"
        yield Remark("intrinsics-contradicted", figures, True)


def _gravity(estimate: Estimate, priors: Priors) -> Iterator[Remark]:
    found = gravity_off(estimate, priors)
    if found is not None:
        angle, std = found
        figures = f"{math.degrees(angle):.1f}° apart, {angle / std:.0f} standard deviations"
        yield Remark("gravity-contradicts", figures, True)


def gravity_off(estimate: Estimate, priors: Priors) -> tuple[float, float] | None:
    """Angle from gravity to the axis and its standard deviation, rad; None where that is no contradiction."""
    if priors.gravity is None or estimate.pose is None or estimate.covariance is None:
        return None
    down = priors.gravity / np.linalg.norm(priors.gravity)
    angle = math.acos(max(-1.0, min(1.0, float(down @ estimate.pose.axis_direction))))
    std = math.hypot(priors.gravity_std, math.sqrt(float(np.linalg.eigvalsh(estimate.covariance[:2, :2])[-1])))
    return (angle, std) if angle > CONTRADICTION * std else None


def way_remarks(estimate: Estimate, prepared: Prepared, settings: Settings) -> Iterator[Remark]:
    """Warnings of an answer whose z may point upwards."""
    if settings.gravity_is_behind:
        yield Remark("gravity-behind", "its z is negative")
    if estimate.pose is None or not isinstance(prepared, PreparedPoints):
        return
    above = float(np.mean(estimate.pose.to_silo(prepared.points)[:, 2] < 0.0))
    if above > 0.5:
        yield Remark("upside-down", f"{100 * above:.0f} % of the points have a negative z in the silo frame")
