"""The paper's pose: two angles and two lengths (Eqs. 5–7)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class SiloPose:
    """Pose of a camera in the silo frame: rotation ``Ry(r_y)·Rx(r_x)``, translation ``(t_x, t_y, 0)``.

    Angles in radians, lengths in metres. The silo frame has its origin on the axis at the camera's height and z
    along gravity.
    """

    r_x: float
    r_y: float
    t_x: float
    t_y: float

    @classmethod
    def from_axis(cls, direction: ArrayLike, point: ArrayLike) -> SiloPose:
        """Pose from the axis direction X and any axis point, both (3,) in the camera frame (Eqs. 6 and 7)."""
        x = np.asarray(direction, float)
        x = x / np.linalg.norm(x) * (-1.0 if x[2] < 0 else 1.0)
        turned = cls(float(np.arctan2(x[1], x[2])), float(np.arcsin(np.clip(-x[0], -1, 1))), 0.0, 0.0)
        a = turned.T_silo_camera[:3, :3] @ np.asarray(point, float)
        return cls(turned.r_x, turned.r_y, float(-a[0]), float(-a[1]))

    @property
    def T_silo_camera(self) -> NDArray[np.float64]:
        """Homogeneous (4, 4) transform with ``p_silo = T_silo_camera @ p_camera`` (Eq. 5)."""
        sx, cx = np.sin(self.r_x), np.cos(self.r_x)
        sy, cy = np.sin(self.r_y), np.cos(self.r_y)
        return np.array(
            [
                [cy, sx * sy, cx * sy, self.t_x],
                [0.0, cx, -sx, self.t_y],
                [-sy, sx * cy, cx * cy, 0.0],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )

    @property
    def axis_direction(self) -> NDArray[np.float64]:
        """Unit direction X (3,) of the axis in the camera frame, along gravity."""
        direction: NDArray[np.float64] = self.T_silo_camera[2, :3]
        return direction

    @property
    def axis_point(self) -> NDArray[np.float64]:
        """Axis point a (3,) in the camera frame, in the plane through the camera perpendicular to X."""
        point: NDArray[np.float64] = self.T_silo_camera[:3, :3].T @ np.array([-self.t_x, -self.t_y, 0.0])
        return point

    def to_silo(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (..., 3) from the camera frame to the silo frame."""
        T = self.T_silo_camera
        moved: NDArray[np.float64] = points @ T[:3, :3].T + T[:3, 3]
        return moved

    def to_camera(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (..., 3) from the silo frame to the camera frame."""
        T = self.T_silo_camera
        moved: NDArray[np.float64] = (points - T[:3, 3]) @ T[:3, :3]
        return moved
