"""Content over a floor that is known as a map: what the floor adds to the core's numbers.

The core fits the surface through the cells that lie over the floor, continues it where nothing is seen, and counts the
cells that show the floor bare with their own thickness and its sign: noise on bare floor then adds up to nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.content.knowledge import DETECTABLE, WALL_STD, Knowledge
from siloscope.content.setup import CoreVessel
from siloscope.content.ullage import GROUPS, Ullage, std_by, top_std
from siloscope.types.content import Parts
from siloscope.types.floor import FloorMap

RINGS, SPOKES = 64, 90
"""Rings and spokes of the midpoint rule over the disc."""


@dataclass(frozen=True)
class OverFloor:
    """Content over a mapped floor."""

    volume: float
    std: float
    parts: Parts
    capacity: float
    free: Ullage
    columns: NDArray[np.float64]
    """Heights of the content over the floor at places of equal area, m."""


def volume_over(floor: FloorMap, found: _core.ContentMeasure, known: Knowledge, silo: CoreVessel) -> OverFloor:
    """The content between a surface, or none, and a floor that is known as a map.

    Parameters
    ----------
    floor : FloorMap
        The floor.
    found : ContentMeasure
        The core's answer.
    known : Knowledge
        Pose, lengths and their covariance.
    silo : CoreVessel
        The lengths that the core measured with.
    """
    x, y, area = places(silo[0], silo[6:8])
    bottom, bottom_std = floor.at(floor.z, x, y), floor.at(floor.std, x, y)
    under, whole = found.volume, area * len(x)
    filled, counted, floor_std = (0.0, 0.0, 0.0) if under is None else (under.volume, under.counted, under.floor_std)
    by = found.derivatives.copy()
    if floor.derivatives is not None:
        by += _of_floor(floor.derivatives) * (counted / whole)  # the floor's own move with camera and sensor
    capacity_by = _capacity_derivatives(floor, silo, bottom, known.lengths.top_from)
    rest_std = max(float(bottom_std.sum() * area) - floor_std, 0.0)
    layer = floor_std if under else DETECTABLE * math.hypot(WALL_STD, floor.mean_std) * whole
    volume_parts, std = _deviations(by, found, known, layer)
    rest_std = math.hypot(rest_std, top_std(known, silo))
    ullage_parts, ullage_std = _deviations(capacity_by - by, found, known, rest_std)
    capacity = float((bottom - silo[3]).sum() * area)
    free = Ullage(capacity - max(filled, 0.0), ullage_std, ullage_parts, capacity_by - by)
    columns = np.zeros(0) if found.surface is None else bottom - found.surface.z_at(np.column_stack([x, y]))
    return OverFloor(max(filled, 0.0), std, volume_parts, capacity, free, columns[columns > 0.0])


def _deviations(
    by: NDArray[np.float64], found: _core.ContentMeasure, known: Knowledge, floor_std: float
) -> tuple[Parts, float]:
    """Standard deviations by cause and all together; `floor_std` is what the floor's own adds, m³."""
    parts = {name: std_by(by, known.covariance, group) for name, group in GROUPS.items()}
    parts["geometry"] = math.hypot(parts["geometry"], floor_std)
    own = {"noise": found.std.noise, "unseen": found.std.unseen, "grid": found.std.grid}
    total = math.hypot(std_by(by, known.covariance, slice(None)), floor_std, *own.values())
    return Parts(**parts, **own), total


def _of_floor(derivatives: NDArray[np.float64]) -> NDArray[np.float64]:
    """Those of pose and depth: the radius is the core's."""
    made = derivatives.copy()
    made[4:7] = 0.0
    return made


def _capacity_derivatives(
    floor: FloorMap, silo: CoreVessel, bottom: NDArray[np.float64], top_from: str
) -> NDArray[np.float64]:
    """Derivatives (10,) of the capacity by the parameters."""
    if floor.derivatives is not None:
        return floor.derivatives
    made = np.zeros(10)
    at_wall = float(bottom.reshape(RINGS, SPOKES)[-1].mean()) - silo[3]
    made[4] = 2.0 * math.pi * silo[0] * at_wall
    made[5] = 0.0 if top_from == "datasheet" else math.pi * silo[0] ** 2  # an edge placed from the joint moves with it
    return made


def places(radius: float, ovality: tuple[float, ...]) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Places of equal area over the disc, and that area."""
    across = radius * np.sqrt((np.arange(RINGS) + 0.5) / RINGS)
    angle = 2.0 * math.pi * (np.arange(SPOKES) + 0.5) / SPOKES
    r, phi = (v.ravel() for v in np.meshgrid(across, angle, indexing="ij"))
    stretch = 1.0 + 0.5 * sum(o * o for o in ovality)
    return r * np.cos(phi), r * np.sin(phi), stretch * math.pi * radius**2 / (RINGS * SPOKES)
