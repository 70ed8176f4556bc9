"""What is known of a vessel's bottom, and how."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.types.by_value import ByValue


@dataclass(frozen=True)
class SeenCone:
    """The conical surface that a calibration has found: a bottom, or feed."""

    angle: float
    """Its slope against the horizontal, radians."""
    std: float
    """Standard deviation of the slope, radians."""

    def __str__(self) -> str:
        return f"{math.degrees(self.angle):.0f}°"


@dataclass(frozen=True, eq=False, repr=False)
class FloorMap(ByValue):
    """A floor on a square grid, z in the silo frame (downwards), m."""

    reach: float
    """Half the side of the square about the axis."""
    z: NDArray[np.float64]
    """(n, n) heights z at the cells' middles, rows along y."""
    std: NDArray[np.float64]
    """(n, n) standard deviations, which are taken as common to the whole floor."""
    derivatives: NDArray[np.float64] | None = None
    """(10,) derivatives of the empty vessel's ullage by `siloscope.content.knowledge.PARAMETERS`, for a floor that the
    camera itself saw: it then errs with the camera. None for a floor of a datasheet."""
    seen: float = 1.0
    """Fraction of the floor that was seen; the rest is completed."""
    completed: str | None = None
    """The kind of bottom that completes it; None where it is continued from its slope, or seen as a whole."""

    @property
    def lowest(self) -> float:
        """z of the lowest place."""
        return float(self.z.max())

    @property
    def mean_std(self) -> float:
        """Mean standard deviation of the places within the wall, m."""
        x, y = self.middles(self.reach, len(self.std))
        return float(self.std[np.hypot(x, y) <= self.reach].mean())

    def at(self, values: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        """A map's values between the cells' middles, bilinear, the nearest ones beyond the edge."""
        side = len(values)
        column, row = ((v + self.reach) * side / (2.0 * self.reach) - 0.5 for v in (x, y))
        column, row = (np.clip(v, 0.0, side - 1.0) for v in (column, row))
        left, low = (np.minimum(v.astype(int), side - 2) for v in (column, row))
        a, b = column - left, row - low
        made = (1 - b) * ((1 - a) * values[low, left] + a * values[low, left + 1])
        made += b * ((1 - a) * values[low + 1, left] + a * values[low + 1, left + 1])
        return np.asarray(made)

    @staticmethod
    def middles(reach: float, side: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """x and y (n, n) of the cells' middles."""
        line = (np.arange(side) + 0.5) * (2.0 * reach / side) - reach
        x, y = np.meshgrid(line, line)
        return x, y

    def to_dict(self) -> dict[str, Any]:
        """Plain data; heights to 0.01 mm."""
        return {
            "reach": self.reach,
            "z": np.round(self.z, 5).tolist(),
            "std": np.round(self.std, 6).tolist(),
            "derivatives": None if self.derivatives is None else self.derivatives.tolist(),
            "seen": self.seen,
            "completed": self.completed,
        }


@dataclass(frozen=True, eq=False, repr=False)
class Floor(ByValue):
    """What is known of the bottom; an unknown one gives no volume."""

    kind: str = "unknown"
    """One of `siloscope.reasons.BOTTOM_KINDS`."""
    evidence: str | None = None
    """One of `siloscope.reasons.BOTTOM_EVIDENCE`; None for an unknown bottom."""
    seen: SeenCone | None = None
    """The conical surface that was seen, whether it is the bottom or not."""
    hidden_std: float = 0.0
    """What the part of the bottom that was never seen adds to a volume's standard deviation, m³."""
    map: FloorMap | None = None
    """Its heights, where it is neither a coaxial cone nor flat."""
    reach: tuple[float, float] | None = None
    """Distances from the axis between which the conical surface was seen bare, m; None where that is not recorded."""

    @property
    def known(self) -> bool:
        """Whether there is a floor to measure from."""
        return self.kind != "unknown"

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        seen = self.seen
        return {
            "kind": self.kind,
            "evidence": self.evidence,
            "seen_fraction": None if self.map is None else self.map.seen,
            "completed_as": None if self.map is None else self.map.completed,
            "seen_cone": None if seen is None else {"angle_rad": seen.angle, "std_rad": seen.std},
        }
