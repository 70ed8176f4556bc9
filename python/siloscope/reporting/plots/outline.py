"""What the pictures of a content share: the silo's outline over the datum, the colours of grain, the headline."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from numpy.typing import NDArray

from siloscope.types.content import Content
from siloscope.types.surface_map import SurfaceMap
from siloscope.wording import with_std

Numbers = NDArray[np.float64]

GRAIN = LinearSegmentedColormap.from_list("grain", ["#3b2a14", "#8a5a1c", "#d9962b", "#f6d88b", "#fff6da"])
"""Low to high: dark to light in print too."""


@dataclass(frozen=True)
class Outline:
    """Heights of the silo's parts over the datum."""

    radius: float
    joint: float | None
    """Where the cylinder meets the cone; None where the cone is not known."""
    vertex: float
    top: float

    def floor(self, r: Numbers) -> Numbers:
        """Height of the floor at distances from the axis; the datum where nobody knows the cone."""
        if self.joint is None:
            return np.full(r.shape, self.vertex)
        return np.asarray(self.vertex + (self.joint - self.vertex) * np.minimum(r / self.radius, 1.0))


def outline_of(content: Content) -> tuple[SurfaceMap, Outline]:
    """A reading's surface and the silo about it; `ValueError` for a reading without a surface."""
    surface, lengths = content.surface, content.lengths
    if surface is None or surface.radius is None or lengths is None:
        raise ValueError("the reading has no surface to draw; see its status and reason")
    geometry, datum = lengths.geometry, surface.datum
    known = geometry.apex is not None and geometry.cylinder_bottom is not None
    joint = datum - geometry.cylinder_bottom if known and geometry.cylinder_bottom is not None else None
    vertex = datum - geometry.apex if geometry.apex is not None else 0.0
    return surface, Outline(surface.radius, joint, vertex, datum - lengths.top)


def datum(content: Content) -> str:
    """From where heights are measured, in words."""
    return "cone's vertex" if content.height_datum == "cone-vertex" else "lowest point seen"


def headline(content: Content) -> str:
    """The sentence that a content picture carries."""
    if content.volume is None or content.volume_std is None:
        return f"{content.source}: level without volume; missing {', '.join(content.missing)}"
    fill = "" if content.fill_fraction is None else f", {100 * content.fill_fraction:.1f} % full"
    return with_std(content.volume, content.volume_std, 1.0, f" m³{fill}")
