"""Volumes by quadrature over the true vessel, whatever its shape."""

from __future__ import annotations

import numpy as np

from .feed import Feed
from .scenes import Vessel
from .solids import Array


def content(vessel: Vessel, feed: Feed | None, fineness: int = 200) -> float:
    """Volume of the feed between its surface and the vessel's true wall and bottom, m³."""
    return 0.0 if feed is None else _volume(vessel, feed, fineness, below=True)


def ullage(vessel: Vessel, feed: Feed | None, fineness: int = 200) -> float:
    """Free volume between the vessel's upper edge and the feed (or the empty vessel), m³."""
    return _volume(vessel, feed, fineness, below=False)


def _volume(vessel: Vessel, feed: Feed | None, fineness: int, below: bool) -> float:
    """Integral over z, azimuth and the share u of the wall's radius, of the cells' parts that are inside.

    With r = u·R(azimuth, z) the wall needs no cutting; bottom and feed cut cells along z, where a straight line between
    the cell's ends tells the part.
    """
    wall, bottom = vessel.wall, vessel.bottom
    z = np.linspace(vessel.top, bottom.lowest, 4 * fineness + 1)
    u = (np.arange(fineness) + 0.5) / fineness
    azimuths = (np.arange(fineness) + 0.5) * 2.0 * np.pi / fineness
    total = 0.0
    for azimuth in azimuths:
        radius = wall.radius_at(np.full(z.shape, azimuth), z)
        x, y = np.outer(radius * np.cos(azimuth), u), np.outer(radius * np.sin(azimuth), u)
        heights = np.broadcast_to(z[:, None], x.shape)
        inside = _part(bottom.air(x, y, heights))
        if feed is not None:
            above = feed.air(x, y, heights)
            inside = inside * (_part(-above) if below else _part(above))
        square = 0.5 * (radius[1:] ** 2 + radius[:-1] ** 2)
        total += float((inside * u).sum(axis=1) @ square)
    cell = float(z[1] - z[0]) * (2.0 * np.pi / fineness) / fineness
    return total * cell


def _part(value: Array) -> Array:
    """Part of each cell along the first axis in which a quantity is positive, straight between the ends."""
    a, b = value[:-1], value[1:]
    gap = np.where(a == b, 1.0, a - b)
    crossing = np.clip(a / gap, 0.0, 1.0)
    return np.where(a > 0.0, np.where(b > 0.0, 1.0, crossing), np.where(b > 0.0, 1.0 - crossing, 0.0))
