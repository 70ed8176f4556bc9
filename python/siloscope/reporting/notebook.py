"""Results as a notebook shows them: their `repr`, and the picture that says most."""

from __future__ import annotations

import base64
import io
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from siloscope.types.content import Content
from siloscope.types.estimate import Estimate
from siloscope.types.track import Track

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH = 640
"""Pixels at which a picture is shown."""


def html(result: Any) -> str:
    """A result's `repr` with its picture below, where it has one; a picture that can't be drawn is left out."""
    figure = _figure(result)
    picture = "" if figure is None else f'<img width="{WIDTH}" src="data:image/png;base64,{_png(figure)}">'
    return f"<pre>{escape(repr(result))}</pre>{picture}"


def _figure(result: Any) -> Figure | None:
    if isinstance(result, Estimate):
        return _profile(result)
    if isinstance(result, Content):
        from siloscope.reporting.plots.content import pictures

        return pictures(result).get("height-map")
    if isinstance(result, Track):
        from siloscope.reporting.track_page import trend

        figure: Figure = trend(result)
        return figure
    return None


def _profile(estimate: Estimate) -> Figure | None:
    """The wall's radius by depth, as the fit's patches show it."""
    from siloscope.reporting import plots

    details = estimate.details
    if not estimate.ok or details is None:
        return None
    wall = np.isfinite(details.residuals)
    return plots.profile(details.points, wall, estimate.silo, details.residuals, "patches")


def _png(figure: Figure) -> str:
    stored = io.BytesIO()
    figure.savefig(stored, format="png", dpi=100)
    return base64.b64encode(stored.getvalue()).decode("ascii")
