"""What the evaluation's figures have in common."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter
from numpy.typing import NDArray

from siloscope.reporting.plots.style import BLUE, GREEN, INK, PURPLE, RED
from siloscope.reproduction.evaluation.tables import LEAST

COLOURS = {"shape-tensor": RED, "surface": BLUE, "surface-diameter": GREEN, "surface-profile": PURPLE}
"""One colour a method, in every figure."""


def millimetres(distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances in m as they are drawn on a logarithmic axis: those below `LEAST` mm at it."""
    drawn: NDArray[np.float64] = np.maximum(1e3 * distance, LEAST)
    return drawn


def decades(axes: Axes) -> None:
    """0.1, 1, 10 … on a logarithmic axis, instead of powers of ten."""
    axes.yaxis.set_major_locator(LogLocator())
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, 10.0 ** np.floor(np.log10(high) - 1.0)), max(high, 10.0 ** np.ceil(np.log10(low) + 1e-9)))


def small_legend(axes: Axes, columns: int, below: float) -> None:
    """A legend of small letters below the axes; it may reach below the next ones and does not move them."""
    place: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (-0.02, below)}
    made = axes.legend(**place, ncols=columns, fontsize=8.5, frameon=False, labelcolor=INK)
    made.set_in_layout(False)
