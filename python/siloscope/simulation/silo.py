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


@dataclass(frozen=True)
class Silo:
    """A cylinder on a cone, in metres. The silo frame's z points down and is 0 at the camera's height."""

    radius: float
    cylinder_height: float
    cone_height: float
    """Height from the cylinder's bottom to the cone's vertex, which an outlet may have cut away."""
    outlet_radius: float = 0.0
    """Radius of the outlet pipe; 0 for a cone that ends in its vertex."""
    top: float = 0.0
    """z of the cylinder's upper edge: 0 for a camera at the edge, negative for one that hangs below it."""
    outlet_length: float = 0.3
    """How far the outlet pipe reaches below the vertex, to its closed end."""
    outlet_offset: tuple[float, float] = (0.0, 0.0)
    """Offset of the outlet pipe from the axis."""
    roof: bool = False
    """Whether a flat roof covers the upper edge."""

    def __post_init__(self) -> None:
        checked(_core.check_silo, self)

    @property
    def height(self) -> float:
        """Height of cylinder and cone together."""
        return self.cylinder_height + self.cone_height

    @property
    def capacity(self) -> float:
        """Volume of cylinder and cone down to the vertex, m³, without the outlet pipe."""
        return math.pi * self.radius**2 * (self.cylinder_height + self.cone_height / 3.0)

    @property
    def cylinder_bottom(self) -> float:
        """z where the cylinder meets the cone."""
        return self.top + self.cylinder_height

    @property
    def apex(self) -> float:
        """z of the cone's vertex."""
        return self.cylinder_bottom + self.cone_height

    @property
    def geometry(self) -> SiloGeometry:
        """The silo as estimates describe it."""
        return SiloGeometry(self.radius, self.cylinder_bottom, self.apex)

    def feed_heights(self, feed: Feed | None, places: ArrayLike) -> NDArray[np.float64]:
        """Height of the feed surface over the vertex at places (..., 2) of the silo frame's x and y.

        NaN outside the silo and where the cone is bare.
        """
        xy = np.asarray(places, np.float64)
        heights: NDArray[np.float64] = checked(_core.feed_heights, self, feed, xy.reshape(-1, 2))
        return heights.reshape(xy.shape[:-1])
