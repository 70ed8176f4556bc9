"""Leave one level out: the other frames' vessel predicts what its frames should read of the wall."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.validation.families import over_image, own_part, reach_of
from siloscope.validation.frames import SeenFrame
from siloscope.validation.ideal import Ideal, fitted, inverse_of
from siloscope.validation.levels import by_level
from siloscope.validation.significance import deviation
from siloscope.validation.tiles import Tiles, against

Vector = NDArray[np.float64]

LEAST_TILES = 60
"""Fewer wall tiles tell no pattern."""


@dataclass(frozen=True, eq=False)
class HeldOut:
    """One frame, predicted by frames of other levels."""

    name: str
    level: int
    """Number of its level, from the fullest, 0."""
    tiles: Tiles
    """Its wall tiles against the others' vessel."""
    rms: float
    """Root mean square of its residuals, metres along the rays."""
    expected: float
    """What noise and the prediction's own deviation let expect."""
    deviation: float
    """How rare the pattern over the image is that the residuals have."""

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        plain = {name: getattr(self, name) for name in ("name", "level", "deviation")}
        return {**plain, "rms_m": self.rms, "expected_m": self.expected, "tiles": len(self.tiles)}


def held_out(frames: Sequence[SeenFrame], whole: Ideal, scale: float) -> list[HeldOut]:
    """Every frame against the vessel of the other levels' frames; `scale` is the scatter from frame to frame."""
    levels = by_level(frames)
    if len(levels) < 2:
        return []
    found: dict[int, HeldOut] = {}
    for level, numbers in enumerate(levels):
        others = fitted([one for i, one in enumerate(frames) if i not in numbers], whole.wall)
        for number in numbers:
            one = _predicted(frames[number], level, others, scale)
            if one is not None:
                found[number] = one
    return [found[number] for number in sorted(found)]


def _predicted(frame: SeenFrame, level: int, others: Ideal, scale: float) -> HeldOut | None:
    tiles = against([frame], others.wall)
    if len(tiles) < LEAST_TILES:
        return None
    weight = 1.0 / np.sqrt(tiles.variance)
    rows = tiles.jacobian[:, others.free] * weight[:, None]
    own = over_image(tiles.ray, reach_of(tiles.ray)) * (tiles.depth * weight)[:, None]
    own /= np.maximum(np.sqrt((own**2).sum(axis=0)), 1e-300)
    residual = tiles.residual * weight
    taken = own.T @ rows @ inverse_of(others.information + rows.T @ rows)  # what both may shift and turn
    inverse, dof = own_part(own.T @ own - taken @ (rows.T @ own))
    towards = own.T @ residual - taken @ (rows.T @ residual)
    rare = deviation(float(towards @ inverse @ towards) / max(scale, 1.0), dof)
    spread = np.einsum("ni,ij,nj->n", rows, others.covariance, rows) / weight**2
    expected = float(np.sqrt(np.mean(tiles.variance + spread)))
    return HeldOut(frame.name, level, tiles, float(np.sqrt(np.mean(tiles.residual**2))), expected, rare)
