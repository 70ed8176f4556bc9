"""The content of a silo: height map, surface in the cut-open silo, profile through the axis, trend over time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, Normalize, to_rgb
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.patheffects import AbstractPathEffect, withStroke
from numpy.typing import NDArray

from siloscope.content.result import Content
from siloscope.content.surface_map import SurfaceMap
from siloscope.plots.style import AMBER, BLUE, GREEN, INK, MUTED, RED, RULE, figure, heading, legend, tidy
from siloscope.wording import with_std

Numbers = NDArray[np.float64]

GRAIN = LinearSegmentedColormap.from_list("grain", ["#3b2a14", "#8a5a1c", "#d9962b", "#f6d88b", "#fff6da"])
"""Low to high: dark to light in print too."""

FEED = "#d9a441"
WALL = "#dde2e8"
LIGHT = -0.66
"""Direction from which the light comes, radians."""
SOLID: dict[str, Any] = {"linewidth": 0, "antialiased": False, "shade": False}

RASTER = 301
"""Places along a side at which a map is drawn."""

TURNS = 97
RINGS = 41
"""Angles and radii at which a surface is drawn."""


@dataclass(frozen=True)
class _Silo:
    """Heights of the silo's parts over the datum."""

    radius: float
    joint: float | None
    """Where the cylinder meets the cone; None where the cone is not known."""
    vertex: float
    top: float

    def floor(self, r: Numbers) -> Numbers:
        """Height of the floor at distances from the axis; the datum where nobody knows the cone."""
        if self.joint is None:
            return np.full(r.shape, self.vertex)
        return np.asarray(self.vertex + (self.joint - self.vertex) * np.minimum(r / self.radius, 1.0))


def height_map(content: Content) -> Figure:
    """The map's heights over the datum, and beside it how sure they are and what was really seen."""
    surface, silo = _parts(content)
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
    tidy(left, f"height over the {_datum(content)} (m)", "x (m)", "y (m)")
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


def surface_3d(content: Content, azimuth: float = -60.0) -> Figure:
    """The content in the silo, whose wall is cut open towards the viewer."""
    surface, silo = _parts(content)
    made = figure(float(np.clip(6.0 * 2.0 * silo.radius / (silo.top - silo.vertex) + 3.2, 5.6, 9.0)), 8.2)
    axes: Any = made.add_subplot(projection="3d", computed_zorder=False)
    front = np.radians(azimuth) + np.linspace(-0.5 * np.pi, 0.5 * np.pi, 61)
    bottom = silo.vertex if silo.joint is None else silo.joint
    _skin(axes, front + np.pi, _ring(silo, bottom), _ring(silo, silo.top), WALL, 1)
    _skin(axes, front + np.pi, _ring(silo, silo.vertex), _ring(silo, bottom), WALL, 1)
    r, angle = np.meshgrid(np.linspace(1e-3, 1.0, RINGS) * silo.radius, np.linspace(0.0, 2.0 * np.pi, TURNS))
    x, y = r * np.cos(angle), r * np.sin(angle)
    heights = surface.height(np.stack([x, y], axis=-1))
    heights = np.where(heights > silo.floor(r), heights, np.nan)
    if np.isfinite(heights).any():
        colours = _shade(heights, x, y)
        axes.plot_surface(x, y, heights, facecolors=colours, rstride=1, cstride=1, zorder=2, **SOLID)
        _body(axes, surface, silo, front)
    for height in (silo.top, silo.joint):
        for half, order in ((front + np.pi, 1), (front, 4)):
            if height is not None:
                edge = silo.radius * np.cos(half), silo.radius * np.sin(half), np.full(half.shape, height)
                axes.plot(*edge, color=MUTED, linewidth=0.8, zorder=order)
    axes.set_box_aspect((2 * silo.radius, 2 * silo.radius, silo.top - silo.vertex), zoom=1.08)
    axes.view_init(elev=24.0, azim=azimuth)
    axes.set_xlabel("x (m)", color=MUTED)
    axes.set_ylabel("y (m)", color=MUTED)
    axes.set_zlabel(f"height over the {_datum(content)} (m)", color=MUTED)
    axes.tick_params(labelsize=8, colors=MUTED)
    heading(made, headline(content))
    return made


