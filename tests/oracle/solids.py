"""What a ray can meet: a solid is a bound of the distance to it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Labels = NDArray[np.uint8]

NONE, CYLINDER, BOTTOM, FEED, OTHER = range(5)
"""What a pixel shows: nothing; the vessel's wall; its bottom; feed, also where it sticks; anything else."""


class Solid(Protocol):
    """A solid that bounds the air."""

    def air(self, x: Array, y: Array, z: Array) -> Array:
        """At most the distance to the solid from points in the air; negative inside the solid. Continuous."""

    def label(self, x: Array, y: Array, z: Array) -> Labels:
        """What is seen at points of its surface."""


def air(solids: Sequence[Solid], x: Array, y: Array, z: Array) -> Array:
    """At most the distance to the nearest solid; infinite where there is none."""
    nearest = np.full(x.shape, np.inf)
    for solid in solids:
        np.minimum(nearest, solid.air(x, y, z), out=nearest)
    return nearest


def labels(solids: Sequence[Solid], x: Array, y: Array, z: Array) -> Labels:
    """Label of the solid whose surface the points are on."""
    distances = np.stack([np.abs(solid.air(x, y, z)) for solid in solids])
    found = np.stack([solid.label(x, y, z) for solid in solids])
    chosen: Labels = np.take_along_axis(found, distances.argmin(axis=0)[None], axis=0)[0]
    return chosen


def everywhere(label: int, like: Array) -> Labels:
    """One label for all points."""
    return np.full(like.shape, label, np.uint8)
