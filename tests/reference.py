"""Slow NumPy oracle of the paper's six steps (section 2.3), written from the formulas, one function a step.

Nothing here is shared with the core. Where the paper is silent the choice is the project's (DESIGN.md), stated in
the docstring; the defaults are repeated here on purpose, so that a changed default fails a test.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Array = NDArray[np.float64]
Indices = NDArray[np.integer[Any]]


def back_project(depth: Array, fx: float, fy: float, cx: float, cy: float) -> Array:
    """Points (N, 3) of the pixels with a measurement (Eqs. 1 and 2)."""
    points = []
    for v, row in enumerate(depth):
        u = np.flatnonzero(np.isfinite(row) & (row > 0))
        z = row[u].astype(float)
        points.append(np.column_stack([z / fx * (u - cx), z / fy * (v - cy), z]))
    return np.concatenate(points) if points else np.empty((0, 3))


def voxel_grid(points: Array, size: float = 0.05) -> Array:
    """Mean point of every occupied voxel (step 1), in order of the voxels (x, then y, then z)."""
    keys = np.floor(points / size).astype(np.int64)
    _, voxel, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    means = np.zeros((len(count), 3))
    np.add.at(means, voxel.ravel(), points)
    return means / count[:, None]


def nearest_neighbours(points: Array, k: int = 30) -> NDArray[np.intp]:
    """Indices (N, k) of the nearest other points, nearest first."""
    _, index = cKDTree(points).query(points, k + 1)
    rows = []
    for i, row in enumerate(np.atleast_2d(index)):
        others = row[row != i]
        rows.append(others[:k])
    return np.array(rows, dtype=np.intp).reshape(len(points), -1)


def normals(points: Array, neighbours: Indices) -> Array:
    """Hoppe's normals, the smallest eigenvector of M = 1/k Σ (p_i − p)(p_i − p)ᵀ, turned towards the camera."""
    result = np.empty_like(points)
    for i, p in enumerate(points):
        d = points[neighbours[i]] - p
        normal = np.linalg.eigh(d.T @ d / len(d))[1][:, 0]
        result[i] = -normal if normal @ p > 0 else normal
    return result


def tangent_basis(normal: Array) -> tuple[Array, Array]:
    """Any orthonormal basis T1, T2 of the tangent plane."""
    helper = np.eye(3)[np.argmin(np.abs(normal))]
    t1 = np.cross(helper, normal)
    t1 /= np.linalg.norm(t1)
    return t1, np.cross(normal, t1)


@dataclass
class ShapeTensors:
    """Principal curvatures k1 ≥ k2 (N,) and principal directions E1, E2 (N, 3)."""

    k1: Array
    k2: Array
    E1: Array
    E2: Array


def shape_tensors(points: Array, neighbours: Indices, normal: Array) -> ShapeTensors:
    """Adjacent-normal cubic approximation (Goldfeather and Interrante 2004).

    In local coordinates with the normal as z, the surface is z = a/2 x² + b xy + c/2 y² + d x³ + e x²y + f xy² + g y³.
    Every neighbour gives one equation for its position, of weight 0.5, and two for its normal, of weight 1; lengths are
    in units of the distance to the farthest neighbour. Neighbours whose normal is nearly perpendicular to the point's
    own are left out.
    """
    n = len(points)
    k1, k2, E1, E2 = np.zeros(n), np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3))
    for i, p in enumerate(points):
        t1, t2 = tangent_basis(normal[i])
        d = points[neighbours[i]] - p
        unit = np.linalg.norm(d, axis=1).max()
        m = normal[neighbours[i]]
        seen = np.abs(m @ normal[i]) > 0.1
        d, m = d[seen] / unit, m[seen]
        x, y, z = d @ t1, d @ t2, d @ normal[i]
        mx, my, mz = m @ t1, m @ t2, m @ normal[i]
        o = np.zeros_like(x)
        position = np.column_stack([x * x / 2, x * y, y * y / 2, x**3, x * x * y, x * y * y, y**3])
        along_x = np.column_stack([x, y, o, 3 * x * x, 2 * x * y, y * y, o])
        along_y = np.column_stack([o, x, y, o, x * x, 2 * x * y, 3 * y * y])
        A = np.concatenate([0.5 * position, along_x, along_y])
        rhs = np.concatenate([0.5 * z, -mx / mz, -my / mz])
        a, b, c = np.linalg.lstsq(A, rhs, rcond=None)[0][:3] / unit
        (low, high), vectors = np.linalg.eigh(np.array([[a, b], [b, c]]))
        k1[i], k2[i] = high, low
        E1[i] = vectors[0, 1] * t1 + vectors[1, 1] * t2
        E2[i] = vectors[0, 0] * t1 + vectors[1, 0] * t2
    return ShapeTensors(k1, k2, E1, E2)


