"""Kinds of silos that are what they are: vessels, walls, feed."""

from __future__ import annotations

import math

from .bottoms import Cone, Flat, Pyramid, TwoStage
from .drawing import Draw, Plan, View
from .feed import Feed, Tip
from .scenes import Vessel
from .sensors import Faults
from .walls import Bend, Cake, Corrugation, Courses, Patch, Relief, Round, Wall

CONE_SEEN = View(wall=(0.12, 0.85), bottom=0.1)
"""Both parts are in view."""


def control(d: Draw) -> Plan:
    """A cylinder on a coaxial cone with any usual feed."""
    vessel = d.silo()
    return Plan(vessel, d.feed(vessel))


def corrugated(d: Draw) -> Plan:
    """Sinusoidal sheet."""
    vessel = d.silo(Corrugation(d.between(0.006, 0.014), d.between(0.068, 0.11), d.angle()))
    return Plan(vessel, d.feed(vessel))


def clutter(d: Draw) -> Plan:
    """Ladder, cables, beam."""
    vessel = d.silo()
    return Plan(vessel, d.feed(vessel), d.clutter(vessel), faults=Faults(flying=0.5))


def oval(d: Draw) -> Plan:
    """Out of round by 0.2 to 1.5 % of the radius, with some of order 3."""
    radius = d.radius()
    reliefs = (Round(2, radius * d.log(0.002, 0.015), d.angle()), Round(3, d.between(0.0, 0.003), d.angle()))
    vessel = d.silo(*reliefs, radius=radius)
    return Plan(vessel, d.feed(vessel))


def _patched(d: Draw, thickness: float, half: tuple[float, float], edge: float, sticks: bool, wave: float) -> Plan:
    radius, top, rim = d.shell()
    z = rim - d.between(0.1, 0.7) * (rim - top)
    relief = Patch(thickness, d.angle(), z, (half[0], half[1]), edge, sticks, wave)
    vessel = Vessel(Wall(radius, (relief,)), d.cone(radius, rim), top)
    return Plan(vessel, d.feed(vessel))


def dent(d: Draw) -> Plan:
    """One dent of 20 to 60 mm."""
    radius = d.between(0.3, 0.9)
    return _patched(d, d.between(0.02, 0.06), (radius / 1.5, radius), 1.0, False, 0.0)


def build_up_on_wall(d: Draw) -> Plan:
    """Feed sticks to one side of the wall, 15 to 60 mm thick over a tenth to four tenths of the circle."""
    half = (math.pi * d.between(0.1, 0.4), d.between(0.4, 1.5))
    return _patched(d, d.between(0.015, 0.06), half, d.between(0.15, 0.6), True, d.between(0.0, 0.3))


def build_up_on_cone(d: Draw) -> Plan:
    """Feed sticks to one side of the cone."""
    radius, top, rim = d.shell()
    height = radius * d.slope(45.0, 62.0)
    half = (math.pi * d.between(0.15, 0.4), height * d.between(0.2, 0.45))
    relief = Patch(d.between(0.015, 0.06), d.angle(), rim + 0.45 * height, half, 0.4, True, 0.2)
    cone = Cone(rim, radius, height, radius * d.between(0.04, 0.15), reliefs=(relief,))
    vessel = Vessel(Wall(radius), cone, top)
    low = Feed(d.between(rim + 0.5 * height, cone.lowest)) if d.chance(0.6) else None
    return Plan(vessel, low, view=CONE_SEEN)


def opening(d: Draw) -> Plan:
    """A large outlet in view."""
    radius, top, rim = d.shell()
    cone = Cone(rim, radius, radius * d.slope(40.0, 60.0), radius * d.between(0.2, 0.4))
    return Plan(Vessel(Wall(radius), cone, top), view=CONE_SEEN)


def near_wall(d: Draw) -> Plan:
    """The camera hangs at the wall."""
    vessel = d.silo()
    return Plan(vessel, d.feed(vessel), view=View(aside=(0.93, 1.0)))


def flat_empty(d: Draw) -> Plan:
    """A flat floor, empty."""
    return Plan(d.bin(), view=CONE_SEEN)


def flat_ring(d: Draw) -> Plan:
    """A flat floor with a ring of dead feed."""
    vessel = d.bin()
    return Plan(vessel, d.ring(vessel), view=View(wall=(0.12, 0.85), feed=0.1))


