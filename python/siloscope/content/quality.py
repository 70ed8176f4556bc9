"""What may be wrong with a reading: a stable code for each case, what it means, and what to do."""

from __future__ import annotations

import numpy as np

from siloscope.content.measured import Measured
from siloscope.types.remark import Remark

LEAST_COVERAGE = 0.05
"""Share of the surface that must be seen."""
PARTLY = 1.0 / 3.0
"""Below this share a reading carries the remark that it is partly seen."""
LARGEST_STD = 0.1
"""Largest standard deviation that still is an answer, as a share of the capacity."""
BURIED = 0.5
"""Share of the returns that are too near."""
DUSTY = 0.01
"""Share of floating returns, each alone, among those over the surface."""
BLIND = 0.25
"""Share of the picture's tiles that should show the silo and don't."""
OBSTRUCTED = 0.01
"""Share of floating returns in groups, or of the silo's area under things that are no surface."""
OUTSIDE = 0.03
"""Share of the returns outside the silo's wall that no clean view has."""
SUNKEN = 0.1
"""Share of the seen cells below the floor with which calibration and frame do not belong together."""
SHIFTED = 3.0
"""Standard deviations by which the wall must have moved."""
EXPLAINED = 0.5
"""Share of the wall's mean square distance that the move must take away; feed on the wall looks like a move, too."""
MATTERS = 3.0
"""A move of the camera refuses the reading where it changes the volume by so many standard deviations."""


def remarks(found: Measured, coverage: float | None, capacity: float | None, area: float) -> list[Remark]:
    """The remarks on what the core found in a frame; `area` is the silo's cross-section, m²."""
    return [
        *_sight(found),
        *_coverage(found, coverage, capacity),
        *_floating(found, area),
        *_shape(found),
        *_wall(found),
    ]


def _sight(found: Measured) -> list[Remark]:
    sight = found.core.visibility
    made = []
    if sight.near > BURIED:
        made.append(Remark("sensor-buried", f"{100 * sight.near:.0f} % of the returns are too near", True))
    if sight.blind > BLIND:
        made.append(Remark("lens-film", f"{100 * sight.blind:.0f} % of the picture is blind"))
    if sight.measured == 0.0:
        made.append(Remark("too-little-seen", "no pixel has a depth", True))
    return made


def _coverage(found: Measured, coverage: float | None, capacity: float | None) -> list[Remark]:
    if found.core.visibility.measured == 0.0:
        return []
    if coverage is None:
        return [Remark("too-little-seen", "no surface could be fitted", True)]
    seen = f"{100 * coverage:.0f} % of the surface is seen"
    if coverage < LEAST_COVERAGE:
        return [Remark("too-little-seen", seen, True)]
    std = found.total
    if capacity and std > LARGEST_STD * capacity:
        return [Remark("too-little-seen", f"{seen}; the deviation is {100 * std / capacity:.0f} % of the silo", True)]
    return [Remark("partly-seen", seen)] if coverage < PARTLY else []


def _floating(found: Measured, area: float) -> list[Remark]:
    returns, things = found.core.returns, found.core.things
    over = max(returns.total - returns.wall - returns.outside, 1.0)
    hanging = sum(thing.area for thing in things) / area
    loose, grouped = (returns.above - returns.coherent) / over, returns.coherent / over
    made = []
    if loose > DUSTY and loose > grouped:
        made.append(Remark("dust-or-fog", f"{100 * loose:.1f} % of the returns float alone"))
    free = sum(thing.area for thing in things if not thing.at_wall) / area
    if free > OBSTRUCTED or grouped > max(OBSTRUCTED, loose):
        seen = f"{100 * max(free, grouped):.1f} % of the view is taken"
        made.append(Remark("obstruction", seen))
    if hanging - free > OBSTRUCTED:
        made.append(Remark("stuck-feed", f"over {100 * (hanging - free):.1f} % of the silo's area"))
    return made


def _shape(found: Measured) -> list[Remark]:
    hole = max(found.core.holes, key=lambda hole: (hole.area, hole.above), default=None)
    return [] if hole is None else [Remark("rathole", f"a hole of {hole.area:.2f} m², {-hole.above:.2f} m deep")]


def _wall(found: Measured) -> list[Remark]:
    sunken = found.sunken
    below = [Remark("below-the-floor", f"{100 * sunken:.0f} % of the cells", True)] if sunken > SUNKEN else []
    return [*_moved(found), *below]


def _moved(found: Measured) -> list[Remark]:
    returns, shift = found.core.returns, found.core.shift
    share = returns.outside / max(returns.total, 1.0)
    if share > OUTSIDE:
        return [Remark("camera-moved", f"{100 * share:.0f} % of the returns lie outside the wall", True)]
    if shift is None:
        return []
    change = shift.change
    sigmas = max(abs(c) / s for c, s in zip(change, shift.std, strict=True))
    if sigmas < SHIFTED or shift.rms_after**2 > (1.0 - EXPLAINED) * shift.rms_before**2:
        return []
    moved = 1e3 * (change[2] ** 2 + change[3] ** 2) ** 0.5
    turned = 1e3 * (change[0] ** 2 + change[1] ** 2) ** 0.5
    refuses = move_matters(found) > MATTERS * max(found.total, 1e-9)
    return [Remark("camera-moved", f"by {moved:.1f} mm and {turned:.2f} mrad, {sigmas:.0f} deviations", refuses)]


def move_matters(found: Measured) -> float:
    """By how much the wall's apparent move would change the volume, m³."""
    shift = found.core.shift
    return 0.0 if shift is None else abs(float(np.dot(shift.change, found.core.derivatives[:4])))
