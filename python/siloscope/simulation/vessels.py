"""A vessel's file as a silo of the simulator."""

from __future__ import annotations

import math

from siloscope.errors import UsageError
from siloscope.schema.vessel import Bottom, VesselFile
from siloscope.simulation.content import content_of
from siloscope.simulation.defects import Bar, Defects
from siloscope.simulation.feed import Feed
from siloscope.simulation.silo import BOTTOMS, Silo


def silo_of(vessel: VesselFile) -> Silo:
    """The silo; its upper edge is at the camera's height where the file does not say.

    Raises
    ------
    UsageError
        For a file that leaves open what a frame depends on, or a vessel that can't be simulated.
    """
    if vessel.outline is not None:
        raise UsageError("a vessel that is not round can't be simulated; leave 'outline' out and give 'diameter'")
    diameter, cylinder, bottom = vessel.diameter, vessel.cylinder, vessel.bottom
    if diameter is None or cylinder is None or bottom is None:
        raise UsageError("a simulated vessel needs 'diameter', 'cylinder' and [bottom]; docs/vessels.md has an example")
    _check(bottom)
    courses, radius = _courses(vessel, diameter, cylinder)
    x, y = bottom.vertex
    return Silo(
        radius=radius,
        cylinder_height=cylinder,
        cone_height=bottom.height or 0.0,
        outlet_radius=0.5 * (vessel.outlet.diameter if vessel.outlet else bottom.outlet),
        top=vessel.top or 0.0,
        outlet_length=vessel.outlet.length if vessel.outlet else 0.0,
        outlet_offset=(x, y) if bottom.kind == "oblique" else (0.0, 0.0),
        roof=vessel.roof is not None,
        roof_height=vessel.roof.height if vessel.roof else 0.0,
        bottom=bottom.kind,
        waist_radius=0.5 * (bottom.waist or 0.0),
        waist_depth=bottom.upper or 0.0,
        bottom_azimuth=math.radians(bottom.azimuth),
        courses=courses,
    )


def _check(bottom: Bottom) -> None:
    """Refuses a bottom that can't be simulated."""
    if bottom.kind not in BOTTOMS:
        raise UsageError(f"a bottom of kind '{bottom.kind}' can't be simulated; known are {', '.join(BOTTOMS)}")
    if bottom.kind != "flat" and bottom.height is None:
        raise UsageError(f"a simulated {bottom.kind} needs the 'height' of [bottom]")


def _courses(vessel: VesselFile, diameter: float, cylinder: float) -> tuple[tuple[tuple[float, float], ...], float]:
    """Rings above the lowest one, from above, as (lower edge below the upper one, radius), and the lowest one's radius.

    What the file's courses leave of the cylinder, from below, has the vessel's diameter.
    """
    rows = sorted(((course.bottom, 0.5 * course.diameter) for course in vessel.course), reverse=True)
    if not rows or rows[-1][0] > 0.0:
        rows.append((0.0, 0.5 * diameter))
    return tuple((cylinder - lower, radius) for lower, radius in rows[:-1]), rows[-1][1]


def defects_of(vessel: VesselFile, silo: Silo) -> Defects | None:
    """The obstacles at their places in the silo, or None where there are none."""
    rim = silo.cylinder_bottom

    def bar(start: tuple[float, ...], end: tuple[float, ...], radius: float) -> Bar:
        return start[0], start[1], rim - start[2], end[0], end[1], rim - end[2], radius

    bars = tuple(bar(each.start, each.end, 0.5 * each.diameter) for each in vessel.obstacle)
    return Defects(bars=bars) if bars else None


def ullage(vessel: VesselFile, silo: Silo, volume: float) -> float:
    """Free volume below the fill height, m³, over feed of a volume that lies below it."""
    if vessel.fill_height is None:
        return silo.capacity - volume
    level = (vessel.fill_height + silo.cone_height) / silo.height
    return content_of(silo, Feed("flat", level)).volume - volume
