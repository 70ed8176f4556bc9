"""Points and silo outlines drawn in parallel projection from the side and above."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from siloscope.reporting.plots.style import INK, MUTED
from siloscope.types.vessel import SiloGeometry

Points = NDArray[np.float64]
MOST_POINTS = 12_000
"""More points than this only hide each other."""


@dataclass(frozen=True)
class View:
    """A parallel projection of the silo frame (z down): turned about the axis, then tilted; degrees."""

    azimuth: float = -58.0
    elevation: float = 22.0

    def project(self, points: Points) -> Points:
        """(N, 3) points to (N, 3): right, up, and towards the viewer."""
        a, e = np.radians(self.azimuth), np.radians(self.elevation)
        right = np.array([np.cos(a), np.sin(a), 0.0])
        viewer = np.array([-np.sin(a) * np.cos(e), np.cos(a) * np.cos(e), -np.sin(e)])
        up = np.cross(viewer, right)
        projected: Points = points @ np.column_stack([right, up, viewer])
        return projected

    def scatter(self, axes: Axes, points: Points, colour: object, label: str = "", size: float = 1.2) -> None:
        """Points, the farthest drawn first."""
        flat = self.project(points)
        order = np.argsort(flat[:, 2])
        shade = colour if isinstance(colour, str) else np.asarray(colour)[order]
        axes.scatter(
            flat[order, 0], flat[order, 1], s=size, c=shade, label=label, linewidths=0, alpha=0.75, rasterized=True
        )  # fmt: skip

    def line(self, axes: Axes, points: Points, **style: object) -> None:
        """A line through points."""
        flat = self.project(points)
        axes.plot(flat[:, 0], flat[:, 1], **style)  # type: ignore[arg-type]


def subsample(points: Points, most: int = MOST_POINTS, seed: int = 0) -> Points:
    """At most `most` of the finite points, drawn at random with a fixed seed."""
    kept: Points = points[np.isfinite(points).all(axis=1)]
    if len(kept) > most:
        kept = kept[np.random.default_rng(seed).choice(len(kept), most, replace=False)]
    return kept


def circle(radius: float, z: float) -> Points:
    """A horizontal circle about the axis."""
    turn = np.linspace(0.0, 2.0 * np.pi, 97)
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.full_like(turn, z)])


def outline(axes: Axes, view: View, silo: SiloGeometry, top: float) -> None:
    """The silo's edges, as far as they are known."""
    if silo.radius is None:
        return
    style = {"color": INK, "linewidth": 0.9, "alpha": 0.55, "zorder": 3}
    bottom = silo.cylinder_bottom
    for z in {top, bottom if bottom is not None else top}:
        view.line(axes, circle(silo.radius, z), **style)
    a = np.radians(view.azimuth)
    for side in (-1.0, 1.0):
        edge = side * silo.radius * np.array([np.cos(a), np.sin(a)])
        if bottom is not None:
            view.line(axes, np.array([[*edge, top], [*edge, bottom]]), **style)
            if silo.apex is not None:
                view.line(axes, np.array([[*edge, bottom], [0.0, 0.0, silo.apex]]), **style)


def bare(axes: Axes) -> None:
    """Equal scales, no ticks, and a bar of one metre (or a fitting part of one) instead."""
    axes.set_aspect("equal")
    axes.axis("off")
    low, high = axes.get_xlim()
    length = 10.0 ** np.floor(np.log10(max(high - low, 1e-9)))
    length = length if (high - low) / length < 5.0 else 2.0 * length
    bottom, top = axes.get_ylim()
    y = bottom - 0.02 * (top - bottom)
    axes.plot([low, low + length], [y, y], color=MUTED, linewidth=2.0, solid_capstyle="butt")
    text = f"{length:g} m" if length >= 1.0 else f"{length * 1000:g} mm"
    axes.annotate(text, (low, y), xytext=(0, -3), textcoords="offset points", va="top", fontsize=9, color=MUTED)
