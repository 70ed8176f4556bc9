"""The content of a silo: height map and profiles through the axis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.patheffects import AbstractPathEffect, withStroke

from siloscope.reporting.plots.outline import GRAIN, Numbers, Outline, datum, headline, outline_of
from siloscope.reporting.plots.solid import surface_3d
from siloscope.reporting.plots.style import BLUE, INK, MUTED, RULE, figure, heading, legend, tidy
from siloscope.types.content import Content
from siloscope.types.surface_map import SurfaceMap

RASTER = 301
"""Places along a side at which a map is drawn."""


def height_map(content: Content) -> Figure:
    """The map's heights over the datum, and beside it how sure they are and what was really seen."""
    surface, silo = outline_of(content)
    made = figure(12.4, 5.6)
    left, right = made.subplots(1, 2)
    at = np.linspace(-silo.radius, silo.radius, RASTER)
    places = np.stack(np.meshgrid(at, at), axis=-1)
    across, heights = np.hypot(places[..., 0], places[..., 1]), surface.height(places)
    covered = (across <= silo.radius) & (heights > silo.floor(across))
    shown = np.where(covered, heights, np.nan)
    _map(left, at, shown, GRAIN, "height (m)", made)
    steps = _levels(shown)
    if len(steps) > 1:
        _contours(left, at, shown, steps)
    tidy(left, f"height over the {datum(content)} (m)", "x (m)", "y (m)")
    cells = surface.cells(places)
    std = np.where(covered, 1e3 * surface.core.std()[cells], np.nan)
    _map(right, at, std, "cividis_r", "standard deviation (mm)", made)
    unseen = np.where(covered & ~surface.seen[cells], 1.0, 0.0)
    if unseen.any():
        right.contourf(at, at, unseen, levels=[0.5, 1.5], colors="none", hatches=["////"])
    tidy(right, "standard deviation (mm); hatched where not seen", "x (m)", "y (m)")
    for axes in (left, right):
        axes.grid(visible=False)
        _outline(axes, silo.radius)
    heading(made, headline(content))
    return made


def section(content: Content, azimuths: Sequence[float] = (0.0, 90.0)) -> Figure:
    """Profiles through the axis: the surface with its 95 % band, dashed where not seen, in the silo's outline."""
    surface, silo = outline_of(content)
    slender = 2.0 * silo.radius / (silo.top - silo.vertex)
    made = figure(len(azimuths) * float(np.clip(5.2 * slender + 1.4, 2.8, 7.0)), 6.6)
    for axes, azimuth in zip(np.atleast_1d(made.subplots(1, len(azimuths), sharey=True)), azimuths, strict=True):
        _profile(axes, surface, silo, np.radians(azimuth))
        tidy(axes, f"at {azimuth:.0f}° from x towards y", "distance from the axis (m)")
        axes.set_aspect("equal")
    made.axes[0].set_ylabel(f"height over the {datum(content)} (m)", fontsize=10, color=MUTED)
    legend(made.axes[0], columns=3)
    heading(made, headline(content))
    return made


def pictures(content: Content) -> dict[str, Figure]:
    """All pictures that a reading allows, by file name; none for one without a surface."""
    if content.surface is None:
        return {}
    return {"height-map": height_map(content), "surface": surface_3d(content), "section": section(content)}


def _map(axes: Axes, at: Numbers, values: Numbers, colours: Any, label: str, made: Figure) -> None:
    half = 0.5 * (at[1] - at[0])
    extent = (at[0] - half, at[-1] + half, at[0] - half, at[-1] + half)
    image = axes.imshow(values, origin="lower", extent=extent, cmap=colours, interpolation="nearest")
    bar = made.colorbar(image, ax=axes, shrink=0.8, label=label)
    bar.outline.set_visible(False)


def _levels(heights: Numbers) -> Numbers:
    """Round heights for some eight contour lines."""
    known = heights[np.isfinite(heights)]
    span = float(np.ptp(known)) if len(known) else 0.0
    if span < 1e-3:
        return np.zeros(0)
    step = next((s for s in (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0) if span / s <= 10.0), 5.0)
    return np.arange(np.ceil(known.min() / step) * step, known.max(), step)


def _contours(axes: Axes, at: Numbers, heights: Numbers, steps: Numbers) -> None:
    """Lines of equal height with a light seam, so that they show on dark and on light."""
    lines = axes.contour(at, at, heights, levels=steps, colors=INK, linewidths=0.7)
    seam: list[AbstractPathEffect] = [withStroke(linewidth=2.0, foreground="white", alpha=0.55)]
    lines.set(path_effects=seam)
    for label in axes.clabel(lines, fmt="%.2f", fontsize=8):
        label.set_path_effects(seam)


def _outline(axes: Axes, radius: float) -> None:
    """The wall, with what the cells show beyond it cut off."""
    inside = Circle((0.0, 0.0), radius, transform=axes.transData)
    for shown in (*axes.images, *axes.collections):
        shown.set_clip_path(inside)
    turn = np.linspace(0.0, 2.0 * np.pi, 241)
    axes.plot(radius * np.cos(turn), radius * np.sin(turn), color=INK, linewidth=1.2)
    axes.plot(0.0, 0.0, "+", color=INK, markersize=8)
    axes.set_aspect("equal")
    axes.set_xlim(-1.05 * radius, 1.05 * radius)
    axes.set_ylim(-1.05 * radius, 1.05 * radius)


def _profile(axes: Axes, surface: SurfaceMap, silo: Outline, azimuth: float) -> None:
    s = np.linspace(-silo.radius, silo.radius, 241)
    places = np.stack([s * np.cos(azimuth), s * np.sin(azimuth)], axis=-1)
    cells = surface.cells(places)
    heights, floor = surface.height(places), silo.floor(np.abs(s))
    std = surface.core.std()[cells]
    covered = heights > floor
    seen = surface.seen[cells] & covered
    axes.fill_between(s, floor, np.where(covered, heights, floor), color="#f6d88b", linewidth=0, label="content")
    low, high = heights - 2 * std, heights + 2 * std
    band = {"color": BLUE, "alpha": 0.3, "linewidth": 0, "label": "95 % band"}
    axes.fill_between(s, low, high, where=list(covered), **band)  # type: ignore[arg-type]
    axes.plot(s, np.where(seen, heights, np.nan), color=INK, linewidth=2.0, label="surface, seen")
    axes.plot(s, np.where(covered & ~seen, heights, np.nan), color=INK, linewidth=1.4, linestyle="--",
              label="surface, continued")  # fmt: skip
    joint = silo.vertex if silo.joint is None else silo.joint
    edge = [(-silo.radius, silo.top), (-silo.radius, joint), (0.0, silo.vertex), (silo.radius, joint),
            (silo.radius, silo.top)]  # fmt: skip
    axes.plot(*zip(*edge, strict=True), color=MUTED, linewidth=1.6, label="silo")
    axes.axvline(0.0, color=RULE, linewidth=1.0)
