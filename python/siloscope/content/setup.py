"""What is known before a frame's content is measured, as the core reads it: by the names of the fields."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from siloscope.content.knowledge import WALL_STD, Knowledge


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


@dataclass(frozen=True, eq=False)
class ContentSetup:
    """What is known with what is uncertain about it, and the silo's lengths completed by a datasheet."""

    known: Knowledge
    silo: CoreVessel
    wall_std: float = WALL_STD
    """How uneven the wall is, m (standard deviation)."""
