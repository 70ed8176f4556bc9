"""What is known before a frame's content is measured, as the core reads it: by the names of the fields."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from siloscope.content.knowledge import WALL_STD, Knowledge
from siloscope.types.floor import FloorMap


class CoreVessel(NamedTuple):
    """A silo's lengths in the silo frame, m; z down from the camera's height."""

    radius: float
    cylinder_bottom: float
    """z where the cylinder meets the cone."""
    apex: float
    """z of the cone's vertex."""
    top: float
    """z of the upper edge."""
    outlet_radius: float
    outlet_length: float
    oval_cos: float
    oval_sin: float


class CoreFloor(NamedTuple):
    """A floor on a square grid about the axis, m; z down in the silo frame."""

    reach: float
    """Half the side of the square."""
    z: NDArray[np.float64]
    std: NDArray[np.float64]
    of_camera: bool
    """Whether the camera of the frames has seen it: their common errors then drop out."""

    @classmethod
    def of(cls, floor: FloorMap | None) -> CoreFloor | None:
        """As the core takes it."""
        return None if floor is None else cls(floor.reach, floor.z, floor.std, floor.derivatives is not None)


@dataclass(frozen=True, eq=False)
class ContentSetup:
    """What is known with what is uncertain about it, and the silo's lengths completed by a datasheet."""

    known: Knowledge
    silo: CoreVessel
    floor: CoreFloor | None = None
    """The floor where it is not the silo's cone."""
    wall_std: float = WALL_STD
    """How uneven the wall is, m (standard deviation)."""
