"""Places under a roof, and directions in which a camera may look from them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from siloscope.planning.view import Interior
from siloscope.types.pose import SiloPose

RINGS = (0.0, 0.3, 0.55, 0.8)
"""Distances from the axis, as fractions of the radius."""
SPOKES = 6
"""Azimuths, for vessels that are not of revolution."""
AIMS = {"straight down": None, "at half the depth of the axis": 0.5, "at the foot of the opposite wall": 1.0}
"""Directions by name; the fraction is that of the depth at which the line of sight crosses the axis or ends."""


@dataclass(frozen=True)
class Placement:
    """A camera's place and direction."""

    x: float
    y: float
    """Place beside the axis, m."""
    aim: str
    """Where it looks, by name."""
    pose: SiloPose

    @property
    def tilt(self) -> float:
        """Angle between the line of sight and gravity, radians."""
        return math.acos(min(1.0, math.cos(self.pose.r_x) * math.cos(self.pose.r_y)))

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "x": self.x,
            "y": self.y,
            "aim": self.aim,
            "tilt": self.tilt,
            "r_x": self.pose.r_x,
            "r_y": self.pose.r_y,
        }


def placements(inside: Interior) -> Iterator[Placement]:
    """All places and directions that are compared."""
    for ring in RINGS:
        spokes = 1 if inside.round or ring == 0.0 else SPOKES
        for spoke in range(spokes):
            turn = 2.0 * math.pi * spoke / spokes
            x, y = ring * inside.radius * math.cos(turn), ring * inside.radius * math.sin(turn)
            for name in AIMS:
                yield Placement(x, y, name, aimed(inside, x, y, name))


def aimed(inside: Interior, x: float, y: float, name: str) -> SiloPose:
    """Pose of a camera at (x, y, 0) that looks in a direction."""
    fraction = AIMS[name]
    if fraction is None:
        return SiloPose(0.0, 0.0, x, y)
    if fraction < 1.0:
        return looking(x, y, (0.0, 0.0, fraction * inside.edge))
    away = math.hypot(x, y)
    direction = (-x / away, -y / away) if away > 0.0 else (1.0, 0.0)
    return looking(x, y, (direction[0] * inside.radius, direction[1] * inside.radius, inside.edge))


def looking(x: float, y: float, target: tuple[float, float, float]) -> SiloPose:
    """Pose of a camera at (x, y, 0) that looks at a point of the silo frame.

    The line of sight is the third column of Eq. 5, ``(cos r_x sin r_y, -sin r_x, cos r_x cos r_y)``.
    """
    a, b, c = target[0] - x, target[1] - y, target[2]
    return SiloPose(-math.asin(b / math.hypot(a, b, c)), math.atan2(a, c), x, y)
