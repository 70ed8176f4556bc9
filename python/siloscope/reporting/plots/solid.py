"""The content as a body in the silo, whose wall is cut open."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.colors import Normalize, to_rgb
from matplotlib.figure import Figure

from siloscope.reporting.plots.outline import GRAIN, Numbers, Outline, datum, headline, outline_of
from siloscope.reporting.plots.style import MUTED, figure, heading
from siloscope.types.content import Content
from siloscope.types.surface_map import SurfaceMap

FEED = "#d9a441"
WALL = "#dde2e8"
LIGHT = -0.66
"""Direction from which the light comes, radians."""
SOLID: dict[str, Any] = {"linewidth": 0, "antialiased": False, "shade": False}

TURNS = 97
RINGS = 41
"""Angles and radii at which a surface is drawn."""


def surface_3d(content: Content, azimuth: float = -60.0) -> Figure:
    """The content in the silo, whose wall is cut open towards the viewer."""
    surface, silo = outline_of(content)
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
    axes.set_zlabel(f"height over the {datum(content)} (m)", color=MUTED)
    axes.tick_params(labelsize=8, colors=MUTED)
    heading(made, headline(content))
    return made


def _ring(silo: Outline, height: float) -> tuple[float, float]:
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


def _body(axes: Any, surface: SurfaceMap, silo: Outline, angles: Numbers) -> None:
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
