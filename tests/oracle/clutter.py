"""Things that hang or stand in the vessel."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .solids import OTHER, Array, Labels, everywhere


@dataclass(frozen=True)
class Bar:
    """A round bar with round ends: cable, beam, auger."""

    start: tuple[float, float, float]
    end: tuple[float, float, float]
    radius: float

    def air(self, x: Array, y: Array, z: Array) -> Array:
        a, along = np.array(self.start), np.subtract(self.end, self.start)
        px, py, pz = x - a[0], y - a[1], z - a[2]
        share = np.clip((px * along[0] + py * along[1] + pz * along[2]) / (along @ along), 0.0, 1.0)
        px, py, pz = px - share * along[0], py - share * along[1], pz - share * along[2]
        away: Array = np.sqrt(px * px + py * py + pz * pz)
        return away - self.radius

    def label(self, x: Array, y: Array, z: Array) -> Labels:
        return everywhere(OTHER, z)


@dataclass(frozen=True)
class Ladder:
    """Two rails of square tube and rungs every 0.3 m, upright, at `distance` from the axis towards `azimuth`."""

    distance: float
    azimuth: float
    bottom: float
    half: float = 0.2
    spacing = 0.3
    rail = 0.02
    rung = 0.0125

    def air(self, x: Array, y: Array, z: Array) -> Array:
        c, s = math.cos(self.azimuth), math.sin(self.azimuth)
        out, across = c * x + s * y - self.distance, np.abs(c * y - s * x)
        rail = np.maximum(np.abs(across - self.half), np.abs(out)) - self.rail
        dz = np.abs(np.mod(z, self.spacing) - 0.5 * self.spacing)
        beyond = np.maximum(across - self.half, 0.0)
        rung = np.sqrt(out * out + dz * dz + beyond * beyond) - self.rung
        ladder: Array = np.maximum(np.minimum(rail, rung), z - self.bottom)
        return ladder

    def label(self, x: Array, y: Array, z: Array) -> Labels:
        return everywhere(OTHER, z)
