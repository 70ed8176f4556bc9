"""Draws of vessels, feeds, clutter and cameras from wide ranges. Nothing is read back from the product."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from .bottoms import Cone, Flat
from .cameras import Intrinsics, Pose, looking
from .clutter import Bar, Ladder
from .feed import Feed, Tip
from .scenes import Vessel
from .sensors import ASTRA_S, Faults, Sensor
from .solids import Solid
from .walls import Relief, Wall

CALIBRATED = (0.002, 1.0, 0.003)
"""Standard deviations of a calibrated camera's f (relative), c (pixels), k1: the contract's."""


@dataclass(frozen=True)
class View:
    """What a frame must show to be of its kind, and how the camera may stand."""

    wall: tuple[float, float] = (0.2, 0.95)
    """Share of the readings that shows the wall."""
    bottom: float = 0.0
    """Least share that shows the bottom."""
    feed: float = 0.0
    """Least share that shows feed."""
    arc: tuple[float, float] = (75.0, 360.0)
    """Degrees of the circle on which wall is seen."""
    tilt: tuple[float, float] | None = None
    """Degrees between optical axis and gravity; None where the camera looks at the bottom."""
    aside: tuple[float, float] = (0.05, 0.85)
    """Distance from the axis as a share of the radius that is free."""
    valid: float = 0.5
    """Least share of the pixels within the sensor's range."""


@dataclass(frozen=True)
class Plan:
    """A scene without its camera's pose."""

    vessel: Vessel | None
    feed: Feed | None = None
    things: tuple[Solid, ...] = ()
    view: View = field(default_factory=View)
    sensor: Sensor = ASTRA_S
    faults: Faults = field(default_factory=Faults)
    off: Intrinsics | None = None
    """How far the told intrinsics are off in place of the draw of a calibrated camera: width and height are 0."""
    poses: tuple[Pose, ...] = ()
    """Poses to choose from where there is no vessel."""


