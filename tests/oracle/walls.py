"""The vessel's wall: a circle about the axis at every height, less what stands inwards."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from .solids import CYLINDER, FEED, Array, Labels

NEAR = 0.05
"""Within so much of the innermost wall its form is looked at, metres."""

VISIBLE = 2e-3
"""From this thickness on what sticks is labelled as feed, metres."""


class Relief(Protocol):
    """How far a wall stands inwards of the perfect one."""

    @property
    def inmost(self) -> float:
        """Bound of how far inwards, metres."""

    @property
    def slope(self) -> float:
        """Bound of the slope along the wall."""

    @property
    def sticks(self) -> bool:
        """Whether it is feed that sticks to the wall."""

    def inwards(self, azimuth: Array, z: Array) -> Array:
        """Metres towards the axis."""


@dataclass(frozen=True)
class Courses:
    """Rings of sheet whose radius steps at the edges (z, ascending); `offsets` has one value more, outwards."""

    edges: tuple[float, ...]
    offsets: tuple[float, ...]
    sticks = False
    slope = 0.0

    @property
    def inmost(self) -> float:
        return max(0.0, -min(self.offsets))

    def inwards(self, azimuth: Array, z: Array) -> Array:
        places = np.repeat(self.edges, 2) + np.tile([-1e-3, 1e-3], len(self.edges))
        outwards: Array = np.interp(z, places, np.repeat(self.offsets, 2)[1:-1])
        return -outwards


@dataclass(frozen=True)
class Bend:
    """A generatrix that is not straight: the circles' centres leave the axis towards `azimuth`.

    The displacement is a Legendre series over the wall's height from order 2 on: its best straight line is the axis.
    """

    amplitudes: tuple[float, ...]
    azimuth: float
    top: float
    bottom: float
    sticks = False

    @property
    def inmost(self) -> float:
        return sum(map(abs, self.amplitudes))

    @property
    def slope(self) -> float:
        steepest = sum(abs(a) * k * (k + 1) / 2 for k, a in enumerate(self.amplitudes, 2))
        return 2.0 * steepest / (self.bottom - self.top)

    def shift(self, z: Array | float) -> Array:
        """Displacement at a height, metres; below and above the wall that of its ends."""
        place = np.clip(2.0 * (z - self.top) / (self.bottom - self.top) - 1.0, -1.0, 1.0)
        shift: Array = np.polynomial.legendre.legval(place, [0.0, 0.0, *self.amplitudes])
        return shift

    def inwards(self, azimuth: Array, z: Array) -> Array:
        return -self.shift(z) * np.cos(azimuth - self.azimuth)


@dataclass(frozen=True)
class Round:
    """Out of round: `order` times around, `height` metres outwards at `azimuth`; order 2 is an oval."""

    order: int
    height: float
    azimuth: float
    sticks = False

    @property
    def inmost(self) -> float:
        return abs(self.height)

    @property
    def slope(self) -> float:
        return abs(self.height) * self.order

    def inwards(self, azimuth: Array, z: Array) -> Array:
        return -self.height * np.cos(self.order * (azimuth - self.azimuth))


@dataclass(frozen=True)
class Corrugation:
    """Sinusoidal sheet: `depth` from crest to trough, waves of `pitch` along z."""

    depth: float
    pitch: float
    phase: float
    sticks = False

    @property
    def inmost(self) -> float:
        return 0.5 * self.depth

    @property
    def slope(self) -> float:
        return np.pi * self.depth / self.pitch

    def inwards(self, azimuth: Array, z: Array) -> Array:
        return 0.5 * self.depth * np.sin(2.0 * np.pi * z / self.pitch + self.phase)


@dataclass(frozen=True)
class Patch:
    """Something on one side: a dent, or feed that sticks; `half` are its half widths in azimuth (rad) and z (m).

    `edge` is the share of the half width over which it falls to nothing: 1 for a dent, small for a flat cake.
    """

    thickness: float
    azimuth: float
    z: float
    half: tuple[float, float]
    edge: float
    sticks: bool
    wave: float = 0.0
    """Share of the thickness by which it is uneven."""

    @property
    def inmost(self) -> float:
        return self.thickness * (1.0 + abs(self.wave))

    @property
    def slope(self) -> float:
        return 2.0 * self.inmost / (self.edge * min(self.half[1], self.half[0]))

    def inwards(self, azimuth: Array, z: Array) -> Array:
        across = np.abs(np.mod(azimuth - self.azimuth + np.pi, 2.0 * np.pi) - np.pi) / self.half[0]
        window = _falling(across, self.edge) * _falling(np.abs(z - self.z) / self.half[1], self.edge)
        uneven = 1.0 + self.wave * np.sin(3.0 * azimuth + self.azimuth) * np.cos(4.0 * z)
        return self.thickness * window * uneven


@dataclass(frozen=True)
class Cake:
    """Feed that sticks all round between two heights, in lobes."""

    thickness: float
    top: float
    bottom: float
    lobes: int
    azimuth: float
    uneven: float
    sticks = True

    @property
    def inmost(self) -> float:
        return self.thickness * (1.0 + self.uneven)

    @property
    def slope(self) -> float:
        return self.inmost * (self.lobes + 4.0 / (self.bottom - self.top)) + 0.1

    def inwards(self, azimuth: Array, z: Array) -> Array:
        middle, half = 0.5 * (self.top + self.bottom), 0.5 * (self.bottom - self.top)
        lobes = 1.0 + self.uneven * np.cos(self.lobes * (azimuth - self.azimuth) + 2.0 * z)
        return self.thickness * _falling(np.abs(z - middle) / half, 0.3) * lobes


def _falling(place: Array, edge: float) -> Array:
    """1 up to 1 - edge, then smoothly to 0 at 1."""
    s = np.clip((1.0 - place) / edge, 0.0, 1.0)
    return s * s * (3.0 - 2.0 * s)


def stuck(reliefs: Sequence[Relief], azimuth: Array, z: Array, otherwise: int) -> Labels:
    """Label of a wall's places: feed where enough of it sticks."""
    thick = np.zeros(z.shape)
    for relief in reliefs:
        if relief.sticks:
            thick += relief.inwards(azimuth, z)
    return np.where(thick > VISIBLE, np.uint8(FEED), np.uint8(otherwise))


@dataclass(frozen=True)
class Wall:
    """A cylinder about the z-axis with its reliefs; it goes on above and below, the bottom ends it."""

    radius: float
    reliefs: tuple[Relief, ...] = ()

    @property
    def inmost(self) -> float:
        """Bound of how far the reliefs stand inwards together."""
        return sum(relief.inmost for relief in self.reliefs)

    def radius_at(self, azimuth: Array, z: Array) -> Array:
        """Radius at a place, metres."""
        inwards = np.zeros(np.broadcast_shapes(azimuth.shape, z.shape))
        for relief in self.reliefs:
            inwards = inwards + relief.inwards(azimuth, z)
        return self.radius - inwards

    def air(self, x: Array, y: Array, z: Array) -> Array:
        r = np.hypot(x, y)
        if not self.reliefs:
            return self.radius - r
        bound = self.radius - self.inmost - r
        near = bound < NEAR
        exact = self.radius_at(np.arctan2(y[near], x[near]), z[near]) - r[near]
        bound[near] = exact / np.hypot(1.0, sum(relief.slope for relief in self.reliefs))
        return bound

    def label(self, x: Array, y: Array, z: Array) -> Labels:
        return stuck(self.reliefs, np.arctan2(y, x), z, CYLINDER)
