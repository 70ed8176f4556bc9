"""The walls."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from siloscope import _core
from siloscope.simulation.checked import checked
from siloscope.simulation.feed import Feed
from siloscope.types.vessel import SiloGeometry

BOTTOMS = ("cone", "oblique", "two-stage", "pyramid", "flat")
"""What can close a silo below."""


@dataclass(frozen=True)
class Silo:
    """A cylinder on a bottom, in metres. The silo frame's z points down and is 0 at the camera's height."""

    radius: float
    """Radius of the cylinder, of its lowest course where it has several."""
    cylinder_height: float
    cone_height: float
    """Height from the cylinder's bottom to the vertex, which an outlet may have cut away; 0 for a flat floor."""
    outlet_radius: float = 0.0
    """Radius of the outlet pipe; 0 for a cone that ends in its vertex."""
    top: float = 0.0
    """z of the cylinder's upper edge: 0 for a camera at the edge, negative for one that hangs below it."""
    outlet_length: float = 0.3
    """How far the outlet pipe reaches below the vertex, to its closed end."""
    outlet_offset: tuple[float, float] = (0.0, 0.0)
    """Offset of the outlet pipe from the axis, and of an oblique cone's vertex."""
    roof: bool = False
    """Whether a roof covers the upper edge."""
    roof_height: float = 0.0
    """Height of the roof's tip over the edge; 0 for a flat roof."""
    bottom: str = "cone"
    """One of `BOTTOMS`: a right cone; an oblique one, whose vertex is at `outlet_offset`; a cone to a waist and another
    from there; a pyramid of four sides that touch the cylinder at its lower edge; a flat floor."""
    waist_radius: float = 0.0
    """Radius between both stages of "two-stage"."""
    waist_depth: float = 0.0
    """How far the waist lies below the cylinder."""
    bottom_azimuth: float = 0.0
    """Direction in which one side of a pyramid falls, rad."""
    courses: tuple[tuple[float, float], ...] = ()
    """Rings of sheet above the lowest one: distance of the lower edge from the top edge, and radius; from above."""

    def __post_init__(self) -> None:
        checked(_core.check_silo, self)

    @property
    def height(self) -> float:
        """Height of cylinder and cone together."""
        return self.cylinder_height + self.cone_height

    @property
    def capacity(self) -> float:
        """Volume of cylinder and bottom down to the vertex, m³, without the outlet pipe."""
        if self.bottom == "cone" and not self.courses:
            return math.pi * self.radius**2 * (self.cylinder_height + self.cone_height / 3.0)
        return checked(_core.silo_capacity, self)

    @property
    def cylinder_bottom(self) -> float:
        """z where the cylinder meets the bottom."""
        return self.top + self.cylinder_height

    @property
    def apex(self) -> float:
        """z of the bottom's vertex, or of a flat floor."""
        return self.cylinder_bottom + self.cone_height

    @property
    def geometry(self) -> SiloGeometry:
        """The silo as estimates describe it; a flat floor has no apex."""
        return SiloGeometry(self.radius, self.cylinder_bottom, None if self.bottom == "flat" else self.apex)

    def feed_heights(self, feed: Feed | None, places: ArrayLike) -> NDArray[np.float64]:
        """Height of the feed surface over the vertex at places (..., 2) of the silo frame's x and y.

        NaN outside the silo and where the cone is bare.
        """
        xy = np.asarray(places, np.float64)
        heights: NDArray[np.float64] = checked(_core.feed_heights, self, feed, xy.reshape(-1, 2))
        return heights.reshape(xy.shape[:-1])
