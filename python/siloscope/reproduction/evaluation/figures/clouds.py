"""Clouds: Figs. 10, 12, 14, 15 and 16."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from siloscope.reporting.plots.style import AMBER, BLUE, GREEN, INK, PURPLE, RED, figure, heading, legend, tidy
from siloscope.reporting.plots.view import subsample
from siloscope.reproduction.evaluation.series import Numbers
from siloscope.simulation import Scene, metrics
from siloscope.types.pose import SiloPose

COLUMNS = 3
REACH = 30.0
"""Degrees shown around the axis in Fig. 14."""


def adjusted(scenes: Mapping[str, Scene], poses: Mapping[str, SiloPose | None], title: str) -> Figure:
    """Each scene's cloud adjusted with the true pose (blue) and with the estimated one (red)."""
    made = figure(3.9 * len(scenes), 4.8)
    panels = made.subplots(1, len(scenes), squeeze=False)[0]
    for axes, (name, scene) in zip(panels, scenes.items(), strict=True):
        frame = scene.render()
        points = subsample(metrics.camera_points(frame.measured, frame.camera)[frame.measured > 0], 5000)
        _side(axes, frame.pose.to_silo(points), BLUE, "true pose")
        pose = poses[name]
        if pose is not None:
            _side(axes, pose.to_silo(points), RED, "estimated")
        axes.axvline(0.0, color=INK, linewidth=0.9)
        _upright(axes, name)
    legend(panels[0])
    heading(made, title)
    return made


def sensors(clouds: Mapping[str, tuple[Numbers, Numbers]]) -> Figure:
    """Clouds of several sensors in the camera's and in the silo's frame; `clouds` has both (N, 3) of each."""
    made = figure(9.0, 5.2)
    panels = made.subplots(1, 2)
    for (name, parts), colour in zip(clouds.items(), cycle((BLUE, PURPLE, GREEN, AMBER)), strict=False):
        for axes, points in zip(panels, parts, strict=True):
            _side(axes, subsample(points, 2500), colour, name)
    for axes, title in zip(panels, ("camera frame", "adjusted by shape-tensor"), strict=True):
        _upright(axes, title)
    legend(panels[0])
    heading(made, "The four sensors in the empty silo")
    return made


def _side(axes: Axes, points: Numbers, colour: str, label: str) -> None:
    x, z = points[:, 0], points[:, 2]
    axes.scatter(x, z, s=1.2, c=colour, alpha=0.5, linewidths=0, label=label, rasterized=True)


def _upright(axes: Axes, title: str) -> None:
    tidy(axes, title, "x (m)", "z, down (m)")
    axes.set_aspect("equal")
    axes.invert_yaxis()


def spread(clouds: Mapping[str, tuple[Numbers, Numbers]], title: str) -> Figure:
    """Vectors (M, 3) of each cloud, seen along its axis (3,), in degrees."""
    rows = int(np.ceil(len(clouds) / COLUMNS))
    made = figure(4.0 * COLUMNS, 4.3 * rows)
    panels = made.subplots(rows, COLUMNS, squeeze=False).ravel()
    for axes, (name, (vectors, axis)) in zip(panels, clouds.items(), strict=False):
        _seen_along(axes, vectors, axis)
        tidy(axes, name, "degrees from the axis", "degrees from the axis")
    for axes in panels[len(clouds) :]:
        axes.axis("off")
    heading(made, title)
    return made


def _seen_along(axes: Axes, vectors: Numbers, axis: Numbers) -> None:
    across = np.degrees(_across(vectors, axis))
    box = (-REACH, REACH, -REACH, REACH)
    axes.hexbin(across[:, 0], across[:, 1], gridsize=40, extent=box, bins="log", mincnt=1, cmap="Blues")
    axes.plot([0.0], [0.0], "+", color=RED, markersize=14, markeredgewidth=2.0)
    axes.set_xlim(-REACH, REACH)
    axes.set_ylim(-REACH, REACH)
    axes.set_box_aspect(1.0)


def _across(vectors: Numbers, axis: Numbers) -> Numbers:
    """Components of unit vectors across the axis; their sign is free."""
    upright = vectors * np.where(vectors @ axis < 0.0, -1.0, 1.0)[:, None]
    first = np.cross(axis, [0.0, 1.0, 0.0])
    first /= np.linalg.norm(first)
    return np.column_stack([upright @ first, upright @ np.cross(axis, first)])
