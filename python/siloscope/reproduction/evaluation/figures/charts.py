"""Charts of the experiments on the limitations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle

import numpy as np
from matplotlib.figure import Figure

from siloscope.reporting.plots.style import AMBER, BLUE, GREEN, GREY, MUTED, figure, heading, legend, tidy
from siloscope.reproduction.evaluation.figures.look import COLOURS, decades
from siloscope.reproduction.evaluation.series import Numbers
from siloscope.reproduction.evaluation.tables import LEAST
from siloscope.reproduction.solvers import SOLVERS


def scatter(points: Mapping[str, tuple[Numbers, Numbers]], title: str, x: str, y: str) -> Figure:
    """Points of several groups on two axes of the same quantity, with the line on which both agree."""
    made = figure(6.4, 5.0)
    axes = made.subplots()
    for (name, (across, up)), colour in zip(points.items(), cycle((BLUE, AMBER, GREEN)), strict=False):
        axes.plot(across, up, "o", color=colour, markersize=4, alpha=0.8, label=name)
    low, high = axes.get_xlim()
    axes.plot([low, high], [low, high], color=MUTED, linewidth=0.9)
    tidy(axes, "", x, y)
    if len(points) > 1:
        legend(axes)
    heading(made, title)
    return made


def bars(groups: Sequence[str], values: Mapping[str, Sequence[float]], title: str, y: str) -> Figure:
    """Bars on a logarithmic scale: `values` has a number a group of every method (NaN where there is none)."""
    made = figure(max(7.0, 1.1 * len(groups)), 4.8)
    axes = made.subplots()
    width = 0.8 / len(values)
    for place, (name, heights) in enumerate(values.items()):
        x = np.arange(len(groups)) + width * (place - 0.5 * (len(values) - 1))
        drawn = np.maximum(np.array(heights, float), LEAST)
        axes.bar(x, drawn, width, color=COLOURS.get(name, GREY), label=SOLVERS[name].heading)
    axes.set_yscale("log")
    tidy(axes, "", "", y)
    axes.set_xticks(range(len(groups)), groups, rotation=25, ha="right")
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), fontsize=8, frameon=False, ncols=len(values))
    decades(axes)
    heading(made, title)
    return made
