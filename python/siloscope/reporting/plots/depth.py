"""The depth map, from blue (near) to yellow (far)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, LinearSegmentedColormap
from matplotlib.figure import Figure
from numpy.typing import NDArray

from siloscope.reporting.plots.style import MUTED, RULE, figure, heading

DEPTH_COLOURS = ("#1a2a6c", "#1f5fa8", "#1f93a6", "#5fbf8a", "#c3d65a", "#ffe94a")
"""Near to far; lightness rises all the way, so the picture also reads in grey."""


def depth_map(depth: NDArray[np.floating], title: str = "Depth map") -> Figure:
    """Picture of a depth image (H, W) in metres; pixels without a measurement are grey."""
    made = figure(8.0, 5.8)
    axes = made.add_subplot()
    paint_depth(axes, depth)
    heading(made, title)
    return made


def paint_depth(axes: Axes, depth: NDArray[np.floating], bar: bool = True) -> None:
    """A depth image on given axes, with its colour bar."""
    seen = np.where(np.isfinite(depth) & (depth > 0), depth, np.nan)
    image = axes.imshow(seen, cmap=blue_to_yellow(), interpolation="nearest")
    axes.set_xticks([])
    axes.set_yticks([])
    for side in axes.spines.values():
        side.set_visible(False)
    if bar and axes.figure is not None:
        scale = axes.figure.colorbar(image, ax=axes, shrink=0.9, pad=0.02)
        scale.set_label("depth z (m)", color=MUTED, fontsize=10)
        scale.ax.tick_params(labelsize=9, colors=MUTED, length=0)
        scale.outline.set_visible(False)


def blue_to_yellow() -> Colormap:
    """The paper's colours in a scale that is even in lightness and safe for the colour-blind."""
    return LinearSegmentedColormap.from_list("depth", DEPTH_COLOURS).with_extremes(bad=RULE)
