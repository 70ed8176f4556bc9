"""What a camera would see of a vessel: exact depths, without noise."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import UsageError
from siloscope.types.camera import Camera
from siloscope.types.pose import SiloPose
from siloscope.vessel.vessel import Vessel

Array = NDArray[np.float64]
HALVINGS = 25
"""Of the interval in which a ray meets the surface: 10 m to 0.3 µm."""
FUNNEL = math.tan(math.radians(20.0))
"""Slope of the feed's surface towards the axis: what a discharge leaves of most grain."""


@dataclass(frozen=True)
class Interior:
    """A vessel from inside, with feed in it; heights z downwards from the camera. Metres."""

    radius: float
    top: float
    """z of the wall's upper edge, negative above the camera."""
    edge: float
    """z of the cylinder's lower edge."""
    lowest: float
    """z of the bottom's lowest point."""
    floor_depth: Callable[[Array, Array], Array]
    """Depth of the bottom under the lower edge at places (x, y)."""
    round: bool
    """Whether the bottom is one of revolution about the axis."""

    @classmethod
    def of(cls, vessel: Vessel, drop: float) -> Interior:
        """A vessel with the camera `drop` metres below the wall's upper edge.

        Raises
        ------
        UsageError
            If diameter, cylinder or bottom are not given.
        """
        sheet = vessel.sheet
        lacking = [name for name in ("diameter", "cylinder") if not getattr(sheet, name)]
        if sheet.shape is None and sheet.bottom != "flat" and not sheet.cone:
            lacking.append("bottom (its kind and height)")
        if lacking or not sheet.diameter or not sheet.cylinder:
            raise UsageError(f"a plan needs the vessel's {', '.join(lacking)}; give them in the vessel file")
        radius, height = sheet.diameter / 2.0, sheet.cone or 0.0
        shape = sheet.shape
        if shape is not None:
            edge = sheet.cylinder - drop
            return cls(radius, -drop, edge, edge + shape.height, lambda x, y: shape.depth(x, y, radius), False)

        def coaxial(x: Array, y: Array) -> Array:
            return np.asarray(height * np.clip(1.0 - np.hypot(x, y) / radius, 0.0, 1.0))

        edge = sheet.cylinder - drop
        return cls(radius, -drop, edge, edge + height, coaxial, True)

    def feed_edge(self, level: float) -> float:
        """z at which the feed meets the wall; a level is a fraction of the height from lowest point to upper edge."""
        return self.lowest - level * (self.lowest - self.top)

    def surface(self, x: Array, y: Array, level: float) -> Array:
        """z of what a falling stone would meet: feed, or the bottom where that is higher."""
        feed = self.feed_edge(level) + FUNNEL * (self.radius - np.hypot(x, y))
        return np.asarray(np.minimum(feed, self.edge + self.floor_depth(x, y)))


def exact_depth(inside: Interior, camera: Camera, pose: SiloPose, level: float) -> Array:
    """Depth image (H, W) in metres of a vessel filled to a level; 0 where the ray leaves through the roof."""
    T = pose.T_silo_camera
    sight = camera.rays().reshape(-1, 2)
    rays = np.column_stack([sight, np.ones(len(sight))]) @ T[:3, :3].T
    start = T[:3, 3]
    wall = wall_depth(inside.radius, start, rays)
    depth = first_surface(inside, start, rays, wall, level)
    z = start[2] + depth * rays[:, 2]
    return np.where((z >= inside.top) & (depth > 0.0), depth, 0.0).reshape(camera.height, camera.width)


def wall_depth(radius: float, start: Array, rays: Array) -> Array:
    """Depth at which rays (N, 3) from a point within a cylinder about the z axis leave it; infinite along the axis."""
    a = rays[:, 0] ** 2 + rays[:, 1] ** 2
    b = start[0] * rays[:, 0] + start[1] * rays[:, 1]
    c = start[0] ** 2 + start[1] ** 2 - radius**2
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(a > 1e-15, (np.sqrt(b**2 - a * c) - b) / a, np.inf)


def first_surface(inside: Interior, start: Array, rays: Array, wall: Array, level: float) -> Array:
    """Depth of the first of wall, feed and bottom along each ray; the air in a vessel is convex, so it is left once."""
    with np.errstate(divide="ignore", invalid="ignore"):
        bottom = np.where(rays[:, 2] > 0.0, (inside.lowest - start[2]) / rays[:, 2], np.inf)
    depth = np.minimum(wall, bottom)
    met = _below(inside, start, rays, depth, level)
    near, far, leaving = np.zeros(np.count_nonzero(met)), depth[met], rays[met]
    for _ in range(HALVINGS):
        middle = 0.5 * (near + far)
        under = _below(inside, start, leaving, middle, level)
        near, far = np.where(under, near, middle), np.where(under, middle, far)
    depth[met] = far
    return depth


def _below(inside: Interior, start: Array, rays: Array, depth: Array, level: float) -> NDArray[np.bool_]:
    """Which places along the rays lie below feed or bottom."""
    x, y, z = (start[i] + depth * rays[:, i] for i in range(3))
    return np.asarray(z > inside.surface(x, y, level))
