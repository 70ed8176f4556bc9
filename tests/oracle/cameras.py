"""A camera with the intrinsics that it has and those that are told of it, and its pose in the silo."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .solids import Array


@dataclass(frozen=True)
class Intrinsics:
    """A pinhole with one coefficient of radial distortion: ``distorted = (1 + k1 r²) undistorted``. Pixels."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    k1: float = 0.0

    def rays(self) -> Array:
        """(x/z, y/z, 1) of every pixel's centre, (H, W, 3)."""
        u, v = np.meshgrid(np.arange(self.width, dtype=float), np.arange(self.height, dtype=float))
        xd, yd = (u - self.cx) / self.fx, (v - self.cy) / self.fy
        x, y = xd.copy(), yd.copy()
        for _ in range(30 if self.k1 else 0):
            factor = 1.0 + self.k1 * (x * x + y * y)
            x, y = xd / factor, yd / factor
        return np.stack([x, y, np.ones_like(x)], axis=-1)


@dataclass(frozen=True)
class Pose:
    """The contract's pose: ``p_silo = R p_camera + (t_x, t_y, 0)`` with R = Ry(r_y) Rx(r_x)."""

    r_x: float
    r_y: float
    t_x: float
    t_y: float

    @property
    def rotation(self) -> Array:
        """R, (3, 3), as the product of both turns."""
        cx, sx, cy, sy = math.cos(self.r_x), math.sin(self.r_x), math.cos(self.r_y), math.sin(self.r_y)
        about_x = np.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]])
        about_y = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
        rotation: Array = about_y @ about_x
        return rotation

    @property
    def origin(self) -> Array:
        """The camera's place in the silo frame."""
        return np.array([self.t_x, self.t_y, 0.0])


def looking(place: tuple[float, float], at: tuple[float, float, float]) -> Pose:
    """Pose of a camera at `place` whose optical axis points to `at` (silo frame)."""
    direction = np.array([at[0] - place[0], at[1] - place[1], at[2]])
    direction /= np.linalg.norm(direction)
    return Pose(-math.asin(direction[1]), math.atan2(direction[0], direction[2]), *place)
