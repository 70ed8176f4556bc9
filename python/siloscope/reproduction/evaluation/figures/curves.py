"""Curves over a discharge: Figs. 9, 11, 13 and 17."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from siloscope.reporting.plots.style import (
    AMBER,
    BLUE,
    CLASS_COLOURS,
    GREEN,
    GREY,
    INK,
    MUTED,
    PURPLE,
    RED,
    figure,
    heading,
    legend,
    tidy,
)
from siloscope.reproduction.evaluation.figures.look import COLOURS, decades, millimetres, small_legend
from siloscope.reproduction.evaluation.series import Numbers, Series
from siloscope.reproduction.solvers import SOLVERS

NAMES = ("r_x", "r_y", "t_x", "t_y")
COMPARED = (("shape-tensor", "-"), ("surface", "--"))
"""Methods whose errors are drawn, and with which line."""


def discharges(series: Sequence[Series], title: str) -> Figure:
    """Errors of the pose, shares seen, and PC average distance; a column a silo."""
    made = figure(3.9 * len(series), 13.0)
    rows = made.subplots(4, len(series), sharex="col", squeeze=False)
    for column, one in enumerate(series):
        _errors(rows[0, column], one, (0, 1), "rotation error (mrad)")
        _errors(rows[1, column], one, (2, 3), "translation error (mm)")
        _shares(rows[2, column], one)
        _distances(rows[3, column], one)
        rows[0, column].set_title(one.name, loc="left", fontsize=12, color=INK, fontweight="bold")
    for row, below in zip(rows, (-0.03, -0.03, -0.03, -0.2), strict=True):
        small_legend(row[0], 4, below)
    made.get_layout_engine().set(h_pad=0.2, rect=(0.0, 0.03, 1.0, 0.97))  # type: ignore[union-attr,call-arg]
    heading(made, title)
    return made


def _errors(axes: Axes, series: Series, columns: tuple[int, int], label: str) -> None:
    for solver, line in COMPARED:
        error = 1e3 * series.error(solver)
        for column, colour in zip(columns, (BLUE, AMBER), strict=True):
            letter, index = NAMES[column].split("_")
            name = f"${letter}_{index}$, {SOLVERS[solver].heading}"
            axes.plot(100.0 * series.level, error[:, column], line, color=colour, linewidth=1.3, label=name)
    axes.axhline(0.0, color=INK, linewidth=0.7)
    shown = 1e3 * series.error("shape-tensor")[:, list(columns)]
    _limit(axes, shown[np.isfinite(shown)])
    _refused(axes, series, [solver for solver, _ in COMPARED])
    _run_down(axes, series, label)


def _limit(axes: Axes, values: Numbers) -> None:
    """Nine tenths of the curve fill the axes; a few wild steps of a full silo would flatten the rest."""
    if len(values):
        reach = 1.6 * float(np.percentile(np.abs(values), 90.0)) + 1e-6
        axes.set_ylim(-reach, reach)


def _shares(axes: Axes, series: Series) -> None:
    names = ("cylinder", "cone", "feed")
    order = np.argsort(series.level)
    level, colours = 100.0 * series.level[order], [CLASS_COLOURS[name] for name in names]
    axes.stackplot(level, *(100.0 * series.pixels[order].T), labels=names, colors=colours, alpha=0.75)
    edges = 100.0 * np.cumsum(series.area[order], axis=1)
    axes.plot(level, edges[:, 0], ":", color=INK, linewidth=1.3, label="the same by area")
    axes.plot(level, edges[:, 1], ":", color=INK, linewidth=1.3)
    axes.set_ylim(0.0, 100.0)
    _run_down(axes, series, "share of the pixels (%)")


def _distances(axes: Axes, series: Series) -> None:
    for name, solver in SOLVERS.items():
        distance = millimetres(series.distance(name))
        axes.semilogy(100.0 * series.level, distance, color=COLOURS[name], linewidth=1.3, label=solver.heading)
    _refused(axes, series, list(SOLVERS))
    _run_down(axes, series, "PC average distance (mm)")
    axes.set_xlabel("feed level (% of the height)", fontsize=9, color=MUTED)
    decades(axes)


def _refused(axes: Axes, series: Series, drawn: Sequence[str]) -> None:
    """Grey where every drawn method refused."""
    silent = np.all([np.isnan(series.distance(solver)) for solver in drawn], axis=0)
    level = 100.0 * series.level
    half = 0.5 * float(np.median(np.abs(np.diff(level)))) if len(level) > 1 else 1.0
    for place in level[silent]:
        axes.axvspan(place - half, place + half, color=MUTED, alpha=0.12, linewidth=0)


def _run_down(axes: Axes, series: Series, label: str) -> None:
    """A discharge runs from full to empty: the level falls to the right."""
    tidy(axes, axes.get_title(loc="left"), "", label)
    axes.set_xlim(100.0 * float(series.level.max()) + 1.0, 100.0 * float(series.level.min()) - 1.0)


def together(series: Sequence[Series], solvers: Sequence[str], limits: Mapping[str, float]) -> Figure:
    """PC average distance of several silos over the normalised step, a panel a method; dashed lines are limits."""
    made = figure(4.6 * len(solvers), 4.6)
    panels = made.subplots(1, len(solvers), sharey=True, squeeze=False)[0]
    for axes, solver in zip(panels, solvers, strict=True):
        for one, colour in zip(series, cycle((BLUE, RED, GREEN, AMBER, PURPLE)), strict=False):
            step = np.linspace(0.0, 1.0, len(one.level))
            axes.semilogy(step, millimetres(one.distance(solver)), color=colour, linewidth=1.3, label=one.name)
        for name, limit in limits.items():
            axes.axhline(limit, color=GREY, linestyle="--", linewidth=1.0)
            axes.annotate(name, (0.01, limit), fontsize=8, color=MUTED, va="bottom")
        tidy(axes, SOLVERS[solver].heading, "step of the discharge, normalised", "PC average distance (mm)")
        axes.label_outer()
    decades(panels[0])
    legend(panels[len(panels) // 2], columns=5)
    heading(made, "PC average distance over the discharge; a gap is a refused frame")
    return made
