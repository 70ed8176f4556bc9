"""Errors and ratios over a discharge, like the paper's Fig. 9."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter
from numpy.typing import NDArray

from siloscope.reporting.plots.style import (
    AMBER,
    BLUE,
    CLASS_COLOURS,
    INK,
    MUTED,
    PURPLE,
    RED,
    figure,
    heading,
    legend,
    tidy,
)

Numbers = NDArray[np.float64]


def errors(level: Numbers, error: Numbers, std: Numbers | None = None, title: str = "Errors of the pose") -> Figure:
    """Errors of ``r_x, r_y, t_x, t_y`` over the feed level.

    `level` (N,) is the highest feed point as a share of the silo's height; `error` (N, 4) is estimate minus truth in
    radians and metres, NaN where the frame was refused; `std` (N, 4) the stated standard deviations, drawn twice.
    """
    made = figure(12.0, 4.8)
    turns, shifts = made.subplots(1, 2)
    for axes, columns, names, unit in ((turns, (0, 1), ("r_x", "r_y"), "mrad"), (shifts, (2, 3), ("t_x", "t_y"), "mm")):
        for column, name, colour in zip(columns, names, (BLUE, AMBER), strict=True):
            spread = None if std is None else 2e3 * std[:, column]
            shown = f"{name[0]}$_{name[2]}$"
            _curve(axes, 100.0 * level, 1e3 * error[:, column], spread, shown, colour, name[2] == "y")
        axes.axhline(0.0, color=INK, linewidth=0.9)
        _refused(axes, 100.0 * level, np.isnan(error[:, columns[0]]))
        tidy(axes, f"{'rotation' if unit == 'mrad' else 'translation'} error ({unit})", "feed level (% of the height)")
        _runs_down(axes, level)
        legend(axes)
    heading(made, title)
    return made


def ratios(
    level: Numbers, share: Numbers, distances: Mapping[str, Numbers], title: str = "What the camera sees"
) -> Figure:
    """Shares (N, 3) of cylinder, cone and feed among the pixels, and PC average distances (N,) in metres by method."""
    made = figure(12.0, 4.8)
    parts, off = made.subplots(1, 2)
    names = ("cylinder", "cone", "feed")
    colours = [CLASS_COLOURS[name] for name in names]
    order = np.argsort(level)
    parts.stackplot(100.0 * level[order], *(100.0 * share[order].T), labels=names, colors=colours, alpha=0.85)
    parts.set_ylim(0.0, 100.0)
    tidy(parts, "share of the pixels (%)", "feed level (% of the height)")
    for (name, distance), colour in zip(distances.items(), (BLUE, RED, PURPLE, AMBER), strict=False):
        off.semilogy(100.0 * level, 1e3 * distance, color=colour, marker="o", markersize=3.5, linewidth=1.6, label=name)
    _refused(off, 100.0 * level, np.all([np.isnan(distance) for distance in distances.values()], axis=0))
    tidy(off, "PC average distance (mm), Eq. 11", "feed level (% of the height)")
    _plain_decades(off)
    for axes in (parts, off):
        _runs_down(axes, level)
    legend(parts)
    legend(off)
    heading(made, title)
    return made


def _plain_decades(axes: Axes) -> None:
    """0.1, 0.2, 0.5, 1 … on a logarithmic axis, instead of powers of ten."""
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _curve(axes: Axes, x: Numbers, y: Numbers, spread: Numbers | None, label: str, colour: str, named: bool) -> None:
    axes.plot(x, y, color=colour, marker="o", markersize=3.5, linewidth=1.5, label=label)
    if spread is not None:
        axes.fill_between(
            x, y - spread, y + spread, color=colour, alpha=0.18, linewidth=0, label="± 2 std" if named else ""
        )


def _refused(axes: Axes, x: Numbers, refused: NDArray[np.bool_]) -> None:
    """Grey where the program gave no answer."""
    half = 0.5 * float(np.median(np.abs(np.diff(x)))) if len(x) > 1 else 1.0
    for i, place in enumerate(x[refused]):
        axes.axvspan(place - half, place + half, color=MUTED, alpha=0.15, linewidth=0, label="" if i else "refused")


def _runs_down(axes: Axes, level: Numbers) -> None:
    """A discharge runs from full to empty: the level falls to the right."""
    axes.set_xlim(100.0 * float(level.max()) + 1.0, 100.0 * float(level.min()) - 1.0)
