"""The estimated vectors X̃ of step 4, like the paper's Fig. 14."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from siloscope.reporting.plots.style import BLUE, INK, MUTED, RED, figure, heading, tidy
from siloscope.reporting.plots.view import Points, View, subsample


def directions(vectors: Points, direction: Points) -> Figure:
    """Estimated vectors X̃ (M, 3) on the unit sphere, and how far they lie from the axis direction X (3,).

    The vectors are unit cross products of pairs of candidates' E1 (Eq. 3), in the camera frame; their sign is free.
    """
    vectors = vectors[np.isfinite(vectors).all(axis=1)]
    vectors = vectors * np.where(vectors @ direction < 0.0, -1.0, 1.0)[:, None]
    made = figure(12.0, 4.9)
    ball, spread, curve = made.subplots(1, 3)
    _ball(ball, vectors, direction)
    _spread(spread, vectors, direction)
    _curve(curve, vectors, direction)
    heading(made, f"Estimated vectors X̃ of {len(vectors):,} pairs of candidates")
    return made


def angles(vectors: Points, direction: Points) -> Points:
    """Angle of each vector from the direction, in degrees, (M,)."""
    aside = np.linalg.norm(np.cross(vectors, direction), axis=1)
    turned: Points = np.degrees(np.arctan2(aside, np.abs(vectors @ direction)))
    return turned


def _ball(axes: Axes, vectors: Points, direction: Points) -> None:
    view = View(azimuth=-58.0, elevation=-28.0)
    for edge in (0.0, 30.0, 60.0):
        z, r = np.sin(np.radians(edge)), np.cos(np.radians(edge))
        turn = np.linspace(0, 2 * np.pi, 97)
        view.line(axes, np.column_stack([r * np.cos(turn), r * np.sin(turn), z + 0 * turn]), color=MUTED, lw=0.5)
    axes.add_patch(Circle((0.0, 0.0), 1.0, fill=False, color=MUTED, linewidth=0.8))
    view.scatter(axes, subsample(vectors, 6000), BLUE, size=2.5)
    view.line(axes, np.vstack([-0.0 * direction, 1.25 * direction]), color=RED, linewidth=2.2)
    axes.set_xlim(-1.3, 1.3)
    axes.set_ylim(-1.3, 1.3)
    axes.set_box_aspect(1.0)
    axes.axis("off")
    axes.set_title("on the unit sphere, X in red", loc="left", fontsize=11, color=INK, fontweight="bold")


def _spread(axes: Axes, vectors: Points, direction: Points) -> None:
    first = np.cross(direction, [0.0, 1.0, 0.0])
    first /= np.linalg.norm(first)
    second = np.cross(direction, first)
    across = np.degrees(np.column_stack([vectors @ first, vectors @ second]))
    most = np.percentile(angles(vectors, direction), 90.0) if len(vectors) else 0.0
    reach = float(np.clip(1.2 * most, 0.05, 60.0))
    box = (-reach, reach, -reach, reach)
    axes.hexbin(across[:, 0], across[:, 1], gridsize=44, extent=box, bins="log", mincnt=1, cmap="Blues")
    axes.plot([0.0], [0.0], marker="+", color=RED, markersize=16, markeredgewidth=2.2)
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-reach, reach)
    axes.set_box_aspect(1.0)
    tidy(axes, "seen along X", "degrees from X", "degrees from X")


def _curve(axes: Axes, vectors: Points, direction: Points) -> None:
    turned = np.sort(angles(vectors, direction))
    share = np.arange(1, len(turned) + 1) / max(len(turned), 1)
    axes.plot(turned, 100.0 * share, color=BLUE, linewidth=2.0)
    if len(turned):
        middle = float(np.median(turned))
        axes.axvline(middle, color=RED, linewidth=1.4, linestyle="--")
        note = f"half lie within {middle:.2g}°"
        axes.annotate(note, (middle, 30.0), xytext=(8, 0), textcoords="offset points", fontsize=10, color=INK)
        axes.set_xlim(0.0, max(float(np.percentile(turned, 97.0)), 1e-3))
    axes.set_ylim(0.0, 100.0)
    axes.set_box_aspect(1.0)
    tidy(axes, "how many are how near", "angle from X (degrees)", "share of pairs (%)")
