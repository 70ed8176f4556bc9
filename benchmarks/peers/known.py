"""The cloud of a silo whose geometry is known: what registration needs and the axis job does not give."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from siloscope.reproduction.sensor_trials import ideal_cloud
from siloscope.simulation import Silo

SPACING = 0.03
"""Distance between neighbouring points, m."""


@dataclass(frozen=True, eq=False)
class Target:
    """Points and inward normals of the wall, (N, 3), silo frame."""

    points: NDArray[np.float64]
    normals: NDArray[np.float64]


@cache
def target_of(silo: Silo) -> Target:
    """The wall of a silo."""
    points = ideal_cloud(silo, SPACING)
    radial = -points[:, :2] / np.maximum(np.hypot(points[:, 0], points[:, 1]), 1e-9)[:, None]
    conical = points[:, 2] > silo.top + silo.cylinder_height
    slant = np.hypot(silo.radius, silo.cone_height)
    across = np.where(conical, silo.cone_height / slant, 1.0)
    up = np.where(conical, -silo.radius / slant, 0.0)
    return Target(points, np.column_stack([radial * across[:, None], up]))
