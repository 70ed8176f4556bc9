"""Feed: a surface z = depth(x, y), with everything below it full."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .solids import FEED, Array, Labels, everywhere


@dataclass(frozen=True)
class Tip:
    """An upright axis about which the surface is a cone: `slope` is positive for a pile, negative for a funnel.

    The surface is the cone's `alone`; otherwise a plain with the cone as a heap on it or as a crater in it.
    """

    x: float
    y: float
    z: float
    """z of the tip."""
    slope: float
    alone: bool = True
    rounded: float = 0.0
    """Radius over which the tip is rounded."""


@dataclass(frozen=True)
class Feed:
    """A plain, which may be tilted, with a cone in it and waves upon it."""

    z: float
    """z of the plain on the axis."""
    tilt: tuple[float, float] = (0.0, 0.0)
    """Fall by x and y."""
    tip: Tip | None = None
    waves: tuple[tuple[float, float, float, float], ...] = ()
    """(height, wave number by x, by y, phase) of each."""

    def depth(self, x: Array, y: Array) -> Array:
        """z of the surface."""
        surface = self.z + self.tilt[0] * x + self.tilt[1] * y
        if self.tip is not None:
            tip = self.tip
            away = np.sqrt((x - tip.x) ** 2 + (y - tip.y) ** 2 + tip.rounded**2) - tip.rounded
            cone = tip.z + tip.slope * away
            choose = np.minimum if tip.slope > 0.0 else np.maximum
            surface = cone if tip.alone else choose(surface, cone)
        for height, kx, ky, phase in self.waves:
            surface = surface + height * np.sin(kx * x + ky * y + phase)
        return surface

    @property
    def slope(self) -> float:
        """Bound of the surface's slope."""
        waves = sum(abs(height) * math.hypot(kx, ky) for height, kx, ky, _ in self.waves)
        return max(math.hypot(*self.tilt), abs(self.tip.slope) if self.tip else 0.0) + waves

    def air(self, x: Array, y: Array, z: Array) -> Array:
        return (self.depth(x, y) - z) / math.hypot(1.0, self.slope)

    def label(self, x: Array, y: Array, z: Array) -> Labels:
        return everywhere(FEED, z)
