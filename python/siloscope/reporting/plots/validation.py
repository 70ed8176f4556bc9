"""Pictures of a validation: what is left on the wall, over the image and over the vessel; held-out frames; halves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from siloscope.reporting.plots.style import INK, figure, heading, tidy
from siloscope.validation.holdout import HeldOut
from siloscope.validation.splits import Split
from siloscope.validation.tiles import Tiles

Vector = NDArray[np.float64]

SHOWN = 6
"""Held-out frames in a picture."""

COLOURS = "RdBu_r"


def left_on_the_wall(tiles: Tiles) -> Figure:
    """Mean residual of every place over the frames, over the image and over the unrolled vessel."""
    made = figure(11.0, 4.6)
    heading(made, "What all frames together read too far (red) or too near (blue), against an ideal vessel")
    one, mean, _ = averaged(tiles)
    _both(made, one, 1e3 * mean, "mm")
    return made


def halves_apart(split: Split) -> Figure:
    """By how much the walls of two halves differ, over the image and over the vessel."""
    made = figure(11.0, 4.6)
    heading(made, f"The walls of the {split.name}: difference along the rays")
    _both(made, split.places, 1e3 * split.apart, "mm")
    return made


def held_out_frames(held: Sequence[HeldOut]) -> Figure:
    """Residuals of frames against the vessel of other levels' frames, the rarest patterns first."""
    chosen = sorted(held, key=lambda one: -one.deviation)[:SHOWN]
    columns = min(3, len(chosen))
    rows = -(-len(chosen) // columns)
    made = figure(3.7 * columns, 3.1 * rows + 0.5)
    heading(made, "Frames against the vessel of other levels' frames (mm)")
    largest = 1e3 * max(_limit(one.tiles.residual) for one in chosen)
    drawn: Any = None
    for place, one in enumerate(chosen):
        axes = made.add_subplot(rows, columns, place + 1)
        drawn = _image(axes, one.tiles, 1e3 * one.tiles.residual, largest, f"{one.name[-32:]}: {one.deviation:.1f}")
    made.colorbar(drawn, ax=made.axes, shrink=0.8, label="mm along the ray")
    return made


def averaged(tiles: Tiles) -> tuple[Tiles, Vector, Vector]:
    """One tile of every place, the weighed mean of its residuals, and that mean's deviation."""
    weight = 1.0 / tiles.variance
    total = np.bincount(tiles.place, weight)
    mean: Vector = np.bincount(tiles.place, weight * tiles.residual) / total
    _, first = np.unique(tiles.place, return_index=True)
    kept = np.zeros(len(tiles), bool)
    kept[first] = True
    order = tiles.place[kept]
    return tiles.kept(kept), mean[order], 1.0 / np.sqrt(total[order])


def _both(made: Figure, tiles: Tiles, values: Vector, unit: str) -> None:
    image, vessel = made.subplots(1, 2, width_ratios=(1.0, 1.1))
    largest = _limit(values)
    drawn = _image(image, tiles, values, largest, "over the image")
    tidy(vessel, "over the vessel", "azimuth (degrees)", "metres below the camera")
    turn = np.degrees(tiles.azimuth) % 360.0
    vessel.scatter(turn, tiles.height, s=9, c=values, cmap=COLOURS, vmin=-largest, vmax=largest, linewidths=0)
    vessel.set_xlim(0.0, 360.0)
    vessel.invert_yaxis()
    made.colorbar(drawn, ax=[image, vessel], shrink=0.8, label=f"{unit} along the ray")


def _image(axes: Axes, tiles: Tiles, values: Vector, largest: float, title: str) -> Any:
    tidy(axes, title, "column of tiles", "row of tiles")
    axes.title.set_fontsize(9.5)
    axes.title.set_color(INK)
    column, row = tiles.spot.astype(int).T
    grid = np.full((row.max() + 1, column.max() + 1), np.nan)
    grid[row, column] = values
    return axes.imshow(grid, cmap=COLOURS, vmin=-largest, vmax=largest, interpolation="nearest", aspect="equal")


def _limit(values: Vector) -> float:
    return float(max(np.quantile(np.abs(values), 0.98), 1e-9)) if len(values) else 1e-9
