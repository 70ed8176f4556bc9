"""Wall tiles of many frames against one wall."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.types.wall import Wall
from siloscope.validation.frames import SeenFrame

Vector = NDArray[np.float64]

FAR = 6.0
"""Residuals beyond so many deviations, their own scatter included, are no wall."""

APART = 4.5
"""A tile that is so many deviations off the same tile of the other frames does not show the same wall."""

NEIGHBOURS = 7
"""Of the eight tiles around one, so many have to be wall: feed and edges reach no further."""

MOST_COLUMNS = 1 << 12
"""More columns of tiles than any image has."""


@dataclass(frozen=True, eq=False)
class Tiles:
    """Wall tiles of all frames against one wall; N of them. Lengths in metres."""

    frame: NDArray[np.int64]
    """Number of the frame."""
    place: NDArray[np.int64]
    """Number of the place in the image."""
    spot: Vector
    """(N, 2) column and row of that place."""
    ray: Vector
    """(N, 2) rays (x/z, y/z)."""
    residual: Vector
    """Reading less prediction, along the ray."""
    variance: Vector
    """Of the tile's mean by the sensor's noise, m²."""
    depth: Vector
    height: Vector
    """z in the silo frame."""
    azimuth: Vector
    across: Vector
    """Distance from the wall across it per metre of residual."""
    on_cone: NDArray[np.bool_]
    jacobian: Vector
    """(N, 71) derivative of the residual by all parameters."""

    def __len__(self) -> int:
        return len(self.residual)

    def kept(self, which: NDArray[np.bool_]) -> Tiles:
        """Some of them."""
        return Tiles(*(getattr(self, field.name)[which] for field in fields(self)))

    def numbered(self) -> Tiles:
        """With the places numbered from 0 on, without gaps."""
        return replace(self, place=np.unique(self.place, return_inverse=True)[1].reshape(-1))


def against(frames: Sequence[SeenFrame], wall: Wall) -> Tiles:
    """The wall tiles of frames against a wall, without those that show something else."""
    parts = [_of_frame(number, one, wall) for number, one in enumerate(frames)]
    tiles = Tiles(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Tiles)))
    off = np.abs(tiles.residual)
    within = off < FAR * np.sqrt(tiles.variance) + FAR * (np.median(off) if len(off) else 0.0)
    return _agreeing(tiles.kept(within).numbered()).numbered()


def _of_frame(number: int, one: SeenFrame, wall: Wall) -> Tiles:
    found = _core.wall_tiles(one.frame, one.priors, wall)
    spot = found.place.astype(np.int64)
    shown = _inside(one.shown[found.number.astype(np.int64)], spot)
    shown &= np.where(found.on_cone, wall.has_cone and one.shows_vessels_cone, wall.has_cylinder)
    return Tiles(
        np.full(len(spot), number),
        spot[:, 1] * MOST_COLUMNS + spot[:, 0],
        found.place,
        found.ray,
        found.residual,
        found.variance,
        found.depth,
        found.height,
        found.azimuth,
        found.across,
        found.on_cone,
        found.jacobian,
    ).kept(shown)


def _inside(wall: NDArray[np.bool_], spot: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Tiles that are wall by the frame's own answer, and whose neighbours are."""
    if not len(spot):
        return wall
    grid = np.zeros(spot.max(axis=0) + 1, bool)
    grid[spot[wall, 0], spot[wall, 1]] = True
    padded = np.pad(grid, 1, constant_values=True).astype(int)
    columns, rows = grid.shape
    around = sum(padded[du : du + columns, dv : dv + rows] for du in range(3) for dv in range(3)) - grid
    inside: NDArray[np.bool_] = wall & (around[spot[:, 0], spot[:, 1]] >= NEIGHBOURS)
    return inside


def _agreeing(tiles: Tiles) -> Tiles:
    """Without tiles that are far off the median of their place over the frames."""
    if not len(tiles):
        return tiles
    place = tiles.place
    order = np.lexsort((tiles.residual, place))
    counts = np.bincount(place)
    starts = np.cumsum(counts) - counts
    ordered = tiles.residual[order]
    median = 0.5 * (ordered[starts + (counts - 1) // 2] + ordered[starts + counts // 2])
    near = np.abs(tiles.residual - median[place]) < APART * np.sqrt(tiles.variance)
    return tiles.kept(near | (counts[place] < 3))
