"""Readings that a single bad frame made, and stretches without readings."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from siloscope.tracking.events import TURN_FRACTION, TURN_SIGMAS

GAP = 5.0
"""A stretch longer than this many usual intervals between readings is a gap."""

UNCONFIRMED_COVERAGE = 1.0 / 3.0
"""The last reading counts alone only where at least this fraction of its surface was seen."""


def outliers(
    volume: ArrayLike, own_std: ArrayLike, coverage: ArrayLike, *, capacity: float | None = None
) -> NDArray[np.bool_]:
    """Readings (N,) that stand apart from both neighbours to one side, while those agree: no refill is undone so.

    Parameters
    ----------
    volume, own_std, coverage : array (N,)
        Volume and the part of its deviation that differs from frame to frame, m³; fraction of the surface seen.
    capacity : float, optional
        m³; steps below `TURN_FRACTION` of it are no outliers.
    """
    volumes, own, seen = (np.asarray(values, np.float64) for values in (volume, own_std, coverage))
    found = np.zeros(len(volumes), np.bool_)
    if len(volumes) < 2:
        return found
    spread = TURN_SIGMAS * np.hypot(np.nan_to_num(own[:-1]), np.nan_to_num(own[1:]))
    step, least = np.diff(volumes), np.maximum(spread, TURN_FRACTION * (capacity or 0.0))
    out, back = step[:-1], step[1:]
    apart = (np.abs(out) > least[:-1]) & (np.abs(back) > least[1:]) & (out * back < 0.0)
    found[1:-1] = apart & (np.abs(out + back) < 0.25 * np.minimum(np.abs(out), np.abs(back)))
    found[0] = bool(abs(step[0]) > least[0] and seen[0] < UNCONFIRMED_COVERAGE)
    found[-1] = bool(abs(step[-1]) > least[-1] and seen[-1] < UNCONFIRMED_COVERAGE)
    return found


def gaps(time: ArrayLike) -> tuple[tuple[float, float], ...]:
    """Beginnings and ends, s, of the stretches without a reading in times (N,) that rise."""
    times = np.asarray(time, np.float64)
    times = times[np.isfinite(times)]
    steps = np.diff(times)
    if len(steps) < 3:
        return ()
    longest = GAP * float(np.median(steps))
    return tuple((float(a), float(b)) for a, b, step in zip(times, times[1:], steps, strict=False) if step > longest)
