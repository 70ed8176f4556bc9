"""A move of the camera."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Move:
    """A move of the camera before frame `index` of the sequence: by how much, and how sure that is."""

    index: int
    turn: float
    """Angle between the axis directions before and after, rad (r_x and r_y together)."""
    shift: float
    """Change of (t_x, t_y), m."""
    significance: float
    """Squared distance between the poses in units of its covariance."""