def select_candidates(
    points: Array, neighbours: Indices, tensors: Any, share: float = 0.7, view: str = "inside"
) -> tuple[NDArray[np.intp], Array]:
    """The `share` with the smallest |k2| of the points that are clearly curved and surrounded: index and E1.

    Clear is a radius of curvature below the extent of the cloud. Surrounded is a point where the mean of its neighbours
    lies within 0.15 of the distance to the farthest. From outside, the principal curvatures change places.
    """
    extent = np.linalg.norm(points.max(axis=0) - points.min(axis=0)) if len(points) else 0.0
    swap = np.abs(tensors.k2) > np.abs(tensors.k1)
    bent, straight = np.where(swap, tensors.k2, tensors.k1), np.where(swap, tensors.k1, tensors.k2)
    E1 = np.where(swap[:, None], tensors.E2, tensors.E1)
    clear = []
    for i, p in enumerate(points):
        d = points[neighbours[i]] - p
        surrounded = np.linalg.norm(d.mean(axis=0)) <= 0.15 * np.linalg.norm(d, axis=1).max()
        side = {"inside": bent[i] > 0, "outside": bent[i] < 0, "either": True}[view]
        if abs(bent[i]) > 1 / extent and side and surrounded:
            clear.append(i)
    index = np.array(clear, dtype=np.intp)
    index = index[np.argsort(np.abs(straight[index]), kind="stable")]
    index = index[: int(np.ceil(share * len(index)))]
    return index, E1[index]


def axis_direction(E1: Array) -> Array:
    """Leading principal direction of the cross products of all pairs (Eq. 3), pair by pair."""
    scatter = np.zeros((3, 3))
    for e in E1:
        products = np.cross(e, E1)
        scatter += products.T @ products
    X = np.linalg.eigh(scatter)[1][:, 2]
    return -X if X[2] < 0 else X


def consistent_direction(E1: Array, agreement: float = 2.0) -> tuple[Array, NDArray[np.intp]]:
    """Direction of the candidates that agree with each other, and their numbers.

    Five times from the first fifth without those farther off the perpendicular than `agreement` robust standard
    deviations of the rest, then five times from all within the last such limit.
    """
    everybody = np.arange(len(E1))
    if np.isinf(agreement):
        return axis_direction(E1), everybody
    kept = fifth = everybody[: int(np.ceil(0.2 * len(E1)))]
    limit = np.inf
    for _ in range(5):
        off = np.abs(E1 @ axis_direction(E1[kept]))
        limit = agreement * 1.4826 * np.median(off[kept]) + np.finfo(float).eps
        kept = fifth[off[fifth] <= limit]
    kept = everybody[off <= limit]
    for _ in range(5):
        off = np.abs(E1 @ axis_direction(E1[kept]))
        kept = everybody[off <= limit]
    return axis_direction(E1[kept]), kept


def rotation(X: Array) -> Array:
    """R = Ry(r_y)·Rx(r_x) of Eq. 5 with the angles of Eq. 6."""
    r_x, r_y = np.arcsin(X[1] / np.sqrt(1 - X[0] ** 2)), np.arcsin(-X[0])
    sx, cx, sy, cy = np.sin(r_x), np.cos(r_x), np.sin(r_y), np.cos(r_y)
    return np.array([[cy, sx * sy, cx * sy], [0, cx, -sx], [-sy, sx * cy, cx * cy]])


def axis_points(points: Array, normal: Array, X: Array, partners: int = 100, planes: int = 1500) -> Array:
    """Points where the lines p' + λN' meet the planes π(p, X, N), projected into the plane through the origin (Eq. 4).

    Partners p' are the quarter with the greatest |(N × X)·N'| of 4 `partners` evenly spread candidates; of more than
    `planes` candidates only so many, evenly spread, lend their planes.
    """
    pool, lending = (
        np.array([i * len(points) // n for i in range(n)], dtype=int)
        for n in (min(4 * partners, len(points)), min(planes, len(points)))
    )
    estimates = []
    for p, N in zip(points[lending], normal[lending], strict=True):
        across = np.cross(N, X)
        best = pool[np.argsort(-np.abs(normal[pool] @ across), kind="stable")]
        for j in best[: int(np.ceil(len(pool) / 4))]:
            lam = (p - points[j]) @ across / (normal[j] @ across)
            met = points[j] + lam * normal[j]
            estimates.append(met - (met @ X) * X)
    return np.array(estimates)


def axis_point(estimates: Array, X: Array) -> Array:
    """Median along the x and y of the turned frame."""
    R = rotation(X)
    x, y, _ = np.median(estimates @ R.T, axis=0)
    return R.T @ np.array([x, y, 0.0])


def locate(points: Array, grid: float = 0.05, k: int = 30) -> Array:
    """All steps: T_silo_camera (4, 4) (Eqs. 5 to 7)."""
    cloud = voxel_grid(points, grid)
    near = nearest_neighbours(cloud, k)
    N = normals(cloud, near)
    index, E1 = select_candidates(cloud, near, shape_tensors(cloud, near, N))
    X, kept = consistent_direction(E1)
    walls = index[kept]
    R = rotation(X)
    a = R @ axis_point(axis_points(cloud[walls], N[walls], X), X)
    T = np.eye(4)
    T[:3, :3], T[:2, 3] = R, -a[:2]
    return T
