"""What one frame says about the content: level, volume, mass, and how sure they are."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.schema import CONTENT
from siloscope.types.by_value import ByValue
from siloscope.types.floor import Floor
from siloscope.types.remark import Remark
from siloscope.types.surface_map import Shape, SurfaceMap
from siloscope.types.vessel import Lengths, to_plain

DATUMS = ("cone-vertex", "floor", "lowest-seen")
"""From where heights are measured upwards."""


@dataclass(frozen=True)
class Level:
    """Heights of the surface over the datum, m; None where they can't be told."""

    mean: float | None = None
    """By area seen from above."""
    min: float | None = None
    max: float | None = None
    at_axis: float | None = None
    at_wall: float | None = None
    """Mean along the line where the surface meets cylinder or cone."""
    std: float | None = None
    """Standard deviation of the mean."""

    def to_dict(self) -> dict[str, float | None]:
        """Plain data."""
        return {name: getattr(self, name) for name in ("mean", "min", "max", "at_axis", "at_wall", "std")}


@dataclass(frozen=True)
class Parts:
    """Standard deviations of the volume by cause, m³. Pose, geometry and depth are correlated: they don't add up."""

    pose: float
    """The camera's pose."""
    geometry: float
    """The silo's lengths."""
    depth: float
    """The sensor's systematic depth error, its scale above all."""
    noise: float
    """The sensor's noise."""
    unseen: float
    """What is not seen of the surface."""
    grid: float
    """The map's cells."""

    def to_dict(self) -> dict[str, float]:
        """Plain data."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}


MOVING = 4.0
"""Standard deviations of the difference between two frames' volumes that is a movement."""

HIDDEN_ALIKE = 0.2
"""Share of what the unseen leaves that differs from one frame to the next; the rest hides the same in both."""


@dataclass(frozen=True, eq=False, repr=False)
class Content(ByValue):
    """The content of a silo at one moment. Cubic metres, metres, kilograms, radians.

    A refused reading (`status` "refused") has no numbers; `reason` is one of `siloscope.reasons.CONTENT_REMARKS` and
    `message` says what it means and what to do. A number that needs something unknown is None, and `missing` names it.
    """

    status: str
    reason: str | None = None
    message: str | None = None
    """Why there is no answer, or no volume, and what would settle it."""
    volume: float | None = None
    volume_std: float | None = None
    parts: Parts | None = None
    ullage: float | None = None
    """Free space under the fill height, m³; it needs no bottom."""
    ullage_std: float | None = None
    ullage_parts: Parts | None = None
    ullage_derivatives: NDArray[np.float64] | None = None
    """(10,) derivatives of the ullage by the calibration's parameters."""
    capacity: float | None = None
    capacity_from: str | None = None
    """"calibration", "datasheet" or "strapping"."""
    level: Level = field(default_factory=Level)
    height_datum: str | None = None
    """One of `DATUMS`."""
    coverage: float | None = None
    """Share of the surface that is really seen."""
    mass: float | None = None
    mass_std: float | None = None
    moisture: float | None = None
    """Fraction of the wet mass."""
    density: dict[str, Any] | None = None
    """Density with its source, and its mean under the content's own weight."""
    shape: Shape | None = None
    quality: tuple[Remark, ...] = ()
    missing: tuple[str, ...] = ()
    """What a volume needs and nobody knows: "bottom", or lengths by the names of their options."""
    assumed: tuple[str, ...] = ()
    """What was taken for granted, in words."""
    lengths: Lengths | None = None
    floor: Floor = field(default_factory=Floor)
    timestamp: float | None = None
    source: str = "frame"
    config: dict[str, Any] = field(default_factory=dict)
    timing_ms: dict[str, float] = field(default_factory=dict, compare=False)
    """Milliseconds by stage; no part of the answer, so it is not compared."""
    surface: SurfaceMap | None = None

    @property
    def ok(self) -> bool:
        """Whether there is an answer."""
        return self.status == "ok"

    @property
    def fill_fraction(self) -> float | None:
        """Volume as a share of the capacity."""
        return None if self.volume is None or not self.capacity else self.volume / self.capacity

    @property
    def free(self) -> float | None:
        """Volume that still fits, m³."""
        return None if self.volume is None or self.capacity is None else self.capacity - self.volume

    @property
    def own_std(self) -> float | None:
        """The part of the deviation that differs from reading to reading, m³: noise, grid, some of the unseen.

        Pose, geometry and depth err alike in all readings of one calibration, so they drop out of a difference.
        """
        parts = self.parts or self.ullage_parts
        return None if parts is None else math.hypot(parts.noise, parts.grid, HIDDEN_ALIKE * parts.unseen)

    def change_since(self, earlier: Content) -> tuple[float, float] | None:
        """Volume gained since an earlier reading, m³, and its standard deviation (`own_std`); None without a surface.

        It is the ullage lost where one of the two has no volume, and so needs no bottom.
        """
        if self.own_std is None or earlier.own_std is None:
            return None
        std = math.hypot(self.own_std, earlier.own_std)
        if self.volume is not None and earlier.volume is not None:
            return self.volume - earlier.volume, std
        if self.ullage is not None and earlier.ullage is not None:
            return earlier.ullage - self.ullage, std
        return None

    @property
    def dry_mass(self) -> float | None:
        """Dry matter, kg."""
        return None if self.mass is None or self.moisture is None else self.mass * (1.0 - self.moisture)

    def has(self, code: str) -> bool:
        """Whether a remark of this code is there."""
        return any(remark.code == code for remark in self.quality)

    def to_dict(self) -> dict[str, Any]:
        """The document of ``siloscope measure --json`` (schema ``siloscope.content/1``)."""
        return {
            "schema": CONTENT,
            "status": self.status,
            "reason": self.reason,
            "message": self.message,
            "volume_m3": self.volume,
            "volume_std_m3": self.volume_std,
            "volume_std_parts_m3": None if self.parts is None else self.parts.to_dict(),
            "ullage_m3": self.ullage,
            "ullage_std_m3": self.ullage_std,
            "ullage_std_parts_m3": None if self.ullage_parts is None else self.ullage_parts.to_dict(),
            "fill_fraction": self.fill_fraction,
            "free_m3": self.free,
            "capacity_m3": self.capacity,
            "capacity_from": self.capacity_from,
            "level_m": self.level.to_dict(),
            "height_datum": self.height_datum,
            "coverage": self.coverage,
            "mass_kg": self.mass,
            "mass_std_kg": self.mass_std,
            "moisture": self.moisture,
            "dry_mass_kg": self.dry_mass,
            "density": self.density,
            "shape": None if self.shape is None else self.shape.to_dict(),
            "quality": [remark.to_dict() for remark in self.quality],
            "missing": list(self.missing),
            "assumed": list(self.assumed),
            "floor": self.floor.to_dict(),
            "silo": None if self.lengths is None else to_plain(self.lengths),
            "timestamp": self.timestamp,
            "source": self.source,
            "config": self.config,
            "timing_ms": self.timing_ms,
        }


def with_movement(now: Content, previous: Content | None) -> Content:
    """With the remark that the content moved since the frame before, where it did."""
    change = None if previous is None else now.change_since(previous)
    if change is None or abs(change[0]) <= MOVING * change[1]:
        return now
    return replace(
        now, quality=(*now.quality, Remark("filling-in-progress", f"{change[0]:+.3f} m³ since the frame before"))
    )
