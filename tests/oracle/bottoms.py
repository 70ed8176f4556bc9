"""The vessel's bottom: cone, oblique cone, two stages, pyramid, flat floor. `rim` is the z at which the wall ends."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .solids import BOTTOM, Array, Labels, everywhere
from .walls import Relief, stuck


@dataclass(frozen=True)
class Flat:
    """A level floor."""

    rim: float
    apex = None
    reliefs: tuple[Relief, ...] = ()

    @property
    def lowest(self) -> float:
        """z of the lowest place."""
        return self.rim

    def air(self, x: Array, y: Array, z: Array) -> Array:
        return self.rim - z

    def label(self, x: Array, y: Array, z: Array) -> Labels:
        return everywhere(BOTTOM, z)


@dataclass(frozen=True)
class Cone:
    """A cone that begins as the wall's circle at the rim and ends at the outlet's plate.

    Its circles' centres run from `centre` at the rim by `offset` to the vertex: not (0, 0) for an oblique cone.
    """

    rim: float
    radius: float
    height: float
    """From the rim to the vertex."""
    outlet: float = 0.0
    """Radius of the outlet."""
    offset: tuple[float, float] = (0.0, 0.0)
    centre: tuple[float, float] = (0.0, 0.0)
    reliefs: tuple[Relief, ...] = ()

    @property
    def apex(self) -> float:
        """z of the vertex."""
        return self.rim + self.height

    @property
    def lowest(self) -> float:
        """z of the outlet's plate."""
        return self.apex - self.outlet * self.height / self.radius

    def _local(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        share = (z - self.rim) / self.height
        return x - self.centre[0] - share * self.offset[0], y - self.centre[1] - share * self.offset[1]

    def air(self, x: Array, y: Array, z: Array) -> Array:
        px, py = self._local(x, y, z)
        space = self.radius * (1.0 - (z - self.rim) / self.height) - np.hypot(px, py)
        slope = (self.radius + math.hypot(*self.offset)) / self.height
        if self.reliefs:
            azimuth = np.arctan2(py, px)
            for relief in self.reliefs:
                space = space - relief.inwards(azimuth, z)
            slope += sum(relief.slope for relief in self.reliefs)
        return np.minimum(space / math.hypot(1.0, slope), self.lowest - z)

    def label(self, x: Array, y: Array, z: Array) -> Labels:
        px, py = self._local(x, y, z)
        return stuck(self.reliefs, np.arctan2(py, px), z, BOTTOM)


@dataclass(frozen=True)
class TwoStage:
    """Two coaxial cones, one below the other: radius `waist` where the upper ends, then to the vertex."""

    rim: float
    radius: float
    upper: float
    """Height of the upper cone."""
    waist: float
    lower: float
    """Height of the lower cone to its vertex."""
    outlet: float = 0.0

    @property
    def apex(self) -> float:
        """z of the lower cone's vertex."""
        return self.rim + self.upper + self.lower

    @property
    def lowest(self) -> float:
        """z of the outlet's plate."""
        return self.apex - self.outlet * self.lower / self.waist

    def air(self, x: Array, y: Array, z: Array) -> Array:
        first, second = (self.radius - self.waist) / self.upper, self.waist / self.lower
        above, below = self.radius - first * (z - self.rim), second * (self.apex - z)
        radius = np.where(z < self.rim + self.upper, above, below)
        space = (radius - np.hypot(x, y)) / math.hypot(1.0, max(first, second))
        return np.minimum(space, self.lowest - z)

    def label(self, x: Array, y: Array, z: Array) -> Labels:
        return everywhere(BOTTOM, z)


@dataclass(frozen=True)
class Pyramid:
    """A four-sided pyramid in which the cylinder stands: its sides touch the wall at the rim."""

    rim: float
    radius: float
    height: float
    """From the rim to the vertex."""
    azimuth: float
    """Direction in which one side falls."""
    outlet: float = 0.0
    """Half the side of the square outlet."""
    kind = "pyramid"

    @property
    def apex(self) -> float:
        """z of the vertex."""
        return self.rim + self.height

    @property
    def lowest(self) -> float:
        """z of the outlet's plate."""
        return self.apex - self.outlet * self.height / self.radius

    def air(self, x: Array, y: Array, z: Array) -> Array:
        space = self.radius * (1.0 - (z - self.rim) / self.height) - self.reach(x, y)
        return np.minimum(space / math.hypot(1.0, self.radius / self.height), self.lowest - z)

    def reach(self, x: Array, y: Array) -> Array:
        """Distance from the axis at which the sides are as deep, along the one that is nearest."""
        c, s = math.cos(self.azimuth), math.sin(self.azimuth)
        reach: Array = np.maximum(np.abs(c * x + s * y), np.abs(c * y - s * x))
        return reach

    def label(self, x: Array, y: Array, z: Array) -> Labels:
        return everywhere(BOTTOM, z)


@dataclass(frozen=True)
class Wedge(Pyramid):
    """Two sides that meet in a trough; `outlet` is half the trough's width."""

    kind = "wedge"

    def reach(self, x: Array, y: Array) -> Array:
        """Distance from the trough."""
        reach: Array = np.abs(math.cos(self.azimuth) * x + math.sin(self.azimuth) * y)
        return reach


Bottom = Flat | Cone | TwoStage | Pyramid
