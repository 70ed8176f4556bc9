"""What the sensor that saw a cloud may have done to all of it: what the scatter of a fit to points does not show."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.types.pose import SiloPose

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

POSE, WALL = 4, 7
"""Parameters of the pose, and of pose and wall."""

STEP = 1e-6
"""Step of the parameters for a derivative, rad or m."""


WARP = 0.002
"""Standard deviation of a lasting warp of the depth over a cloud, tilt and bow each, as a fraction of the depth, of a
sensor that is not known: structured light and stereo of the shelf have 1 to 3 mm at 1 m."""


@dataclass(frozen=True)
class SensorStd:
    """Standard deviations of what all points of a cloud have in common."""

    bias: tuple[float, float, float]
    """Of the depth's offset (m), scale and quadratic part (1/m)."""
    camera: tuple[float, float, float, float, float]
    """Of fx and fy (relative), of cx and cy in units of the rays, of k1."""
    warp: float = 0.0
    """Of each part of a warp, as a fraction of the depth."""

    @property
    def all(self) -> Vector:
        """(13,) in the order of `displacements`."""
        return np.array([*self.camera, *self.bias, *[self.warp] * 5])


def displacements(points: Matrix) -> Matrix:
    """How points (N, 3), camera frame, move by a unit of what all have in common: (13, N, 3).

    fx, fy, cx, cy, k1; the depth's offset, scale and quadratic part; its tilt across and down and its bow three ways,
    which reach from -1 to 1 over the cloud.
    """
    x, y, z = points.T
    zero, right, down = np.zeros_like(z), x / z, y / z
    radial = right**2 + down**2
    moves = [np.stack(move, axis=1) for move in ((x, zero, zero), (zero, y, zero), (z, zero, zero), (zero, z, zero))]
    moves.append(np.stack([x * radial, y * radial, zero], axis=1))
    u, v = (2.0 * (ratio - ratio.min()) / np.ptp(ratio) - 1.0 for ratio in (right, down))
    along = (np.ones_like(z), z, z**2, z * u, z * v, z * (1.5 * u**2 - 0.5), z * u * v, z * (1.5 * v**2 - 0.5))
    ray = np.stack([right, down, np.ones_like(z)], axis=1)
    return np.stack([*moves, *(ray * change[:, None] for change in along)])


def sensor_covariance(fit: _core.SurfaceFit, sensor: SensorStd) -> Matrix:
    """The sensor's part in the covariance of a fit to points, over all parameters.

    The sensor's errors are parameters with a prior. Residuals tell some of them; what they leave open, and what they
    say against the answer, which stays as it is, makes the answer less sure.
    """
    covariance, stds = np.zeros_like(fit.covariance), sensor.all
    on_wall, present = np.isfinite(fit.residuals), np.isfinite(fit.parameters[:WALL])
    points = SiloPose(*fit.parameters[:POSE].tolist()).to_camera(fit.points[on_wall])
    at = fit.parameters[:WALL]
    steps = STEP * np.eye(WALL)[present]
    by_wall = np.stack([_off(at + step, points) - _off(at - step, points) for step in steps], axis=1) / (2.0 * STEP)
    by_sensor = np.stack([_off(at, points + STEP * move) for move in displacements(points)], axis=1)
    by_sensor = (by_sensor - _off(at, points)[:, None]) / STEP * stds
    inverse = np.linalg.pinv(by_wall)
    own = np.diag(inverse @ inverse.T)
    variance = float(np.mean(np.diag(fit.covariance)[:WALL][present] / own))  # of a point, as the fit weighs them
    moved = inverse @ by_sensor
    left = by_sensor - by_wall @ moved
    open_ = np.linalg.inv(left.T @ left / variance + np.eye(len(stds)))
    found = open_ @ (left.T @ fit.residuals[on_wall]) / variance
    index = np.flatnonzero(present)
    covariance[np.ix_(index, index)] = moved @ (open_ + np.outer(found, found)) @ moved.T
    return covariance


def _off(wall: Vector, points: Matrix) -> Vector:
    """Distances of points (N, 3), camera frame, from a wall of pose, radius, slope and intercept, m."""
    silo = SiloPose(*wall[:POSE].tolist()).to_silo(points)
    radius, slope, intercept = wall[POSE:]
    across = np.hypot(silo[:, 0], silo[:, 1])
    cone: Vector = (across - (intercept - slope * silo[:, 2])) / np.hypot(1.0, slope)
    if np.isnan(radius):
        return cone
    cylinder: Vector = across - radius
    return cylinder if np.isnan(slope) else np.where(slope * silo[:, 2] > intercept - radius, cone, cylinder)
