"""What was given of a vessel against what frames show of it."""

from __future__ import annotations

import math
from collections.abc import Iterator

from siloscope.estimation.input_checks import CONTRADICTION
from siloscope.types.calibration import Calibration
from siloscope.types.estimate import Estimate
from siloscope.types.remark import Remark
from siloscope.vessel.limits import LENGTH_STD
from siloscope.vessel.vessel import Vessel


def vessel_remarks(found: Estimate | Calibration, vessel: Vessel) -> Iterator[Remark]:
    """Warnings where an answer shows a cone or a cylinder that the vessel has otherwise, or not at all."""
    silo, std, sheet = found.silo, found.silo_std, vessel.sheet
    if not found.ok or silo.apex is None or silo.cylinder_bottom is None:
        return
    height, bottom_std = silo.apex - silo.cylinder_bottom, std.cylinder_bottom or 0.0
    if sheet.bottom == "flat" or sheet.cone == 0.0:
        yield _remark(f"a cone {height:.2f} m high is seen, the floor is said to be flat")
    elif sheet.cone is not None and _differ(height, sheet.cone, std.apex or 0.0, bottom_std):
        yield _remark(f"the cone is {height:.3f} m high, not {sheet.cone:g} m as given")
    if vessel.top is None or sheet.cylinder is None:
        return
    seen = silo.cylinder_bottom - vessel.top
    if _differ(seen, sheet.cylinder, bottom_std):
        yield _remark(f"the cylinder is {seen:.3f} m high below the edge given, not {sheet.cylinder:g} m as given")


def _differ(seen: float, told: float, *stds: float) -> bool:
    return abs(seen - told) > CONTRADICTION * math.hypot(*stds, LENGTH_STD)


def _remark(message: str) -> Remark:
    return Remark("vessel-contradicted", message)
