"""Sphere tracing: a ray advances by what is surely air until the distance changes sign; a secant finds the place."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .solids import Array, Solid, air

SMALLEST_STEP = 1e-3
"""Metres; what is thinner may be passed over."""

REFINEMENTS = 14
"""Steps of the bracketing secant (Illinois); from 1 mm they reach some 1e-12 m on smooth surfaces."""

BLOCK = 8
"""Pixels across a beam, which goes first for all its rays."""


def trace(solids: Sequence[Solid], origin: Array, rays: Array, far: float) -> Array:
    """Parameter t > 0 at which each ray ``origin + t ray`` first meets a solid, 0 where none within `far`.

    Parameters
    ----------
    origin : (3,)
    rays : (H, W, 3)
        Silo frame, any length; with ``R (x, y, 1)`` t is the depth.
    far : float
        Largest t.
    """
    height, width = rays.shape[:2]
    directions = np.ascontiguousarray(rays.reshape(-1, 3).T)
    start = _beams(solids, origin, rays, far).reshape(height * width)
    low, high = _bracket(solids, origin, directions, start, far)
    return _refined(solids, origin, directions, low, high).reshape(height, width)


def _points(origin: Array, rays: Array, t: Array) -> tuple[Array, Array, Array]:
    return origin[0] + t * rays[0], origin[1] + t * rays[1], origin[2] + t * rays[2]


def _beams(solids: Sequence[Solid], origin: Array, rays: Array, far: float) -> Array:
    """A parameter (H, W) up to which a ray and its neighbours in a block are surely in the air.

    At parameter t the rays of a block are at most ``t spread`` from the middle one.
    """
    height, width = rays.shape[:2]
    rows, columns = -(-height // BLOCK), -(-width // BLOCK)
    padded = np.pad(rays, ((0, rows * BLOCK - height), (0, columns * BLOCK - width), (0, 0)), mode="edge")
    blocks = padded.reshape(rows, BLOCK, columns, BLOCK, 3).transpose(0, 2, 1, 3, 4).reshape(-1, BLOCK * BLOCK, 3)
    middle = blocks.mean(axis=1)
    spread = np.linalg.norm(blocks - middle[:, None], axis=2).max(axis=1)
    speed = np.linalg.norm(middle, axis=1) + spread
    t, directions = np.zeros(len(middle)), np.ascontiguousarray(middle.T)
    for _ in range(40):
        free = air(solids, *_points(origin, directions, t)) - t * spread
        t = np.minimum(t + np.maximum(free, 0.0) / speed, far)
    grid = np.repeat(np.repeat(t.reshape(rows, columns), BLOCK, axis=0), BLOCK, axis=1)
    return grid[:height, :width]


def _bracket(solids: Sequence[Solid], origin: Array, rays: Array, start: Array, far: float) -> tuple[Array, Array]:
    """Last parameter in the air and first in a solid; both 0 where the ray meets nothing."""
    low, high = np.zeros(rays.shape[1]), np.zeros(rays.shape[1])
    speed = np.sqrt((rays**2).sum(axis=0))
    active, t, before, going = np.arange(rays.shape[1]), start.copy(), start.copy(), rays
    while len(active):
        distance = air(solids, *_points(origin, going, t))
        met = distance <= 0.0
        low[active[met]], high[active[met]] = before[met], t[met]
        on = ~met & (t < far)
        active, going, before, distance = active[on], going[:, on], t[on], distance[on]
        t = before + np.maximum(distance, SMALLEST_STEP) / speed[active]
    return low, high


def _refined(solids: Sequence[Solid], origin: Array, rays: Array, low: Array, high: Array) -> Array:
    """The place of the change of sign between `low` and `high`."""
    found = np.zeros(len(low))
    met = np.flatnonzero(high > 0.0)
    going, a, b = rays[:, met], low[met], high[met]
    fa, fb = (air(solids, *_points(origin, going, t)) for t in (a, b))
    side = np.zeros(len(met))
    for _ in range(REFINEMENTS):
        c = np.where(fa > fb, (a * fb - b * fa) / np.where(fa > fb, fb - fa, 1.0), a)
        fc = air(solids, *_points(origin, going, c))
        inside = fc <= 0.0
        fa, fb = np.where(inside & (side > 0), 0.5 * fa, fa), np.where(~inside & (side < 0), 0.5 * fb, fb)
        a, fa = np.where(inside, a, c), np.where(inside, fa, fc)
        b, fb = np.where(inside, c, b), np.where(inside, fc, fb)
        side = np.where(inside, 1.0, -1.0)
    found[met] = np.where(np.abs(fa) < np.abs(fb), a, b)
    return found


def normals(solids: Sequence[Solid], points: Array, step: float = 1e-5) -> Array:
    """Unit normals towards the air (N, 3) at surface points (N, 3), by central differences."""
    gradient = np.empty_like(points)
    for axis in range(3):
        ahead, behind = points.copy(), points.copy()
        ahead[:, axis] += step
        behind[:, axis] -= step
        gradient[:, axis] = air(solids, *ahead.T) - air(solids, *behind.T)
    norms: Array = np.linalg.norm(gradient, axis=1, keepdims=True)
    return gradient / np.maximum(norms, 1e-300)