def flat_ring_auger(d: Draw) -> Plan:
    """The same with a sweep auger."""
    vessel = d.bin()
    return Plan(vessel, d.ring(vessel), (d.auger(vessel),), View(wall=(0.12, 0.85), feed=0.1))


def crater(d: Draw) -> Plan:
    """A draw-down crater of 30 to 50 degrees in a flat-bottom bin, on the axis or off it."""
    vessel = d.bin()
    radius, rim, slope = vessel.wall.radius, vessel.bottom.rim, d.slope(30.0, 50.0)
    level = d.between(max(0.8, 0.45 * rim), max(rim - 0.3, 0.9))
    tip = Tip(
        *d.around(radius * d.between(0.0, 0.4)),
        min(level + slope * radius * d.between(0.5, 1.3), rim + 0.3),
        -slope,
        False,
    )
    return Plan(vessel, Feed(level, tip=tip, waves=d.waves(0.008)), view=View(wall=(0.12, 0.85), feed=0.15))


def _oblique(d: Draw, low: float, high: float, view: View, filled: bool = True) -> Plan:
    radius, top, rim = d.shell(tall=(0.8, 2.5))
    cone = d.cone(radius, rim, (45.0, 62.0), offset=d.around(radius * d.log(low, high)))
    feed = Feed(d.between(rim + 0.55 * cone.height, cone.lowest)) if filled and d.chance(0.5) else None
    return Plan(Vessel(Wall(radius), cone, top), feed, view=view)


def oblique(d: Draw) -> Plan:
    """The outlet is 0.2 to 0.5 radii off the axis."""
    return _oblique(d, 0.2, 0.5, CONE_SEEN)


def oblique_small(d: Draw) -> Plan:
    """The outlet is 0.02 to 0.15 radii off the axis."""
    return _oblique(d, 0.02, 0.15, CONE_SEEN)


def oblique_cone_mostly(d: Draw) -> Plan:
    """The same as oblique, with hardly any cylinder in view."""
    return _oblique(d, 0.1, 0.5, View(wall=(0.01, 0.06), bottom=0.5, arc=(0.0, 360.0)), filled=False)


def two_stage(d: Draw) -> Plan:
    """Two cones one below the other; the upper flatter or steeper than the lower."""
    radius, top, rim = d.shell(tall=(0.8, 2.5))
    waist, outlet = radius * d.between(0.35, 0.7), radius * 0.08
    flat, steep = d.slope(32.0, 48.0), d.slope(55.0, 70.0)
    first, second = (flat, steep) if d.chance(0.8) else (steep, flat)
    bottom = TwoStage(rim, radius, (radius - waist) * first, waist, waist * second, outlet)
    feed = Feed(d.between(rim + bottom.upper, bottom.lowest)) if d.chance(0.5) else None
    return Plan(Vessel(Wall(radius), bottom, top), feed, view=CONE_SEEN)


def pyramid(d: Draw) -> Plan:
    """A pyramid under the cylinder."""
    radius, top, rim = d.shell(tall=(0.8, 2.5))
    bottom = Pyramid(rim, radius, radius * d.slope(38.0, 60.0), d.angle(), radius * 0.1)
    feed = Feed(d.between(rim + 0.5 * bottom.height, bottom.lowest)) if d.chance(0.4) else None
    return Plan(Vessel(Wall(radius), bottom, top), feed, view=CONE_SEEN)


def bent(d: Draw) -> Plan:
    """A generatrix bent by 2 to 8 mm; the cone hangs where the wall ends."""
    radius, top, rim = d.shell(tall=(1.5, 3.5))
    height = d.between(0.002, 0.008) * d.sign()
    bend = Bend((height, height * d.between(-0.4, 0.4)), d.angle(), top, rim)
    end = float(bend.shift(rim))
    centre = (end * math.cos(bend.azimuth), end * math.sin(bend.azimuth))
    vessel = Vessel(Wall(radius, (bend,)), d.cone(radius, rim, centre=centre), top)
    return Plan(vessel, d.feed(vessel, 0.7))


