"""Worlds that are no silos. All stand around the camera, z down."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .solids import OTHER, Array, Labels, everywhere


class Other:
    """A solid without a name."""

    def label(self, x: Array, y: Array, z: Array) -> Labels:
        return everywhere(OTHER, z)


@dataclass(frozen=True)
class Plane(Other):
    """What is beyond a plane at `distance` from the origin along the unit `normal`, which points out of the air."""

    normal: tuple[float, float, float]
    distance: float

    def air(self, x: Array, y: Array, z: Array) -> Array:
        return self.distance - (self.normal[0] * x + self.normal[1] * y + self.normal[2] * z)


def upright(azimuth: float, distance: float) -> Plane:
    """A wall."""
    return Plane((math.cos(azimuth), math.sin(azimuth), 0.0), distance)


def floor(z: float) -> Plane:
    """A level floor."""
    return Plane((0.0, 0.0, 1.0), z)


def room(azimuth: float, distances: tuple[float, float, float, float], depth: float) -> tuple[Plane, ...]:
    """Four walls and a floor."""
    return (*(upright(azimuth + 0.5 * math.pi * i, d) for i, d in enumerate(distances)), floor(depth))


@dataclass(frozen=True)
class Hollow(Other):
    """The inside of an ellipsoid about `centre`: sphere, bowl."""

    centre: tuple[float, float, float]
    radii: tuple[float, float, float]

    def air(self, x: Array, y: Array, z: Array) -> Array:
        a, b, c = self.radii
        q = np.sqrt(((x - self.centre[0]) / a) ** 2 + ((y - self.centre[1]) / b) ** 2 + ((z - self.centre[2]) / c) ** 2)
        return min(self.radii) * (1.0 - q)


@dataclass(frozen=True)
class Ball(Other):
    """A ball that is looked at from outside."""

    centre: tuple[float, float, float]
    radius: float

    def air(self, x: Array, y: Array, z: Array) -> Array:
        cx, cy, cz = self.centre
        return np.sqrt((x - cx) ** 2 + (y - cy) ** 2 + (z - cz) ** 2) - self.radius


@dataclass(frozen=True)
class Tank(Other):
    """The inside of a cylinder that lies: its axis is level at `z`, through (x, y) in the direction of `azimuth`."""

    radius: float
    z: float
    azimuth: float
    aside: float = 0.0

    def air(self, x: Array, y: Array, z: Array) -> Array:
        across = math.cos(self.azimuth) * y - math.sin(self.azimuth) * x - self.aside
        return self.radius - np.hypot(across, z - self.z)


@dataclass(frozen=True)
class Barrel(Other):
    """An upright barrel: its wall is as curved along as around, radius `radius` at height `z`."""

    radius: float
    z: float
    curvature: float
    """Radius of curvature along the wall, metres."""

    def air(self, x: Array, y: Array, z: Array) -> Array:
        around = self.radius - self.curvature
        return self.curvature - np.hypot(np.hypot(x, y) - around, z - self.z)


@dataclass(frozen=True)
class Waves(Other):
    """Rough ground: a plain with waves."""

    z: float
    waves: tuple[tuple[float, float, float, float], ...]

    def air(self, x: Array, y: Array, z: Array) -> Array:
        surface, slope = np.full(x.shape, self.z), 0.0
        for height, kx, ky, phase in self.waves:
            surface += height * np.sin(kx * x + ky * y + phase)
            slope += height * math.hypot(kx, ky)
        return (surface - z) / math.hypot(1.0, slope)
