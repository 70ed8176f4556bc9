"""Bottoms of a datasheet that are neither a coaxial cone nor flat, as depths under the cylinder's lower edge."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from siloscope.types.floor import FloorMap
from siloscope.vessel.limits import LENGTH_STD

SIDE = 160
"""Cells of a floor's map along a side: what a kink loses between two cells is below 1e-5 of the capacity."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Bottom:
    """A bottom under a cylinder of a radius; lengths in m, angles in radians."""

    kind: ClassVar[str]
    height: float
    """From the cylinder's lower edge to the lowest point, before an outlet cuts it."""
    outlet_diameter: float = 0.0
    """Diameter (side, of a pyramid; width, of a wedge) of the outlet that ends it; 0 for none."""

    def depth(self, x: Array, y: Array, radius: float) -> Array:
        """Depth under the cylinder's lower edge at places within the wall."""
        raise NotImplementedError

    def floor_map(self, radius: float, edge: float) -> FloorMap:
        """The floor on a grid, with what a deviation of each of its lengths does."""
        x, y = FloorMap.middles(radius, SIDE)
        depth = self.depth(x, y, radius)
        variance = np.zeros_like(depth)
        for entry in fields(self):
            if entry.type in ("float", float) and entry.name not in ("azimuth", "outlet_diameter"):
                moved = replace(self, **{entry.name: getattr(self, entry.name) + LENGTH_STD})
                variance += (moved.depth(x, y, radius) - depth) ** 2
        return FloorMap(radius, edge + depth, np.sqrt(variance))


@dataclass(frozen=True)
class Oblique(Bottom):
    """A cone whose vertex lies aside: its circles' centres run from the axis to the vertex."""

    kind: ClassVar[str] = "oblique"
    outlet_x: float = 0.0
    outlet_y: float = 0.0
    """Where the vertex lies."""

    def depth(self, x: Array, y: Array, radius: float) -> Array:
        """The fraction s of the height at which |p - s o| = R (1 - s)."""
        aside = self.outlet_x**2 + self.outlet_y**2
        along = x * self.outlet_x + y * self.outlet_y
        a, b, c = aside - radius**2, radius**2 - along, x**2 + y**2 - radius**2
        root = np.sqrt(np.maximum(b**2 - a * c, 0.0))
        fraction = -c / np.maximum(b + root, 1e-12)
        end = 1.0 - self.outlet_diameter / (2.0 * radius)
        return np.asarray(self.height * np.clip(fraction, 0.0, end))


@dataclass(frozen=True)
class TwoStage(Bottom):
    """Two coaxial cones, one below the other."""

    kind: ClassVar[str] = "two-stage"
    upper: float = 0.0
    """Height of the upper one; `height` is that of both."""
    waist_diameter: float = 0.0
    """Where they meet."""

    def depth(self, x: Array, y: Array, radius: float) -> Array:
        """Linear in the distance from the axis, with a kink at the waist."""
        waist, across = self.waist_diameter / 2.0, np.hypot(x, y)
        places = np.array([self.outlet_diameter / 2.0, waist, radius])
        lower = self.height - self.upper
        end = self.upper + lower * (1.0 - self.outlet_diameter / (2.0 * waist))
        return np.asarray(np.interp(across, places, [end, self.upper, 0.0]))


@dataclass(frozen=True)
class Pyramid(Bottom):
    """Four sides that touch the wall at the cylinder's lower edge; a round wall cuts their corners."""

    kind: ClassVar[str] = "pyramid"
    azimuth: float = 0.0
    """Direction in which one side falls, from the silo frame's x."""

    def depth(self, x: Array, y: Array, radius: float) -> Array:
        """Linear in the larger of the distances along two horizontal axes."""
        c, s = math.cos(self.azimuth), math.sin(self.azimuth)
        return self._fall(np.maximum(np.abs(c * x + s * y), np.abs(c * y - s * x)), radius)

    def _fall(self, reach: Array, radius: float) -> Array:
        end = 1.0 - self.outlet_diameter / (2.0 * radius)
        return np.asarray(self.height * np.clip(1.0 - reach / radius, 0.0, end))


@dataclass(frozen=True)
class Wedge(Pyramid):
    """Two sides that meet in a trough across the vessel."""

    kind: ClassVar[str] = "wedge"

    def depth(self, x: Array, y: Array, radius: float) -> Array:
        """Linear in the distance from the trough."""
        return self._fall(np.abs(math.cos(self.azimuth) * x + math.sin(self.azimuth) * y), radius)