def courses(d: Draw) -> Plan:
    """Rings of sheet that step by 2 to 10 mm."""
    radius, top, rim = d.shell(tall=(1.5, 3.5))
    pitch, step = d.between(0.8, 1.5), d.between(0.002, 0.01)
    edges = [top + pitch * (i + d.between(0.0, 0.4)) for i in range(1, 9)]
    edges = [edge for edge in edges if edge < rim - 0.2] or [0.5 * (top + rim)]
    offsets = [step * d.between(-0.5, 0.5) for _ in range(len(edges) + 1)]
    if d.chance(0.4):
        offsets = [-step * (i % 2) for i in range(len(edges) + 1)]
    vessel = Vessel(Wall(radius, (Courses(tuple(edges), tuple(offsets)),)), d.cone(radius, rim), top)
    return Plan(vessel, d.feed(vessel, 0.7))


def feed_as_cone(d: Draw) -> Plan:
    """Feed that lies as steep as the hopper, within 2 degrees, over part of it."""
    radius, top, rim = d.shell(tall=(0.8, 2.5))
    angle = d.between(35.0, 45.0)
    slope, other = (math.tan(math.radians(a)) for a in (angle, angle + d.between(-2.0, 2.0)))
    cone = Cone(rim, radius, radius * slope, radius * 0.08)
    thick = d.between(0.05, 0.4)
    tip = Tip(*d.around(radius * d.between(0.0, 0.03)), cone.apex - thick, -other)
    return Plan(Vessel(Wall(radius), cone, top), Feed(rim, tip=tip), view=View(wall=(0.12, 0.85), feed=0.1))


def _funnel(d: Draw, aside: tuple[float, float]) -> Plan:
    radius, top, rim = d.shell(tall=(1.0, 3.0))
    bottom = d.cone(radius, rim, (48.0, 65.0)) if d.chance(0.6) else Flat(rim)
    slope = d.slope(38.0, 45.0)
    high = max(0.7 + slope * radius, 0.6 * rim)
    z = d.between(high, max(rim + 0.6 * slope * radius, high + 0.1))
    tip = Tip(*d.around(radius * d.between(*aside)), z, -slope)
    return Plan(
        Vessel(Wall(radius), bottom, top),
        Feed(rim, tip=tip, waves=d.waves(0.006)),
        view=View(wall=(0.12, 0.85), feed=0.15),
    )


def funnel(d: Draw) -> Plan:
    """A funnel of feed of 38 to 45 degrees on the axis."""
    return _funnel(d, (0.0, 0.005))


def funnel_aside(d: Draw) -> Plan:
    """The same 0.02 to 0.2 radii off the axis."""
    return _funnel(d, (0.02, 0.2))


def cake(d: Draw) -> Plan:
    """Feed sticks all round the wall."""
    radius, top, rim = d.shell()
    height = (rim - top) * d.between(0.3, 0.8)
    relief = Cake(
        d.between(0.01, 0.06), rim - height, rim - 0.02, int(d.rng.integers(1, 5)), d.angle(), d.between(0.1, 0.8)
    )
    vessel = Vessel(Wall(radius, (relief,)), d.cone(radius, rim), top)
    return Plan(vessel, d.feed(vessel, 0.7), view=View(wall=(0.05, 0.95)))


def level(d: Draw) -> Plan:
    """Level feed high in the cylinder: only wall and a plain are seen."""
    vessel = d.silo()
    z = d.between(max(0.7, 0.35 * vessel.bottom.rim), vessel.bottom.rim)
    return Plan(vessel, Feed(z, d.around(d.slope(0.0, 6.0)), waves=d.waves()))


def farm(d: Draw) -> Plan:
    """A bit of everything at once: bent, stepped, oval, something sticks, clutter, an outlet slightly aside."""
    radius, top, rim = d.shell(tall=(1.2, 3.0))
    reliefs: tuple[Relief, ...] = (
        Bend((d.between(-0.003, 0.003),), d.angle(), top, rim),
        Courses((top + 0.5 * (rim - top),), (0.0, d.between(-0.004, 0.004))),
        Round(2, radius * d.between(0.0, 0.004), d.angle()),
        Patch(d.between(0.0, 0.03) + 1e-3, d.angle(), 0.6 * rim, (0.7, 0.5), 0.5, True, 0.2),
    )
    cone = d.cone(radius, rim, (42.0, 60.0), offset=d.around(radius * d.between(0.0, 0.03)))
    vessel = Vessel(Wall(radius, reliefs), cone, top)
    faults = Faults(dropout=d.between(0.0, 0.3), dust=d.between(0.0, 0.03), flying=0.3)
    return Plan(vessel, d.feed(vessel, 0.6), d.clutter(vessel) if d.chance(0.5) else (), faults=faults)
