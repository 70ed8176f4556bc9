"""The Cramér-Rao bound: how well any unbiased estimator can do on a simulated frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from siloscope.simulation import SimulatedFrame
from siloscope.simulation.metrics import LABELS, camera_points

ORDER = ("r_x", "r_y", "t_x", "t_y", "radius", "cone_slope", "apex")
"""Parameters of the bound: those of the fit, with the apex in place of the cone's intercept."""


def cramer_rao(frame: SimulatedFrame) -> NDArray[np.float64]:
    """Covariance (7, 7) of `ORDER` that no unbiased estimator can beat, the sensor's bias and noise being known.

    Every pixel that shows cylinder or cone is one measurement m = f(d(θ)) + σ(d)·n of its true depth d, f the biased
    depth of Eq. 10; the bound is the inverse of ``Σ (f' ∂d/∂θ)(f' ∂d/∂θ)ᵀ / σ²`` (what σ itself tells about d is left
    out; it is less than 0.1 % of it). Infinite variances stand where the frame shows nothing of a parameter.
    """
    wall = (frame.measured > 0) & np.isin(frame.measured_labels, (LABELS["cylinder"], LABELS["cone"]))
    depth, cone = frame.depth[wall], frame.labels[wall] == LABELS["cone"]
    slopes = _depth_slopes(frame, wall, cone)
    b = frame.scene.sensor.bias
    measured_slope = 1.0 + b[1] + 2.0 * b[2] * depth
    scaled = slopes * (measured_slope / frame.scene.sensor.sigma_at(depth))[:, None]
    information = scaled.T @ scaled
    seen = np.diag(information) > 0.0
    covariance = np.diag(np.where(seen, 0.0, np.inf))
    covariance[np.ix_(seen, seen)] = _inverse(information[np.ix_(seen, seen)])
    return covariance


def _depth_slopes(frame: SimulatedFrame, wall: NDArray[np.bool_], cone: NDArray[np.bool_]) -> NDArray[np.float64]:
    """∂d/∂θ (N, 7) = -(∂F/∂θ) / (∇F·R q) for F = ρ - R on the cylinder and ρ - m (z_a - z) on the cone."""
    pose, walls = frame.scene.pose, frame.scene.silo
    slope = walls.radius / (walls.apex - walls.cylinder_bottom)
    points = camera_points(frame.depth, frame.camera)[wall]
    silo = pose.to_silo(points)
    radial = silo[:, :2] / np.hypot(silo[:, 0], silo[:, 1])[:, None]
    gradient = np.column_stack([radial, np.where(cone, slope, 0.0)])
    turned = (points / points[:, 2:]) @ pose.T_silo_camera[:3, :3].T
    d_rx, d_ry = _turns(pose.r_x, pose.r_y)
    by_parameter = np.column_stack(
        [
            np.einsum("ni,ij,nj->n", gradient, d_rx, points),
            np.einsum("ni,ij,nj->n", gradient, d_ry, points),
            radial,
            np.where(cone, 0.0, -1.0),
            np.where(cone, silo[:, 2] - walls.apex, 0.0),
            np.where(cone, -slope, 0.0),
        ]
    )
    slopes: NDArray[np.float64] = -by_parameter / (gradient * turned).sum(axis=1)[:, None]
    return slopes


def _turns(r_x: float, r_y: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Derivatives of Ry(r_y)·Rx(r_x) with respect to both angles."""
    sx, cx, sy, cy = np.sin(r_x), np.cos(r_x), np.sin(r_y), np.cos(r_y)
    d_rx = np.array([[0.0, cx * sy, -sx * sy], [0.0, -sx, -cx], [0.0, cx * cy, -sx * cy]])
    d_ry = np.array([[-sy, sx * cy, cx * cy], [0.0, 0.0, 0.0], [-cy, -sx * sy, -cx * sy]])
    return d_rx, d_ry


def _inverse(information: NDArray[np.float64]) -> NDArray[np.float64]:
    scale = 1.0 / np.sqrt(np.diag(information))
    inverse: NDArray[np.float64] = np.linalg.inv(information * scale * scale[:, None]) * scale * scale[:, None]
    return inverse
