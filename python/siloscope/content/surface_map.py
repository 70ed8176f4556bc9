"""The surface of the content as a map, in a silo or of a bare point cloud."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from siloscope import _core
from siloscope.errors import InputError, UsageError
from siloscope.types.surface_map import SurfaceMap


def surface_map(
    points: ArrayLike, up: ArrayLike = (0.0, 0.0, 1.0), *, cell: float | None = None, noise: float = 0.0
) -> SurfaceMap:
    """Map the surface of a bare point cloud over the plane perpendicular to a given vertical.

    For heaps, boxes and bins that are no silos: the map has heights and a shape, but no volume of its own, as nothing
    says where the floor is; `volume_between` two maps needs none.

    Parameters
    ----------
    points : array (N, 3) or (H, W, 3)
        Points in metres; rows that are not finite are left out.
    up : array (3,)
        The vertical, any length.
    cell : float, optional
        Side of the map's cells, m; chosen from the points where not given.
    noise : float
        Standard deviation of a point's height, m.

    Raises
    ------
    InputError
        Where there are too few points for a surface.
    UsageError
        For a vertical that is no direction, or a cell that does not fit the cloud.
    """
    cloud = np.asarray(points)
    if cloud.dtype.kind not in "fiu" or cloud.ndim not in (2, 3) or cloud.shape[-1] != 3:
        raise InputError(f"points: {cloud.dtype} of shape {cloud.shape}; give (N, 3) or (H, W, 3) in metres")
    direction = np.asarray(up, np.float64)
    if not 0.0 <= noise < np.inf:
        raise UsageError(f"noise must be 0 m or more, got {noise}")
    if direction.shape != (3,):
        raise UsageError(f"up {direction.tolist()}: give three numbers")
    flat = np.ascontiguousarray(cloud.reshape(-1, 3), np.float64)
    try:
        made = _core.content_relief(flat, (direction[0], direction[1], direction[2]), cell, noise)
    except ValueError as error:
        raise UsageError(str(error)) from None
    if made is None:
        raise InputError(f"points: {len(flat)} points are too few for a surface; give a cloud of at least 50")
    return SurfaceMap(made, made.ceiling)


def volume_between(lower: SurfaceMap, upper: SurfaceMap) -> tuple[float, float]:
    """Volume, m³, by which `upper` lies over `lower` where both are seen, and its standard deviation.

    Positive where the upper one is higher on the whole. The maps must have one vertical and one set of axes.
    """
    if not np.allclose(lower.axes, upper.axes, atol=1e-9):
        raise UsageError("the two maps have different verticals; map both clouds with one")
    x, y = np.meshgrid(upper.x, upper.y)
    rows = np.floor((y - lower.y[0]) / lower.cell + 0.5).astype(int)
    columns = np.floor((x - lower.x[0]) / lower.cell + 0.5).astype(int)
    side = len(lower.x)
    within = (rows >= 0) & (rows < side) & (columns >= 0) & (columns < side)
    known = upper.seen & within
    known[known] = lower.seen[rows[known], columns[known]]
    if not known.any():
        raise InputError("the two maps have no place in common that both show")
    places = np.stack([x[known], y[known]], axis=-1)
    rise = upper.height(places) - lower.height(places)
    variance = upper.std[known] ** 2 + lower.std[rows[known], columns[known]] ** 2
    area = upper.cell**2
    return float(rise.sum() * area), float(np.sqrt(variance.sum()) * area)
