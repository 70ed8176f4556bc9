"""Worlds that are no silos, which nothing should be answered for."""

from __future__ import annotations

import math
from collections.abc import Callable

from .cameras import Pose, looking
from .drawing import Draw, Plan
from .feed import Feed, Tip
from .others import Ball, Barrel, Hollow, Plane, Tank, Waves, floor, room, upright
from .sensors import SENSORS, Faults
from .solids import Solid


def _seen(
    d: Draw, things: tuple[Solid, ...], pose: Pose | None = None, feed: Feed | None = None, **faults: float
) -> Plan:
    """A world from a camera that looks down somehow, if nothing else is said."""
    chosen = pose or looking((0.0, 0.0), (*d.around(d.between(0.0, 0.6)), 1.0))
    sensor = SENSORS[int(d.rng.integers(len(SENSORS)))]
    return Plan(None, feed, things, sensor=sensor, faults=Faults(**faults), poses=(chosen,))


def _sides(d: Draw, low: float, high: float) -> tuple[float, float, float, float]:
    return (d.between(low, high), d.between(low, high), d.between(low, high), d.between(low, high))


def a_room(d: Draw) -> Plan:
    """Four walls and a floor."""
    return _seen(d, room(d.angle(), _sides(d, 0.6, 3.0), d.between(1.5, 4.0)))


def corner(d: Draw) -> Plan:
    """Two walls and a floor."""
    azimuth, depth = d.angle(), d.between(1.5, 4.0)
    things = (upright(azimuth, d.between(0.5, 2.0)), upright(azimuth + math.pi / 2, d.between(0.5, 2.0)), floor(depth))
    aim = azimuth + math.pi / 4 + d.between(-0.3, 0.3)
    return _seen(d, things, looking((0.0, 0.0), (math.cos(aim), math.sin(aim), d.between(0.7, 1.6))))


def box(d: Draw) -> Plan:
    """A square bin, empty."""
    side = d.between(0.6, 2.0)
    return _seen(d, room(d.angle(), (side, side, side, side), d.between(1.5, 5.0)))


def box_funnel(d: Draw) -> Plan:
    """A square bin with a funnel of feed."""
    side, slope = d.between(0.7, 2.0), d.slope(28.0, 45.0)
    z = d.between(1.5, 4.0) + slope * side
    feed = Feed(z, tip=Tip(*d.around(0.2 * side), z, -slope), waves=d.waves(0.005))
    return _seen(d, room(d.angle(), (side, side, side, side), 9.0), feed=feed)


def box_pyramid(d: Draw) -> Plan:
    """A square bin on a pyramid."""
    side, rim, slope, azimuth = d.between(0.7, 2.0), d.between(1.0, 3.0), d.slope(40.0, 60.0), d.angle()
    c, s = math.cos(math.atan(slope)), math.sin(math.atan(slope))
    falls = [azimuth + 0.5 * math.pi * i for i in range(4)]
    sides = [Plane((s * math.cos(a), s * math.sin(a), c), s * side + c * rim) for a in falls]
    return _seen(d, (*room(azimuth, (side, side, side, side), 12.0)[:4], *sides))


def ground_crater(d: Draw) -> Plan:
    """A crater in a plain of feed."""
    z, slope = d.between(1.0, 2.5), d.slope(25.0, 45.0)
    tip = Tip(*d.around(d.between(0.0, 0.5)), z + slope * d.between(0.4, 1.5), -slope, False, d.between(0.0, 0.2))
    return _seen(d, (), feed=Feed(z, tip=tip, waves=d.waves(0.01)))


def heap(d: Draw) -> Plan:
    """A heap on a floor."""
    z, slope = d.between(1.5, 4.0), d.slope(20.0, 38.0)
    tip = Tip(*d.around(d.between(0.0, 1.0)), z - slope * d.between(0.4, 1.5), slope, False, d.between(0.0, 0.3))
    tip = Tip(tip.x, tip.y, max(tip.z, 0.7), slope, False, tip.rounded)
    return _seen(d, (), feed=Feed(z, tip=tip, waves=d.waves(0.01)))


def barrel(d: Draw) -> Plan:
    """The inside of a barrel."""
    radius = d.between(0.8, 2.0)
    return _seen(d, (Barrel(radius, d.between(0.5, 2.0), radius * d.between(1.5, 4.0)), floor(d.between(2.0, 5.0))))


def bowl(d: Draw) -> Plan:
    """A bowl."""
    side = d.between(1.0, 3.0)
    return _seen(d, (Hollow((*d.around(0.2), 0.0), (side, side, d.between(1.2, 4.0))),))


def ellipsoid(d: Draw) -> Plan:
    """The inside of an egg of three different axes."""
    radii = (d.between(1.0, 3.0), d.between(1.0, 3.0), d.between(1.5, 4.0))
    return _seen(d, (Hollow((0.0, 0.0, d.between(0.0, 0.5)), radii),))


def tank(d: Draw) -> Plan:
    """A cylinder that lies."""
    radius = d.between(0.8, 2.5)
    return _seen(d, (Tank(radius, d.between(0.3, 0.8) * radius, d.angle(), d.between(-0.3, 0.3) * radius),))


def plane(d: Draw) -> Plan:
    """A plane."""
    tilt, azimuth = d.between(0.0, 0.8), d.angle()
    normal = (math.sin(tilt) * math.cos(azimuth), math.sin(tilt) * math.sin(azimuth), math.cos(tilt))
    return _seen(d, (Plane(normal, d.between(0.7, 4.0)),))


def ball(d: Draw) -> Plan:
    """A ball on a floor."""
    radius = d.between(0.3, 1.0)
    z = 1.0 + 2.0 * radius + d.between(0.0, 1.0)
    return _seen(d, (Ball((*d.around(d.between(0.0, 0.4)), z - radius), radius), floor(z)))


def trench(d: Draw) -> Plan:
    """Two slopes that meet."""
    azimuth, slope = d.angle(), math.atan(d.slope(30.0, 60.0))
    c, s = math.cos(slope), math.sin(slope)
    falls = (azimuth, azimuth + math.pi)
    return _seen(d, tuple(Plane((s * math.cos(a), s * math.sin(a), c), c * d.between(1.5, 3.5)) for a in falls))


def rough_ground(d: Draw) -> Plan:
    """Uneven ground."""
    return _seen(d, (Waves(d.between(1.2, 4.0), d.waves(0.12)),))


def sky(d: Draw) -> Plan:
    """Nothing but some dust."""
    return _seen(d, (), dust=d.between(0.0, 0.3))


NO_SILO: dict[str, Callable[[Draw], Plan]] = {
    plan.__name__: plan
    for plan in (
        a_room, corner, box, box_funnel, box_pyramid, ground_crater, heap, barrel, bowl, ellipsoid, tank, plane, ball,
        trench, rough_ground, sky,
    )
}  # fmt: skip
"""Kinds of worlds that are none, by name."""
