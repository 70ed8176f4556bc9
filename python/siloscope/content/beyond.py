"""What a surface of which only a small part is seen may do beyond it, and what an empty vessel may hide.

The fit goes on with the slope that it has seen. Feed need not: a crater ends in the ring that is left along the wall, a
heap in the level that it was poured on, and no frame that shows the flank alone tells where.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.content.measured import Measured
from siloscope.content.over_floor import OverFloor
from siloscope.content.ullage import Ullage
from siloscope.types.content import Parts
from siloscope.types.surface_map import SurfaceMap

LITTLE = 0.2
"""Share of the surface below which what is seen does not tell how it goes on."""

BREAK = 0.5
"""Standard deviation of the height beyond what is seen, as a share of what the fit rises by from there."""


def hidden_std(found: _core.ContentMeasure) -> float:
    """What an empty vessel may hide, as a standard deviation, m³: anything up to the most is as probable."""
    return found.hidden / math.sqrt(3.0)


def break_std(surface: SurfaceMap, coverage: float | None) -> float:
    """What it adds to the volume's standard deviation, m³, where less than `LITTLE` of the surface is seen."""
    if coverage is None or coverage >= LITTLE:
        return 0.0
    seen = surface.seen & surface.inside
    if not seen.any():
        return 0.0
    y, x = np.meshgrid(surface.y, surface.x, indexing="ij")
    edge, beyond = seen & ~_inner(seen), surface.inside & ~seen
    ends, places = np.column_stack([x[edge], y[edge]]), np.column_stack([x[beyond], y[beyond]])
    apart = [int(np.argmin(((ends - place) ** 2).sum(axis=1))) for place in places]
    rise = np.abs(surface.heights[beyond] - surface.heights[edge][apart])
    return float(BREAK * rise.sum() * surface.cell**2)


def _inner(seen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Seen cells whose four neighbours are seen."""
    wide = np.pad(seen, 1)
    return wide[:-2, 1:-1] & wide[2:, 1:-1] & wide[1:-1, :-2] & wide[1:-1, 2:]


def widened(
    found: Measured, over: OverFloor | None, free: Ullage | None, std: float
) -> tuple[Measured, OverFloor | None, Ullage | None]:
    """Content and free space with a standard deviation more, m³."""
    if std == 0.0:
        return found, over, free
    found = replace(found, parts=_unseen(found.parts, std), total=math.hypot(found.total, std))
    if free is not None:
        free = replace(free, parts=_unseen(free.parts, std), std=math.hypot(free.std, std))
    if over is not None and free is not None:
        over = replace(over, parts=_unseen(over.parts, std), std=math.hypot(over.std, std), free=free)
    return found, over, free


def _unseen(parts: Parts, std: float) -> Parts:
    return replace(parts, unseen=math.hypot(parts.unseen, std))
