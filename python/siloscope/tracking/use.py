"""How much is used a day, and when the silo will be empty."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from siloscope.types.track import DAY, Event, Use

FEWEST_DAYS = 1.0
"""Shorter histories tell no daily use."""

MOST_DAYS = 36_500.0
"""Longer histories have clocks that were set in between."""

SMALL_SAMPLE = 1.2
"""Half-width of a 95 % interval of n degrees of freedom over that of many: 1 + 1.2 / n (Student)."""

MOST_CORRELATION = 0.8
"""Of neighbouring days; a month of days can't show more."""

FARTHEST = 3650.0
"""Days beyond which nobody forecasts."""


def use(time: ArrayLike, volume: ArrayLike, std: ArrayLike, events: Sequence[Event]) -> Use | None:
    """Daily use from the withdrawals, and when it has used up what there is.

    Parameters
    ----------
    time, volume, std : array (N,)
        Seconds, volume and its standard deviation, m³, of readings in their order; readings with a NaN as time are left
        out.
    events : sequence of Event
        What `siloscope.tracking.events.events` found in them; while a refill lasts nothing counts as used.

    Returns
    -------
    Use or None
        None for less than `FEWEST_DAYS`, where nothing was withdrawn, or where times don't rise.
    """
    timed = np.isfinite(np.asarray(time, np.float64))
    times, volumes, deviations = (np.asarray(values, np.float64)[timed] for values in (time, volume, std))
    if len(times) < 2:
        return None
    span = (times[-1] - times[0]) / DAY
    used = _used(times, volumes, events)
    if not FEWEST_DAYS <= span <= MOST_DAYS or used[-1] <= 0.0 or (np.diff(times) < 0.0).any():
        return None
    daily = float(used[-1]) / span
    days_used = _by_day(times, used)
    spread = float(np.std(days_used, ddof=1)) if len(days_used) > 1 else daily
    lasting = spread * _lasting(days_used)
    rate = Rate(daily, lasting / math.sqrt(span), spread)
    wider = 1.0 + SMALL_SAMPLE / max(span - 1.0, 1.0)
    doubt = Rate(daily, wider * rate.daily_std, wider * lasting)
    days = forecast(float(volumes[-1]), float(np.nan_to_num(deviations[-1])), doubt)
    empty, earliest, latest = (None if until is None else float(times[-1] + DAY * until) for until in days)
    return Use(rate.daily, rate.daily_std, rate.day_to_day, empty, earliest, latest)


class Rate(NamedTuple):
    """What is used a day, m³: mean, its standard deviation, and that of one day."""

    daily: float
    daily_std: float
    day_to_day: float


def forecast(volume: float, std: float, rate: Rate) -> tuple[float | None, float | None, float | None]:
    """Days until a volume (m³, with its standard deviation) is used up: expected, earliest and latest (95 %).

    None for what lies beyond `FARTHEST`.
    """
    empty, earliest, latest = (_empty(volume, std, *rate, sigmas) for sigmas in (0.0, 2.0, -2.0))
    return empty, earliest, latest


def _by_day(times: NDArray[np.float64], used: NDArray[np.float64]) -> NDArray[np.float64]:
    """Use of each whole day, m³."""
    whole = int((times[-1] - times[0]) / DAY)
    return np.diff(np.interp(times[0] + DAY * np.arange(whole + 1), times, used))


def _lasting(days: NDArray[np.float64]) -> float:
    """Factor by which the deviation of many days' use exceeds that of independent days.

    A hungry day is followed by hungry days: √((1 + ρ) / (1 - ρ)) with the correlation ρ of neighbouring days, without
    its bias of -(1 + 4 ρ) / n (Kendall 1954).
    """
    if len(days) < 3 or np.ptp(days) == 0.0:
        return 1.0
    off = days - days.mean()
    found = float(off[1:] @ off[:-1] / (off @ off))
    correlation = min(max(found + (1.0 + 4.0 * found) / len(days), 0.0), MOST_CORRELATION)
    return math.sqrt((1.0 + correlation) / (1.0 - correlation))


def _used(times: NDArray[np.float64], volume: NDArray[np.float64], events: Sequence[Event]) -> NDArray[np.float64]:
    """Volume taken out since the beginning: the falls, with the refills left out."""
    change = np.diff(volume)
    filling = np.zeros(len(change), bool)
    for event in events:
        if event.kind == "refill" and event.start is not None and event.end is not None:
            filling |= (times[:-1] >= event.start) & (times[1:] <= event.end)
    taken: NDArray[np.float64] = np.concatenate([[0.0], np.cumsum(np.where(filling, 0.0, -change))])
    return np.maximum.accumulate(taken)


def _empty(volume: float, std: float, daily: float, mean_std: float, spread: float, sigmas: float) -> float | None:
    """Days until `daily t + sigmas √(spread² t + mean_std² t² + std²)` reaches the volume; None beyond ten years."""

    def left(t: float) -> float:
        doubt = math.sqrt(spread**2 * t + (mean_std * t) ** 2 + std**2)
        return volume - daily * t - sigmas * doubt

    low, high = 0.0, FARTHEST
    if left(low) <= 0.0:
        return 0.0
    if left(high) > 0.0:
        return None
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if left(middle) > 0.0 else (low, middle)
    return high
