"""The rule by which a surface that was seen, a datasheet or a word of the user becomes the vessel's bottom.

A surface that was seen is a bottom only if it can't be feed: it is steeper than feed can lie, or it was in the same
place before and after a fill and a draw-down, or the user says so. Else the bottom stays unknown.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from siloscope.types.calibration import Calibration
from siloscope.types.floor import Floor, SeenCone
from siloscope.types.remark import Remark
from siloscope.types.vessel import geometry_of
from siloscope.vessel.datasheet import Datasheet
from siloscope.vessel.limits import LENGTH_STD

STEEPEST_REPOSE = math.radians(50.0)
"""Steepest slope at which feed is found: cohesive meal in the crater of a discharge."""

PROOF_STD = 2.0
"""Standard deviations by which a surface must be steeper than feed."""

LARGEST_HIDDEN = 0.01
"""Fraction of the capacity that the unseen part of a cone may hold for the rest to prove a bottom."""

FLATTEST_STAGE = math.tan(math.radians(30.0))
"""Slope of the flattest stage that a hopper has: feed does not flow off flatter ones."""

CONTRADICTION_STD = 5.0
"""Standard deviations beyond which a datasheet and what is seen contradict each other."""


def floor_of(
    calibration: Calibration, sheet: Datasheet, steepest: float = STEEPEST_REPOSE
) -> tuple[Floor, tuple[Remark, ...]]:
    """What is known of the bottom, with a warning for each contradiction.

    Parameters
    ----------
    calibration : Calibration
        Its cone is what was seen; its own `floor` is what it was told or has proved.
    sheet : Datasheet
        What the user says now; it wins over the calibration's floor.
    steepest : float
        Steepest slope at which the product lies, radians.
    """
    seen = seen_cone(calibration)
    if sheet.bottom == "unknown":
        return Floor(seen=seen), ()
    if sheet.shape is not None:
        return Floor(sheet.shape.kind, "datasheet", seen), ()
    if sheet.bottom == "flat" or (sheet.bottom is None and sheet.cone == 0.0):
        return Floor("flat", "datasheet", seen), _against_flat(seen, steepest)
    if sheet.bottom == "cone" or sheet.cone is not None:
        return _cone(calibration, sheet, seen, steepest)
    if calibration.floor.known and calibration.floor.evidence != "steep":
        return replace(calibration.floor, seen=seen), ()
    if is_proof(seen, steepest):
        hidden, reach = _hidden(calibration, seen), calibration.cone_reach
        unproved = Floor(seen=seen, reach=reach)
        return (unproved if hidden is None else Floor("cone", "steep", seen, hidden, reach=reach)), ()
    return Floor(seen=seen), ()


def _hidden(calibration: Calibration, seen: SeenCone | None) -> float | None:
    """Standard deviation of the volume by what was not seen of a steep cone; None where it could matter.

    A cone proves itself only where it was seen bare: towards the axis another stage may follow, towards the wall a
    flatter one may come before. The largest volumes between are the cone's tip, and the ring down to a slope of feed.
    """
    reach, radius = calibration.cone_reach, calibration.silo.radius
    if reach is None or seen is None:
        return None
    (near, far), slope = reach, math.tan(seen.angle)
    wall = far if radius is None else max(radius, far)
    tip = math.pi * near**3 * slope / 3.0
    ring = 2.0 * math.pi * (slope - FLATTEST_STAGE) * ((wall**3 - far**3) / 3.0 - far * (wall**2 - far**2) / 2.0)
    depth = max(calibration.silo.cylinder_bottom or 0.0, 0.0)
    whole = math.pi * wall**2 * (depth + wall * slope / 3.0)
    if max(tip, ring) > LARGEST_HIDDEN * whole:
        return None
    return math.hypot(tip, ring) / math.sqrt(3.0)


def with_floor(found: Calibration, bottom: str | None, before: Calibration | None) -> Calibration:
    """With the bottom for a calibration to keep: what it is told now, else was told earlier, else has proved."""
    told = found if before is None or not found.ok else replace(found, floor=before.floor)
    floor = floor_of(told, Datasheet(bottom=bottom))[0]
    return replace(with_cone(found) if has_seen_cone(floor) else found, floor=floor)


def has_seen_cone(floor: Floor) -> bool:
    """Whether the conical surface that was seen is the bottom."""
    return floor.kind == "cone" and floor.seen is not None


def with_cone(calibration: Calibration) -> Calibration:
    """The calibration whose silo has the conical surface that was seen as its bottom."""
    values, covariance = calibration.parameters, calibration.parameter_covariance
    if values is None or covariance is None or calibration.silo.apex is not None or not np.isfinite(values[5:7]).all():
        return calibration
    radius = float(values[4]) if np.isfinite(values[4]) else None
    silo, silo_std = geometry_of(radius, (float(values[5]), float(values[6])), covariance)
    return replace(calibration, silo=silo, silo_std=silo_std)


def seen_cone(calibration: Calibration) -> SeenCone | None:
    """The conical surface of a calibration; None where it has none."""
    if calibration.parameters is not None and calibration.parameters[5] > 0.0:
        across = float(calibration.parameters[5])  # dr/dz
        variance = 0.0 if calibration.parameter_covariance is None else calibration.parameter_covariance[5, 5]
        return SeenCone(math.atan2(1.0, across), math.sqrt(max(float(variance), 0.0)) / (1.0 + across**2))
    silo = calibration.silo
    if silo.radius is None or silo.cylinder_bottom is None or silo.apex is None:
        return None
    return SeenCone(math.atan2(silo.apex - silo.cylinder_bottom, silo.radius), 0.0)


def is_proof(seen: SeenCone | None, steepest: float) -> bool:
    """Whether a surface is steeper than feed can lie."""
    return seen is not None and seen.angle - PROOF_STD * seen.std > steepest


def _cone(
    calibration: Calibration, sheet: Datasheet, seen: SeenCone | None, steepest: float
) -> tuple[Floor, tuple[Remark, ...]]:
    """A cone, by its lengths or by a word about the one that was seen."""
    radius = calibration.silo.radius if sheet.diameter is None else sheet.diameter / 2.0
    if not sheet.cone:
        return Floor("cone", "told" if seen else "datasheet", seen), ()
    if seen is None or radius is None:
        return Floor("cone", "datasheet", seen), ()
    angle = math.atan2(sheet.cone, radius)
    std = math.hypot(seen.std, LENGTH_STD / math.hypot(sheet.cone, radius))
    if abs(angle - seen.angle) <= CONTRADICTION_STD * std:
        return Floor("cone", "datasheet", seen), ()
    numbers = f"the datasheet's cone lies at {math.degrees(angle):.1f}°, the surface seen at "
    numbers += f"{math.degrees(seen.angle):.1f} ± {math.degrees(seen.std):.1f}°"
    if is_proof(seen, steepest):
        return Floor("cone", "steep", seen), (Remark("vessel-contradicted", f"{numbers}, and counts"),)
    taken = Remark("vessel-contradicted", f"{numbers}, and is taken for feed")
    return Floor("cone", "datasheet"), (taken,)


def _against_flat(seen: SeenCone | None, steepest: float) -> tuple[Remark, ...]:
    """A surface steeper than feed contradicts a flat floor."""
    if seen is None or not is_proof(seen, steepest):
        return ()
    numbers = f"the floor is given as flat, but a conical surface of {seen} was seen, steeper than feed lies"
    return (Remark("vessel-contradicted", numbers),)


def settles(floor: Floor, missing: tuple[str, ...]) -> str:
    """The sentence that says why there is no volume, and the one thing that would settle it."""
    lacking = ", ".join(missing)
    if floor.map is not None and "floor" in missing:
        return (
            f"Volume unavailable: {100 * floor.map.seen:.0f} % of the floor was seen, too little for a volume; "
            "add frames of the empty vessel (--empty FRAME) that look at its middle, or give --vessel FILE."
        )
    if floor.known:
        options = " and ".join(f"--{name.replace('_', '-')}" for name in missing if name in GIVEN)
        remedy = f"give {options}" if options else "calibrate with frames of a lower level"
        return f"Volume unavailable: of the {floor.kind} bottom the {lacking} is not known; {remedy}."
    if floor.seen is not None and floor.seen.angle > STEEPEST_REPOSE:
        if floor.reach is None:
            return (
                f"Volume unavailable: how far the steep surface ({floor.seen}) was seen bare is not recorded in this "
                "calibration, which an earlier version made; say --bottom cone if it is one cone, or calibrate again."
            )
        return (
            f"Volume unavailable: only a part of the steep surface ({floor.seen}) was seen bare, another stage may "
            "follow; say --bottom cone if it is one cone, or calibrate with a frame of the empty vessel (--empty)."
        )
    if floor.seen is None:
        return (
            "Volume unavailable: the bottom was never seen; calibrate with a frame of the empty vessel (--empty FRAME)."
        )
    return (
        f"Volume unavailable: the conical surface seen ({floor.seen}) may be the bottom or feed; "
        "say which with --bottom cone or --bottom flat."
    )


GIVEN = ("top", "cylinder", "cone", "diameter")
"""Lengths that have an option of their own."""
