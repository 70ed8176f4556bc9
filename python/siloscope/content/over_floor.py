"""Volume between a surface and a floor that is known as a map.

The core has fitted the surface with the floor out of sight, so bare floor is part of the surface. Where it was seen,
the thickness counts with its sign: noise on bare floor then adds up to nothing, and an empty vessel reads 0. Where it
was not seen, the surface is continued, but not below the floor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.content.setup import ContentSetup, CoreVessel
from siloscope.content.ullage import GROUPS, capacity_derivatives, std_by
from siloscope.types.content import Parts
from siloscope.types.floor import FloorMap
from siloscope.types.surface_map import KINDS

RINGS, SPOKES = 64, 90
"""Rings and spokes of the midpoint rule over the disc."""

BELOW = 4.0
"""Standard deviations below the floor at which a seen place is surely below it."""


@dataclass(frozen=True)
class OverFloor:
    """Content over a mapped floor."""

    volume: float
    std: float
    parts: Parts
    capacity: float
    sunken: float
    """Fraction of the seen places that lie surely below the floor."""
    columns: NDArray[np.float64]
    """Heights of the content over the floor at places of equal area, m."""


def volume_over(
    floor: FloorMap,
    core: _core.ContentSurface,
    found: _core.ContentMeasure,
    setup: ContentSetup,
) -> OverFloor:
    """The content between a surface and a floor that is known as a map."""
    silo, known = setup.silo, setup.known
    x, y, area = _places(silo[0], silo[6:8])
    bottom, surface = floor.at(floor.z, x, y), core.z_at(np.column_stack([x, y]))
    thickness = bottom - surface
    std = np.hypot(floor.at(floor.std, x, y), setup.wall_std)
    seen = _seen(core, x, y)
    counted = np.where(seen, thickness, np.maximum(thickness, 0.0))
    covered = np.abs(thickness) > BELOW * std
    floor_std = float((np.where(counted > 0.0, floor.at(floor.std, x, y), 0.0)).sum() * area)
    by = _derivatives(floor, found, silo, float(counted.reshape(RINGS, SPOKES)[-1].mean()))
    parts = {name: std_by(by, known.covariance, group) for name, group in GROUPS.items()}
    parts["geometry"] = math.hypot(parts["geometry"], floor_std)
    own = {"noise": found.std.noise, "unseen": found.std.unseen, "grid": found.std.grid}
    total = math.hypot(std_by(by, known.covariance, slice(None)), floor_std, *own.values())
    sunken = float((covered & (thickness < 0.0) & seen).sum() / max(seen.sum(), 1))
    capacity = float((bottom - silo[3]).sum() * area)
    return OverFloor(max(float(counted.sum() * area), 0.0), total, Parts(**parts, **own), capacity, sunken, counted)


def _places(radius: float, ovality: tuple[float, ...]) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Places of equal area over the disc, and that area."""
    across = radius * np.sqrt((np.arange(RINGS) + 0.5) / RINGS)
    angle = 2.0 * math.pi * (np.arange(SPOKES) + 0.5) / SPOKES
    r, phi = (v.ravel() for v in np.meshgrid(across, angle, indexing="ij"))
    stretch = 1.0 + 0.5 * sum(o * o for o in ovality)
    return r * np.cos(phi), r * np.sin(phi), stretch * math.pi * radius**2 / (RINGS * SPOKES)


def _seen(core: _core.ContentSurface, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.bool_]:
    kinds = core.kinds()
    grid = core.grid
    (cx, cy), reach, side = grid.centre, grid.reach, grid.side
    column, row = (
        np.clip(((v - c + reach) * side / (2.0 * reach)).astype(int), 0, side - 1) for v, c in ((x, cx), (y, cy))
    )
    return np.isin(kinds[row, column], (KINDS["content"], KINDS["rim"], KINDS["floor"]))


def _derivatives(floor: FloorMap, found: _core.ContentMeasure, silo: CoreVessel, at_wall: float) -> NDArray[np.float64]:
    """Derivatives (10,) of the volume: of the empty vessel's ullage less this frame's."""
    by = found.derivatives - capacity_derivatives(silo)
    by[4] = 2.0 * math.pi * silo[0] * at_wall  # a ring more of content at a wider wall
    if floor.derivatives is None:
        by[5] += math.pi * silo[0] ** 2  # the floor hangs at the cylinder's lower edge
        return by
    by[[0, 1, 2, 3, 7, 8, 9]] += floor.derivatives[[0, 1, 2, 3, 7, 8, 9]]
    return by
