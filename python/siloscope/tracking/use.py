"""How much is used a day, and when the silo will be empty."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from siloscope.tracking.story import Moment
from siloscope.types.track import DAY, Event, Use

FEWEST_DAYS = 1.0
"""Shorter histories tell no daily use."""

MOST_DAYS = 36_500.0
"""Longer histories have clocks that were set in between."""

FARTHEST = 3650.0
"""Days beyond which nobody forecasts."""


def use(moments: list[Moment], events: tuple[Event, ...]) -> Use | None:
    """Daily use from the withdrawals, and when it has used up what there is."""
    timed = [m for m in moments if m.time is not None]
    if len(timed) < 2:
        return None
    times = np.array([float(m.time or 0.0) for m in timed])
    volume = np.array([float(m.content.volume or 0.0) for m in timed])
    span = (times[-1] - times[0]) / DAY
    used = _used(times, volume, events)
    if not FEWEST_DAYS <= span <= MOST_DAYS or used[-1] <= 0.0 or (np.diff(times) < 0.0).any():
        return None
    daily = float(used[-1]) / span
    spread = _day_to_day(times, used, daily)
    mean_std = spread / math.sqrt(span)
    own = float(timed[-1].content.volume_std or 0.0)
    dates = [_empty(volume[-1], own, daily, spread, mean_std, sigmas) for sigmas in (0.0, 2.0, -2.0)]
    empty, earliest, latest = (None if days is None else float(times[-1] + DAY * days) for days in dates)
    return Use(daily, mean_std, spread, empty, earliest, latest)


def _day_to_day(times: NDArray[np.float64], used: NDArray[np.float64], daily: float) -> float:
    """Standard deviation of one day's use; as large as the use itself while there are not two whole days."""
    whole = int((times[-1] - times[0]) / DAY)
    if whole < 2:
        return daily
    ends = times[0] + DAY * np.arange(whole + 1)
    return float(np.std(np.diff(np.interp(ends, times, used)), ddof=1))


def _used(times: NDArray[np.float64], volume: NDArray[np.float64], events: tuple[Event, ...]) -> NDArray[np.float64]:
    """Volume taken out since the beginning: the falls, with the refills left out."""
    change = np.diff(volume)
    filling = np.zeros(len(change), bool)
    for event in events:
        if event.kind == "refill" and event.start is not None and event.end is not None:
            filling |= (times[:-1] >= event.start) & (times[1:] <= event.end)
    taken: NDArray[np.float64] = np.concatenate([[0.0], np.cumsum(np.where(filling, 0.0, -change))])
    return np.maximum.accumulate(taken)


def _empty(volume: float, std: float, daily: float, spread: float, mean_std: float, sigmas: float) -> float | None:
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
