"""A content over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from matplotlib.figure import Figure

from siloscope.reporting.plots.outline import Numbers
from siloscope.reporting.plots.style import AMBER, BLUE, GREEN, MUTED, RED, figure, heading, legend, tidy
from siloscope.wording import with_std


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
    heading(made, _headline(volume[known], std[known], quantity.split("(")[1].rstrip(")")))
    return made


def _headline(volume: Numbers, std: Numbers, unit: str) -> str:
    if not len(volume):
        return "No reading has an answer"
    first, last = (with_std(float(volume[i]), float(std[i]), 1.0, f" {unit}") for i in (0, -1))
    return f"From {first} to {last} in {len(volume)} readings"
