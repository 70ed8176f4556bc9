"""Two calibrations from two halves of the frames, and how far they differ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.calibrate import calibrate
from siloscope.parameters import PARAMETERS
from siloscope.types.calibration import Calibration
from siloscope.types.estimate import Estimate
from siloscope.types.wall import COLUMNS, RADIUS, SIZE, SLOPE, Wall
from siloscope.validation.frames import Asked, SeenFrame
from siloscope.validation.ideal import referred
from siloscope.validation.levels import by_level, stands
from siloscope.validation.significance import deviation
from siloscope.validation.tiles import Tiles

Vector = NDArray[np.float64]

FEWEST = 2
"""Frames of a half."""

OF_WALL = [*range(COLUMNS["pose"].start, COLUMNS["pose"].stop), RADIUS, SLOPE, SLOPE + 1, *range(4, 7)]
"""Columns of the first ten of `PARAMETERS`: pose, radius, cone, depth bias."""


@dataclass(frozen=True, eq=False)
class Split:
    """Two halves compared; the deviations are those of both, u₀ ⊕ u₁."""

    name: str
    frames: tuple[int, int]
    differences: dict[str, tuple[float, float]]
    """By parameter: the difference and its deviation, radians and metres."""
    deviation: float
    """How rare the difference of all of them is."""
    places: Tiles
    """Wall tiles on which both are compared."""
    apart: Vector
    """(N,) difference of the wall's readings there, metres along the rays."""
    apart_std: Vector

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        largest = np.abs(self.apart).max(initial=0.0)
        return {
            "name": self.name,
            "frames": list(self.frames),
            "deviation": self.deviation,
            "differences": {k: {"difference": d, "std": s} for k, (d, s) in self.differences.items()},
            "wall_apart_m": {"largest": float(largest), "rms": _rms(self.apart), "std": _rms(self.apart_std)},
        }


def splits(frames: Sequence[SeenFrame], asked: Asked, places: Tiles) -> list[Split]:
    """Odd and even frames, first and last half, low and high levels; those whose halves both calibrate."""
    whole = [one for one in frames if one.refused is None]
    numbers = list(range(len(whole)))
    halves = {"odd and even frames": (numbers[::2], numbers[1::2])}
    middle = len(numbers) // 2
    halves["first and last half"] = (numbers[:middle], numbers[middle:])
    if whole and not stands(whole):
        levels = by_level(whole)
        half = len(levels) // 2
        halves["high and low level"] = (list(chain(*levels[:half])), list(chain(*levels[half:])))
    return [split for name, pair in halves.items() if (split := _split(name, whole, pair, asked, places)) is not None]


def _split(
    name: str, frames: Sequence[SeenFrame], pair: tuple[list[int], list[int]], asked: Asked, places: Tiles
) -> Split | None:
    if min(map(len, pair)) < FEWEST:
        return None
    first, second = (calibrated([frames[i].estimate for i in half], asked) for half in pair)
    if first.parameters is None or second.parameters is None:
        return None
    off, covariance = first.parameters - second.parameters, _covariance(first) + _covariance(second)
    std = np.sqrt(np.diag(covariance))
    told = np.isfinite(off) & (std > 0.0)
    differences = {PARAMETERS[k]: (float(off[k]), float(std[k])) for k in np.flatnonzero(told)}
    squares, dof = _squares(off[told], covariance[np.ix_(told, told)])
    tiles, apart = _apart(places, first, second)
    rows = tiles.jacobian[:, OF_WALL]
    spread = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", rows, covariance[:10, :10], rows), 0.0))
    return Split(name, (len(pair[0]), len(pair[1])), differences, deviation(squares, dof), tiles, apart, spread)


def calibrated(answers: Sequence[Estimate], asked: Asked) -> Calibration:
    """Frames' own answers fused."""
    return calibrate(answers, sensor=asked.profile, diameter=asked.diameter, intrinsics=asked.intrinsics)


def wall_of(parameters: Vector) -> Wall:
    """The wall of a calibration's parameters (12,), without form."""
    state = np.zeros(SIZE)
    state[OF_WALL] = np.nan_to_num(parameters[:10])
    seen = np.isfinite(parameters[[4, 6]])
    return referred(Wall(state, bool(seen[0]), bool(seen[1]), 1.0))


def _covariance(found: Calibration) -> Vector:
    return np.zeros((12, 12)) if found.parameter_covariance is None else found.parameter_covariance


def _apart(places: Tiles, first: Calibration, second: Calibration) -> tuple[Tiles, Vector]:
    """On one tile of every place: by how much the readings of two walls differ, to first order about the first."""
    _, one = np.unique(places.place, return_index=True)
    tiles = places.kept(np.isin(np.arange(len(places)), one))
    both = np.nan_to_num(first.parameters - second.parameters)[:10]  # type: ignore[operator]
    return tiles, -(tiles.jacobian[:, OF_WALL] @ both)


def _squares(off: Vector, covariance: Vector) -> tuple[float, int]:
    """Squared distance in the directions that both leave open."""
    if not len(off):
        return 0.0, 0
    scale = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / scale / scale[:, None])
    known = values > 1e-9
    along = vectors[:, known].T @ (off / scale)
    return float((along**2 / values[known]).sum()), int(known.sum())


def _rms(values: Vector) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0
