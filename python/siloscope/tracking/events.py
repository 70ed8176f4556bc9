"""Refills and withdrawals: rises and falls of the volume that are more than its deviations."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from siloscope.types.track import Event

TURN_SIGMAS = 5.0
"""Standard deviations of a difference that a rise or fall must exceed to be an event."""

TURN_FRACTION = 0.002
"""And this fraction of the capacity: what dust, settling and temperature do to a quiet silo."""


def events(
    time: ArrayLike,
    volume: ArrayLike,
    own_std: ArrayLike,
    *,
    std: ArrayLike | None = None,
    capacity: float | None = None,
    mass: ArrayLike | None = None,
) -> tuple[Event, ...]:
    """Rises and falls between the turning points of the volume, from readings in their order.

    Parameters
    ----------
    time : array (N,)
        Seconds; NaN where not known.
    volume : array (N,)
        m³.
    own_std : array (N,)
        The part of each volume's standard deviation that differs from reading to reading, m³ (`Content.own_std`). NaN
        where not known.
    std : array (N,), optional
        The whole of it, m³. What all readings of one calibration share, such as the radius' error, grows with the
        volume: of a difference it leaves the difference. Without it nothing is shared.
    capacity : float, optional
        Of the silo, m³: changes below `TURN_FRACTION` of it are no events.
    mass : array (N,), optional
        Of the content at each reading, kg; NaN where not known.

    Returns
    -------
    tuple of Event
        `first` and `last` are places in these arrays.
    """
    times, volumes, own = (np.asarray(values, np.float64) for values in (time, volume, own_std))
    shared = np.zeros(len(volumes)) if std is None else np.sqrt(np.maximum(np.square(std) - own**2, 0.0))
    masses = np.full(len(volumes), np.nan) if mass is None else np.asarray(mass, np.float64)
    if len(volumes) < 2:
        return ()
    least = _thresholds(own, capacity)
    found = []
    for turn, next_turn in legs(volumes, least):
        first, last = _trimmed(volumes, turn, next_turn, 0.1 * float(min(least[turn], least[next_turn])))
        amount, alone = float(volumes[last] - volumes[first]), float(np.hypot(own[first], own[last]))
        alone = alone if math.isfinite(alone) else float(np.hypot(least[first], least[last])) / TURN_SIGMAS
        common = float(shared[last] - shared[first])
        whole = math.hypot(alone, common) if math.isfinite(common) else alone
        kind = "refill" if amount > 0.0 else "withdrawal"
        known = last if kind == "refill" else first
        moved = abs(amount) * float(masses[known]) / float(volumes[known]) if volumes[known] else math.nan
        start, end = (None if math.isnan(t) else float(t) for t in (times[first], times[last]))
        weight = None if math.isnan(moved) else moved
        found.append(Event(kind, first, last, start, end, abs(amount), whole, weight, alone))
    return tuple(found)


def _thresholds(own_std: NDArray[np.float64], capacity: float | None) -> NDArray[np.float64]:
    """What each reading adds to the smallest change that is an event, m³: two of them are added as deviations are.

    A reading counts with its own deviation or the usual one, whichever is larger: a lens that gets dirty makes readings
    less sure, and a single one that claims much is no surer than its neighbours.
    """
    known = own_std[np.isfinite(own_std)]
    usual = float(np.median(known)) if len(known) else 0.0
    least = max(TURN_FRACTION * (capacity or 0.0), 1e-9) / math.sqrt(2.0)
    return np.maximum(TURN_SIGMAS * np.maximum(np.nan_to_num(own_std), usual), least)


def legs(volume: NDArray[np.float64], least: NDArray[np.float64]) -> Iterator[tuple[int, int]]:
    """Stretches between turning points that differ by more than their thresholds (N,), added as deviations are."""

    def turned(i: int, j: int) -> bool:
        return bool(abs(volume[i] - volume[j]) > math.hypot(least[i], least[j]))

    low = high = extreme = direction = 0
    turns: list[int] = []
    for i in range(1, len(volume)):
        if direction == 0:
            low, high = (i if volume[i] < volume[low] else low), (i if volume[i] > volume[high] else high)
            if turned(low, high):
                direction = 1 if high > low else -1
                extreme = max(low, high)
                turns = [min(low, high)]
        elif direction * (volume[i] - volume[extreme]) >= 0.0:
            extreme = i
        elif turned(extreme, i):
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
