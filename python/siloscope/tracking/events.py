"""Refills and withdrawals: rises and falls of the volume that are more than its deviations."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from siloscope.tracking.story import Moment
from siloscope.types.track import Event

TURN_SIGMAS = 5.0
"""A rise or fall must exceed so many standard deviations of a difference to be an event."""

TURN_SHARE = 0.002
"""And this share of the capacity: what dust, settling and temperature do to a quiet silo."""


def events(moments: list[Moment]) -> Iterator[Event]:
    """Rises and falls between the turning points of the volume."""
    if len(moments) < 2:
        return
    volume = np.array([float(m.content.volume or 0.0) for m in moments])
    least = _threshold(moments)
    for first, last in legs(volume, least):
        first, last = _trimmed(volume, first, last, 0.1 * least)
        change = moments[last].content.change_since(moments[first].content)
        amount, std = change if change is not None else (volume[last] - volume[first], least / TURN_SIGMAS)
        start, end = moments[first], moments[last]
        kind = "refill" if amount > 0.0 else "withdrawal"
        dense = end.content if kind == "refill" else start.content
        mass = None if dense.mass is None or not dense.volume else abs(amount) * dense.mass / dense.volume
        yield Event(kind, start.index, end.index, start.time, end.time, abs(float(amount)), float(std), mass)


def _threshold(moments: list[Moment]) -> float:
    """Smallest change that is an event."""
    pairs = pairwise(moments)
    changes = [b.content.change_since(a.content) for a, b in pairs]
    std = [change[1] for change in changes if change is not None]
    capacity = moments[-1].content.capacity or 0.0
    return max(TURN_SIGMAS * float(np.median(std)) if std else 0.0, TURN_SHARE * capacity, 1e-9)


def legs(volume: NDArray[np.float64], least: float) -> Iterator[tuple[int, int]]:
    """Stretches between turning points that differ by more than `least`."""
    low = high = extreme = direction = 0
    turns: list[int] = []
    for i in range(1, len(volume)):
        if direction == 0:
            low, high = (i if volume[i] < volume[low] else low), (i if volume[i] > volume[high] else high)
            if volume[high] - volume[low] > least:
                direction = 1 if high > low else -1
                extreme = max(low, high)
                turns = [min(low, high)]
        elif direction * (volume[i] - volume[extreme]) >= 0.0:
            extreme = i
        elif direction * (volume[extreme] - volume[i]) > least:
            turns.append(extreme)
            direction, extreme = -direction, i
    if direction != 0:
        yield from pairwise([*turns, extreme])


def _trimmed(volume: NDArray[np.float64], first: int, last: int, slack: float) -> tuple[int, int]:
    """A leg without the quiet readings at its ends."""
    while first + 1 < last and abs(volume[first + 1] - volume[first]) <= slack:
        first += 1
    while last - 1 > first and abs(volume[last - 1] - volume[last]) <= slack:
        last -= 1
    return first, last