class Draw:
    """A random generator that knows silos."""

    def __init__(self, seed: Sequence[int]) -> None:
        self.rng = np.random.default_rng(seed)

    def between(self, low: float, high: float) -> float:
        """A number between two."""
        return float(self.rng.uniform(low, high))

    def log(self, low: float, high: float) -> float:
        """A positive number whose logarithm is even."""
        return math.exp(self.between(math.log(low), math.log(high)))

    def angle(self) -> float:
        """A direction, rad."""
        return self.between(-math.pi, math.pi)

    def slope(self, low: float, high: float) -> float:
        """Tangent of an angle between two, in degrees."""
        return math.tan(math.radians(self.between(low, high)))

    def chance(self, share: float) -> bool:
        """True with a probability."""
        return bool(self.rng.uniform() < share)

    def sign(self) -> float:
        """-1 or 1."""
        return 1.0 if self.chance(0.5) else -1.0

    def around(self, length: float) -> tuple[float, float]:
        """A vector of a length in a random direction."""
        azimuth = self.angle()
        return length * math.cos(azimuth), length * math.sin(azimuth)

    def radius(self) -> float:
        """Of a silo: 0.8 to 6 m, four of five below 2.6 m."""
        return self.log(0.8, 2.6) if self.chance(0.8) else self.between(2.6, 6.0)

    def shell(self, radius: float | None = None, tall: tuple[float, float] = (1.0, 3.5)) -> tuple[float, float, float]:
        """(radius, top, rim) of a cylinder, up to 6 m high."""
        radius = radius or self.radius()
        height = min(max(radius * self.between(*tall), 1.0), 6.0)
        top = -self.between(0.0, 0.4)
        return radius, top, top + height

    def cone(self, radius: float, rim: float, steep: tuple[float, float] = (38.0, 62.0), **more: object) -> Cone:
        """A hopper of an angle to the horizontal, with an outlet."""
        outlet = radius * self.between(0.04, 0.15)
        return Cone(rim, radius, radius * self.slope(*steep), outlet, **more)  # type: ignore[arg-type]

    def silo(self, *reliefs: Relief, radius: float | None = None) -> Vessel:
        """A cylinder on a coaxial cone."""
        radius, top, rim = self.shell(radius)
        return Vessel(Wall(radius, reliefs), self.cone(radius, rim), top)

    def bin(self) -> Vessel:
        """A cylinder on a flat floor."""
        radius, top, rim = self.shell(tall=(0.8, 2.5))
        return Vessel(Wall(radius), Flat(rim), top)

    def waves(self, highest: float = 0.015) -> tuple[tuple[float, float, float, float], ...]:
        """Unevenness of feed: three waves of 0.2 to 1.2 m."""
        found = []
        for _ in range(3):
            number = 2.0 * math.pi / self.log(0.2, 1.2)
            found.append((self.between(0.0, highest), *self.around(number), self.angle()))
        return tuple(found)

    def feed(self, vessel: Vessel, low: float = 0.45) -> Feed | None:
        """Any usual feed, at a level between the share `low` of the cylinder's height and the bottom; or none."""
        radius, rim, lowest = vessel.wall.radius, vessel.bottom.rim, vessel.bottom.lowest
        level = self.between(max(0.7, vessel.top + low * (rim - vessel.top)), max(lowest - 0.1, 0.8))
        kind = str(self.rng.choice(["none", "level", "tilted", "pile", "funnel"], p=[0.1, 0.2, 0.2, 0.25, 0.25]))
        waves = self.waves() if self.chance(0.6) else ()
        if kind == "none":
            return None
        if kind == "level":
            return Feed(level, waves=waves)
        if kind == "tilted":
            return Feed(max(level, 0.6 + 0.4 * radius), self.around(self.slope(2.0, 20.0)), waves=waves)
        slope, aside = self.slope(15.0, 34.0), self.around(radius * self.between(0.0, 0.35))
        if kind == "pile":
            return Feed(level, tip=Tip(*aside, level, slope, rounded=0.1 * radius), waves=waves)
        return Feed(level, tip=Tip(*aside, level + slope * radius, -slope, rounded=0.05 * radius), waves=waves)

    def ring(self, vessel: Vessel, steep: tuple[float, float] = (22.0, 36.0), aside: float = 0.06) -> Feed:
        """Dead feed along the wall of a flat floor: it rises from a bare or pointed middle."""
        radius, rim = vessel.wall.radius, vessel.bottom.rim
        slope, bare = self.slope(*steep), radius * self.between(0.0, 0.35)
        middle = self.around(radius * self.between(0.0, aside))
        return Feed(rim, tip=Tip(*middle, rim + slope * bare, -slope), waves=self.waves(0.006))

    def clutter(self, vessel: Vessel) -> tuple[Solid, ...]:
        """Ladder, cables and a beam, at least one of them."""
        radius, rim, top = vessel.wall.radius, vessel.bottom.rim, vessel.top
        things: list[Solid] = []
        if self.chance(0.6):
            things.append(Ladder(radius - self.between(0.1, 0.2), self.angle(), rim - self.between(0.0, 0.4)))
        for _ in range(int(self.rng.integers(0, 5))):
            x, y = self.around(radius * self.between(0.2, 0.85))
            lean = self.rng.normal(0.0, 0.02, 2)
            things.append(Bar((x, y, top), (x + lean[0], y + lean[1], rim), self.between(0.003, 0.008)))
        if not things or self.chance(0.5):
            azimuth, z = self.angle(), self.between(0.55, 0.9) * rim
            aside = radius * self.between(-0.6, 0.6)
            ends = [(aside, -1.2 * radius), (aside, 1.2 * radius)]
            c, s = math.cos(azimuth), math.sin(azimuth)
            start, end = ((c * a - s * b, s * a + c * b, z) for a, b in ends)
            things.append(Bar(start, end, self.between(0.03, 0.09)))
        return tuple(things)

    def auger(self, vessel: Vessel) -> Bar:
        """A sweep auger from the middle to the wall on a flat floor."""
        thick, end = self.between(0.06, 0.14), self.around(0.92 * vessel.wall.radius)
        z = vessel.bottom.rim - thick - self.between(0.0, 0.08)
        return Bar((0.0, 0.0, z), (*end, z), thick)

    def place(self, vessel: Vessel, view: View) -> Pose:
        """A camera in the vessel that looks at its bottom, or as far up as the view says."""
        free = vessel.wall.radius - vessel.wall.inmost - 0.08
        place = self.around(free * self.between(*view.aside))
        distance = math.hypot(*place) or 1.0
        if view.tilt is None:
            across = vessel.wall.radius * self.between(-0.2, 0.7) / distance
            aim = vessel.bottom.rim * self.between(0.75, 1.1)
            miss = self.rng.normal(0.0, 0.1 * vessel.wall.radius, 2)
            return looking(place, (-across * place[0] + miss[0], -across * place[1] + miss[1], aim))
        tilt, azimuth = (
            math.radians(self.between(*view.tilt)),
            math.atan2(-place[1], -place[0]) + self.between(-0.6, 0.6),
        )
        x, y = math.sin(tilt) * math.cos(azimuth), math.sin(tilt) * math.sin(azimuth)
        return looking(place, (place[0] + x, place[1] + y, math.cos(tilt)))

    def intrinsics(self, sensor: Sensor, width: int, off: Intrinsics | None) -> tuple[Intrinsics, Intrinsics]:
        """(true, told): the told ones are nominal, the true ones off by a calibration's deviations or by `off`."""
        f, height = sensor.focal * width, width * 3 // 4
        told = Intrinsics(width, height, f, f, 0.5 * (width - 1), 0.5 * (height - 1))
        if off is None:
            n, (df, dc, dk) = self.rng.normal(size=5), CALIBRATED
            off = Intrinsics(0, 0, df * n[0], df * n[1], dc * n[2], dc * n[3], dk * n[4])
        true = Intrinsics(
            width, height, f * (1 + off.fx), f * (1 + off.fy), told.cx + off.cx, told.cy + off.cy, told.k1 + off.k1
        )
        return true, told