def section(content: Content, azimuths: Sequence[float] = (0.0, 90.0)) -> Figure:
    """Profiles through the axis: the surface with its 95 % band, dashed where not seen, in the silo's outline."""
    surface, silo = _parts(content)
    slender = 2.0 * silo.radius / (silo.top - silo.vertex)
    made = figure(len(azimuths) * float(np.clip(5.2 * slender + 1.4, 2.8, 7.0)), 6.6)
    for axes, azimuth in zip(np.atleast_1d(made.subplots(1, len(azimuths), sharey=True)), azimuths, strict=True):
        _profile(axes, surface, silo, np.radians(azimuth))
        tidy(axes, f"at {azimuth:.0f}° from x towards y", "distance from the axis (m)")
        axes.set_aspect("equal")
    made.axes[0].set_ylabel(f"height over the {_datum(content)} (m)", fontsize=10, color=MUTED)
    legend(made.axes[0], columns=3)
    heading(made, headline(content))
    return made


def trend(
    times: Sequence[Any],
    volume: Numbers,
    std: Numbers,
    events: Sequence[tuple[Any, Any, float]] = (),
    forecast: tuple[Sequence[Any], Numbers, Numbers, Numbers] | None = None,
    capacity: float | None = None,
    label: str = "time (h)",
    quantity: str = "volume (m³)",
) -> Figure:
    """Volume over time with its 95 % band, refills and withdrawals, and the forecast.

    `times` are datetimes, or numbers that `label` names; NaN volumes are refused readings. `events` are
    (start, end, m³), `forecast` is (times, middle, low, high).
    """
    made = figure(12.0, 5.2)
    axes = made.subplots()
    known = np.isfinite(volume)
    at = np.asarray(times)
    for start, end, amount in events:
        axes.axvspan(start, end, color=GREEN if amount > 0 else RED, alpha=0.14 if amount > 0 else 0.07, linewidth=0)
    axes.fill_between(at[known], (volume - 2 * std)[known], (volume + 2 * std)[known], color=BLUE, alpha=0.2,
                      linewidth=0, label="95 % band")  # fmt: skip
    axes.plot(at[known], volume[known], color=BLUE, linewidth=1.6, marker="o", markersize=3, label=quantity.split()[0])
    if (~known).any():
        axes.plot(at[~known], np.zeros(int((~known).sum())), "x", color=RED, label="no answer")
    if forecast is not None:
        later, middle, low, high = forecast
        axes.plot(later, middle, color=AMBER, linewidth=1.4, linestyle="--", label="forecast")
        axes.fill_between(later, low, high, color=AMBER, alpha=0.2, linewidth=0)
    if capacity is not None:
        axes.axhline(capacity, color=MUTED, linewidth=0.9, linestyle=":", label="capacity")
    axes.set_ylim(bottom=0.0)
    if len(at) and not isinstance(at[0], int | float | np.number):
        locator = AutoDateLocator()  # type: ignore[no-untyped-call]
        axes.xaxis.set_major_locator(locator)
        axes.xaxis.set_major_formatter(ConciseDateFormatter(locator))  # type: ignore[no-untyped-call]
    tidy(axes, f"{quantity}; green: refill, red: withdrawal", label)
    legend(axes, columns=5)
    heading(made, _trend_headline(volume[known], std[known], quantity.split("(")[1].rstrip(")")))
    return made


def headline(content: Content) -> str:
    """The sentence that a content picture carries."""
    if content.volume is None or content.volume_std is None:
        return f"{content.source}: level without volume; missing {', '.join(content.missing)}"
    fill = "" if content.fill_fraction is None else f", {100 * content.fill_fraction:.1f} % full"
    return with_std(content.volume, content.volume_std, 1.0, f" m³{fill}")


def pictures(content: Content) -> dict[str, Figure]:
    """All pictures that a reading allows, by file name; none for one without a surface."""
    if content.surface is None:
        return {}
    return {"height-map": height_map(content), "surface": surface_3d(content), "section": section(content)}


