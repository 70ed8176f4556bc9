"""A reading's inputs judged against the sensor's profile, as `locate` judges them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from siloscope import sensors
from siloscope.estimation.contradictions import trusted, weighed
from siloscope.estimation.input_checks import input_remarks
from siloscope.estimation.inputs import Prepared, PreparedDepth
from siloscope.sensors import SensorProfile
from siloscope.types.calibration import Calibration
from siloscope.types.remark import Remark


def inputs_say(
    data: Any,
    prepared: Prepared,
    profile: SensorProfile | None,
    silo: Calibration,
    unit_and_trust: tuple[float | None, str | Sequence[str]],
) -> tuple[Remark, ...]:
    """Remarks on a frame by the sensor given, else the calibration's; refusals but for what is trusted.

    What lies too near only warns: in a silo that is known a sensor may be buried, which the reading finds out.
    """
    judging = profile or sensors.from_record(silo.config.get("sensor")) or sensors.UNKNOWN
    depth_unit, trust = unit_and_trust
    said = weighed(input_remarks(data, prepared, judging, depth_unit), trusted(trust))
    return tuple(replace(remark, refuses=False) if _too_near(remark, prepared, judging) else remark for remark in said)


def _too_near(remark: Remark, prepared: Prepared, profile: SensorProfile) -> bool:
    if remark.code != "outside-sensor-range" or not isinstance(prepared, PreparedDepth):
        return False
    return float(np.median(prepared.depth[prepared.depth > 0.0])) < profile.range[0]
