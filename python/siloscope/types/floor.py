"""What is known of a vessel's bottom, and how."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class SeenCone:
    """The conical surface that a calibration has found: a bottom, or feed."""

    angle: float
    """Its slope against the horizontal, radians."""
    std: float
    """Standard deviation of the slope, radians."""

    def __str__(self) -> str:
        return f"{math.degrees(self.angle):.0f}°"


@dataclass(frozen=True)
class Floor:
    """What is known of the bottom; an unknown one gives no volume."""

    kind: str = "unknown"
    """One of `siloscope.reasons.BOTTOM_KINDS`."""
    evidence: str | None = None
    """One of `siloscope.reasons.BOTTOM_EVIDENCE`; None for an unknown bottom."""
    seen: SeenCone | None = None
    """The conical surface that was seen, whether it is the bottom or not."""

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
            "seen_cone": None if seen is None else {"angle_rad": seen.angle, "std_rad": seen.std},
        }