def _trend_headline(volume: Numbers, std: Numbers, unit: str) -> str:
    if not len(volume):
        return "No reading has an answer"
    first, last = (with_std(float(volume[i]), float(std[i]), 1.0, f" {unit}") for i in (0, -1))
    return f"From {first} to {last} in {len(volume)} readings"


def _parts(content: Content) -> tuple[SurfaceMap, _Silo]:
    surface, lengths = content.surface, content.lengths
    if surface is None or surface.radius is None or lengths is None:
        raise ValueError("the reading has no surface to draw; see its status and reason")
    geometry, datum = lengths.geometry, surface.datum
    known = geometry.apex is not None and geometry.cylinder_bottom is not None
    joint = datum - geometry.cylinder_bottom if known and geometry.cylinder_bottom is not None else None
    vertex = datum - geometry.apex if geometry.apex is not None else 0.0
    return surface, _Silo(surface.radius, joint, vertex, datum - lengths.top)


def _datum(content: Content) -> str:
    return "cone's vertex" if content.height_datum == "cone-vertex" else "lowest point seen"


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


def _ring(silo: _Silo, height: float) -> tuple[float, float]:
    """Radius of the silo at a height, and that height."""
    if silo.joint is None or height >= silo.joint:
        return silo.radius, height
    return silo.radius * (height - silo.vertex) / (silo.joint - silo.vertex), height


def _skin(axes: Any, angles: Numbers, low: Any, high: Any, colour: str, order: int) -> None:
    """A strip of wall between two rings (radius, height), each number or one for every angle; lit from one side."""
    r, z = (np.stack([np.broadcast_to(ring[k], angles.shape) for ring in (low, high)]) for k in (0, 1))
    if float(np.max(z[1] - z[0])) < 1e-9:
        return
    light = 0.72 + 0.28 * np.abs(np.cos(angles[:-1] - LIGHT))
    colours = np.array(to_rgb(colour)) * light[:, None]
    axes.plot_surface(r * np.cos(angles), r * np.sin(angles), z, facecolors=colours[None], rstride=1, cstride=1,
                      zorder=order, **SOLID)  # fmt: skip


def _body(axes: Any, surface: SurfaceMap, silo: _Silo, angles: Numbers) -> None:
    """The content's outside towards the viewer: along the cylinder up to its surface, and along the cone."""
    along = np.linspace(0.0, 1.0, 4 * RINGS) * silo.radius
    places = along[:, None, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)[None]
    heights, floor = surface.height(places), silo.floor(along)[:, None]
    covered = heights > floor
    outermost = np.where(covered.any(axis=0), len(along) - 1 - np.argmax(covered[::-1], axis=0), 0)
    rim = along[outermost], np.maximum(heights[outermost, np.arange(len(angles))], floor[outermost, 0])
    joint = silo.vertex if silo.joint is None else silo.joint
    _skin(axes, angles, (rim[0], np.minimum(rim[1], joint)), rim, FEED, 3)
    _skin(axes, angles, (0.0 if silo.joint is not None else silo.radius, silo.vertex),
          (rim[0], np.minimum(rim[1], joint)), FEED, 3)  # fmt: skip


def _shade(heights: Numbers, x: Numbers, y: Numbers) -> Any:
    """Colours by height, lit from one side so that slopes show."""
    span = Normalize(np.nanmin(heights), max(np.nanmax(heights), np.nanmin(heights) + 1e-6))
    colours = GRAIN(0.25 + 0.6 * span(np.nan_to_num(heights, nan=0.0)))
    rises = [np.gradient(np.nan_to_num(v), axis=a) for v in (heights, x, y) for a in (0, 1)]
    along, across = (np.stack([rises[2 + a], rises[4 + a], rises[a]], axis=-1) for a in (0, 1))
    normal = np.cross(across, along)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    light = np.abs(normal @ np.array([0.57 * math.cos(LIGHT), 0.57 * math.sin(LIGHT), 0.82]))
    colours[..., :3] *= (0.55 + 0.45 * light)[..., None]
    return colours


def _profile(axes: Axes, surface: SurfaceMap, silo: _Silo, azimuth: float) -> None:
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
