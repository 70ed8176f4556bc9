"""A wall in all parameters of the joint fit, as the core reads it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from siloscope.types.frame_factor import GROUPS
from siloscope.types.pose import SiloPose

Vector = NDArray[np.float64]

SIZE = sum(GROUPS.values())
"""Number of parameters."""

COLUMNS = {
    name: slice(end - size, end) for (name, size), end in zip(GROUPS.items(), accumulate(GROUPS.values()), strict=True)
}
"""Where each group of parameters stands."""

RADIUS = COLUMNS["radius"].start
SLOPE = COLUMNS["cone"].start
INTERCEPT = SLOPE + 1
OFFSET = slice(SLOPE + 2, SLOPE + 4)
OBLIQUITY = slice(SLOPE + 4, SLOPE + 6)


@dataclass(frozen=True, eq=False)
class Wall:
    """Where a camera hangs in which vessel, which the core reads by the names of the fields."""

    state: Vector
    """(71,) in the order of `GROUPS`."""
    has_cylinder: bool
    has_cone: bool
    reference: float
    """Height to which the form and the cone's offset are told, m."""

    @property
    def pose(self) -> SiloPose:
        """The camera's pose."""
        return SiloPose(*(float(v) for v in self.state[COLUMNS["pose"]]))

    @property
    def size(self) -> float:
        """A length that tells how large the vessel is, m: its radius, or that of the cone halfway to the camera."""
        return float(self.state[RADIUS] if self.has_cylinder else 0.5 * abs(self.state[INTERCEPT]))

    def moved(self, step: Vector) -> Wall:
        """With a step (71,) added."""
        return replace(self, state=self.state + step)
