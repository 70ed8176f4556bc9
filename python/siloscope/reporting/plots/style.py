"""The look all pictures share: colours that the colour-blind can tell apart, quiet axes, one way to save."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure

from siloscope.wording import printable

INK = "#1b2733"
MUTED = "#66727f"
RULE = "#dfe4ea"
BLUE = "#0072b2"
RED = "#c1272d"
GREEN = "#009e73"
AMBER = "#e69f00"
PURPLE = "#aa4499"
GREY = "#a9b2bc"

CLASS_COLOURS = {"cylinder": BLUE, "cone": GREEN, "feed": AMBER, "other": GREY}
"""Colour of each part of what a frame shows."""

DPI = 150


def figure(width: float, height: float) -> Figure:
    """A white figure of so many inches that belongs to nobody: no pyplot, no global state."""
    made = Figure(figsize=(width, height), facecolor="white", layout="constrained")
    made.get_layout_engine().set(w_pad=0.12, h_pad=0.12)  # type: ignore[union-attr,call-arg]
    FigureCanvasAgg(made)
    return made


def tidy(axes: Axes, title: str = "", x: str = "", y: str = "") -> Axes:
    """Title, labels with units, light grid, no box."""
    axes.set_title(title, loc="left", fontsize=11, color=INK, fontweight="bold", pad=8)
    axes.set_xlabel(x, fontsize=10, color=MUTED)
    axes.set_ylabel(y, fontsize=10, color=MUTED)
    axes.tick_params(labelsize=9, colors=MUTED, length=0)
    axes.grid(color=RULE, linewidth=0.7)
    axes.set_axisbelow(True)
    for side in axes.spines.values():
        side.set_visible(False)
    return axes


def legend(axes: Axes, below: bool = True, columns: int = 4, gap: float = 0.13) -> None:
    """A legend without a box: below the axes, or where there is room in them."""
    place: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, -gap)} if below else {"loc": "best"}
    made = axes.legend(
        ncols=columns if below else 1,
        fontsize=9.5,
        frameon=False,
        labelcolor=INK,
        scatterpoints=1,
        handlelength=1.6,
        **place,
    )
    for handle in made.legend_handles:
        if isinstance(handle, PathCollection):
            handle.set_sizes([28.0])
            handle.set_alpha(1.0)


def heading(made: Figure, text: str) -> None:
    """The sentence over the whole figure that says what it shows."""
    made.suptitle(printable(text), x=0.01, ha="left", fontsize=13, color=INK, fontweight="bold", parse_math=False)


def save(made: Figure, path: Path) -> Path:
    """Write a figure as PNG."""
    made.savefig(path, dpi=DPI)
    return path


def png(made: Figure, dpi: int = DPI) -> bytes:
    """A figure as the bytes of a PNG file."""
    buffer = io.BytesIO()
    made.savefig(buffer, dpi=dpi, format="png")
    return buffer.getvalue()
