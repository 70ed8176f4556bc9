"""Slow NumPy oracle of the paper's six steps (section 2.3), written from the formulas, one function a step.

Nothing here is shared with the core. Where the paper is silent the choice is the project's (DESIGN.md), stated in
the docstring; the defaults are repeated here on purpose, so that a changed default fails a test.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Array = NDArray[np.float64]


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


def normals(points: Array, neighbours: NDArray[np.intp]) -> Array:
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


def shape_tensors(points: Array, neighbours: NDArray[np.intp], normal: Array) -> ShapeTensors:
    """Adjacent-normal cubic approximation (Goldfeather and Interrante 2004).

    In local coordinates with the normal as z, the surface is z = a/2 x² + b xy + c/2 y² + d x³ + e x²y + f xy² + g y³.
    Every neighbour gives one equation for its position and two for its normal; lengths are in units of the
    distance to the farthest neighbour, so that position and normal equations weigh alike at every scale.
    """
    n = len(points)
    k1, k2, E1, E2 = np.zeros(n), np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3))
    for i, p in enumerate(points):
        t1, t2 = tangent_basis(normal[i])
        d = points[neighbours[i]] - p
        unit = np.linalg.norm(d, axis=1).max()
        x, y, z = d @ t1 / unit, d @ t2 / unit, d @ normal[i] / unit
        m = normal[neighbours[i]]
        mx, my, mz = m @ t1, m @ t2, m @ normal[i]
        seen = np.abs(mz) > 0.1
        o, one = np.zeros_like(x), np.ones_like(x)
        position = np.column_stack([x * x / 2, x * y, y * y / 2, x**3, x * x * y, x * y * y, y**3])
        along_x = np.column_stack([x, y, o, 3 * x * x, 2 * x * y, y * y, o])[seen]
        along_y = np.column_stack([o, x, y, o, x * x, 2 * x * y, 3 * y * y])[seen]
        A = np.concatenate([position, along_x, along_y])
        rhs = np.concatenate([z, -(mx / (mz + ~seen * one))[seen], -(my / (mz + ~seen * one))[seen]])
        a, b, c = np.linalg.lstsq(A, rhs, rcond=None)[0][:3] / unit
        (low, high), vectors = np.linalg.eigh(np.array([[a, b], [b, c]]))
        k1[i], k2[i] = high, low
        E1[i] = vectors[0, 1] * t1 + vectors[1, 1] * t2
        E2[i] = vectors[0, 0] * t1 + vectors[1, 0] * t2
    return ShapeTensors(k1, k2, E1, E2)


def axis_direction(E1: Array) -> Array:
    """Leading principal direction of the cross products of all pairs (Eq. 3), pair by pair."""
    scatter = np.zeros((3, 3))
    for e in E1:
        products = np.cross(e, E1)
        scatter += products.T @ products
    X = np.linalg.eigh(scatter)[1][:, 2]
    return -X if X[2] < 0 else X
