"""What the core measured of a frame's content, and what is stated of it."""

from __future__ import annotations

from dataclasses import dataclass

from siloscope import _core
from siloscope.types.content import Parts


@dataclass(frozen=True, eq=False)
class Measured:
    """The core's numbers with the deviations that are stated, which a floor map or a moved camera changes."""

    core: _core.ContentMeasure
    parts: Parts
    """Standard deviations by cause, m³."""
    total: float
    """All together, m³."""
    sunken: float
    """Fraction of the seen cells surely below the floor."""

    @classmethod
    def of(cls, core: _core.ContentMeasure) -> Measured:
        """As the core states it."""
        std = core.std
        parts = Parts(std.pose, std.geometry, std.depth, std.noise, std.unseen, std.grid)
        return cls(core, parts, std.total, core.sunken)
