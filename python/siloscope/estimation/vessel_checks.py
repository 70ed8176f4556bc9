"""What was given of a vessel against what a frame shows of it."""

from __future__ import annotations

import math
from collections.abc import Iterator

from siloscope.estimation.input_checks import CONTRADICTION
from siloscope.types.estimate import Estimate
from siloscope.types.remark import Remark
from siloscope.vessel.datasheet import Datasheet
from siloscope.vessel.limits import LENGTH_STD


def vessel_remarks(estimate: Estimate, sheet: Datasheet) -> Iterator[Remark]:
    """Warnings where an estimate shows a cone that the datasheet has otherwise, or not at all."""
    silo, std = estimate.silo, estimate.silo_std
    if not estimate.ok or silo.apex is None or silo.cylinder_bottom is None:
        return
    height = silo.apex - silo.cylinder_bottom
    if sheet.bottom == "flat" or sheet.cone == 0.0:
        yield Remark("vessel-contradicted", f"a cone {height:.2f} m high is seen, the floor is said to be flat")
    elif sheet.cone is not None:
        allowed = CONTRADICTION * math.hypot(std.apex or 0.0, std.cylinder_bottom or 0.0, LENGTH_STD)
        if abs(height - sheet.cone) > allowed:
            yield Remark("vessel-contradicted", f"the cone is {height:.3f} m high, not {sheet.cone:g} m as given")
