"""A calibration with the diameter that a tape or a datasheet tells, which puts every length and the scale right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from siloscope.parameters import PARAMETERS
from siloscope.types.calibration import Calibration
from siloscope.types.pose import SiloPose
from siloscope.types.vessel import geometry_of
from siloscope.vessel.floor import CONTRADICTION_STD
from siloscope.vessel.limits import LENGTH_STD

RADIUS, SLOPE, INTERCEPT, SCALE = (
    PARAMETERS.index(name) for name in ("radius", "cone_slope", "cone_intercept", "scale")
)


def taped(calibration: Calibration, diameter: float | None) -> Calibration:
    """The calibration, given that the silo has a diameter, m, which is right to `LENGTH_STD`.

    The estimate conditioned on another reading of its radius: what errs with the radius (the depth's scale and all
    lengths, where the scale is not known) moves with it. Unchanged where nothing is told, where the calibration was
    given a diameter itself, where it has no covariance, and where the diameter contradicts it.

    Parameters
    ----------
    calibration : Calibration
        With an answer.
    diameter : float, optional
        Inner diameter, m.
    """
    values, covariance = calibration.parameters, calibration.parameter_covariance
    if diameter is None or values is None or covariance is None or calibration.config.get("diameter") is not None:
        return calibration
    radius, variance = float(values[RADIUS]), float(covariance[RADIUS, RADIUS]) + LENGTH_STD**2 / 4.0
    off = radius * np.log(0.5 * diameter / radius)  # lengths and scale move by a factor, to which this is exact
    if not off**2 <= CONTRADICTION_STD**2 * variance:
        return calibration
    gain = covariance[:, RADIUS] / variance
    step = gain * off
    made = values + step
    for k in (RADIUS, INTERCEPT):
        made[k] = values[k] * np.exp(step[k] / values[k])
    made[SCALE] = (1.0 + values[SCALE]) * np.exp(step[SCALE] / (1.0 + values[SCALE])) - 1.0
    known = covariance - np.outer(gain, covariance[RADIUS])
    cone = (float(made[SLOPE]), float(made[INTERCEPT]))
    has_cone = calibration.silo.apex is not None
    silo, silo_std = geometry_of(float(made[RADIUS]), cone if has_cone else None, known)
    pose = SiloPose(*(float(v) for v in made[:4]))
    return replace(
        calibration,
        pose=pose,
        covariance=known[:4, :4].copy(),
        silo=silo,
        silo_std=silo_std,
        parameters=made,
        parameter_covariance=known,
    )
