"""Readings that bad frames made, steps that a moved camera made, and stretches without readings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from siloscope.tracking.events import TURN_FRACTION, TURN_SIGMAS

GAP = 5.0
"""A stretch longer than this many usual intervals between readings is a gap."""

UNCONFIRMED_COVERAGE = 1.0 / 3.0
"""The last reading counts alone only where at least this fraction of its surface was seen."""


USUAL_CHANGE = 0.95
"""Fraction of the changes between readings that are usual."""

MARGIN = 1.5
"""Factor by which a change may be larger than the largest usual one."""

DOUBTFUL = ("dust-or-fog", "obstruction")
"""Remarks on readings whose volume says more of what hangs in the air than of the surface."""

LONGEST_DOUBT = 12
"""A remark on more readings in a row than these is the site's usual state, and no doubt."""

USUAL = 0.5
"""So is one on more than this fraction of all readings."""


def doubtful(quality: Sequence[Sequence[str]]) -> NDArray[np.bool_]:
    """Readings (N,) that make no event, by the codes of their remarks: clean ones before and after tell what happened.

    Dust of a delivery hangs for hours, and the volumes read through it go up and down by several percent.
    """
    found = np.zeros(len(quality), np.bool_)
    for code in DOUBTFUL:
        has = np.array([code in codes for codes in quality], np.bool_)
        if has.mean() <= USUAL if len(has) else False:
            for first, last in _runs(has):
                found[first:last] |= last - first <= LONGEST_DOUBT
    return found


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Beginning and end of each stretch of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def without_steps(volume: ArrayLike, std: ArrayLike, group: ArrayLike) -> NDArray[np.float64]:
    """Volumes (N,) without the steps between readings that share no errors, as before and after a move of the camera.

    A step that the whole deviations explain is none of the content: it is taken from all readings behind it. A larger
    one stays.

    Parameters
    ----------
    volume, std : array (N,)
        Volumes with their whole standard deviations, m³; NaN where not known.
    group : array (N,)
        Readings of one group have their calibration's errors in common.
    """
    volumes, deviations, groups = np.asarray(volume, np.float64), np.asarray(std, np.float64), np.asarray(group)
    step, between = np.diff(volumes), np.hypot(deviations[:-1], deviations[1:])
    apparent = (np.diff(groups.astype(int)) != 0) & (np.abs(step) <= TURN_SIGMAS * np.nan_to_num(between))
    return np.asarray(volumes - np.concatenate([[0.0], np.cumsum(np.where(apparent, step, 0.0))]))


def outliers(
    volume: ArrayLike,
    own_std: ArrayLike,
    coverage: ArrayLike,
    *,
    time: ArrayLike | None = None,
    capacity: float | None = None,
    beside_doubt: ArrayLike | None = None,
) -> NDArray[np.bool_]:
    """Readings (N,) that stand apart, one or two in a row, while those before and after agree.

    Those agree where the later one lies lower by no more than is usually used in that time. It may lie higher only
    while the silo is being filled: else a small delivery with a meal behind it would be taken for a stray reading.

    Parameters
    ----------
    volume, own_std, coverage : array (N,)
        Volume and the part of its deviation that differs from frame to frame, m³; fraction of the surface seen.
    time : array (N,), optional
        Seconds; without it readings count as equally far apart.
    capacity : float, optional
        m³; steps below `TURN_FRACTION` of it are no outliers.
    beside_doubt : array (N,) of bool, optional
        Readings just before or behind a doubtful one: dust tells of a delivery, so they are none.
    """
    volumes, own, seen = (np.asarray(values, np.float64) for values in (volume, own_std, coverage))
    found = np.zeros(len(volumes), np.bool_)
    if len(volumes) < 2:
        return found
    times = np.arange(len(volumes), dtype=np.float64) if time is None else np.asarray(time, np.float64)
    least = TURN_SIGMAS * np.sqrt(2.0) * np.nan_to_num(own)
    least = np.maximum(least, TURN_FRACTION * (capacity or 0.0))
    for width in (1, 2):
        found |= _apart(volumes, times, least, width)
    if beside_doubt is not None:
        found &= ~np.asarray(beside_doubt, np.bool_)
    step = np.abs(np.diff(volumes))
    found[0] = bool(step[0] > least[0] and seen[0] < UNCONFIRMED_COVERAGE)
    found[-1] = bool(step[-1] > least[-1] and seen[-1] < UNCONFIRMED_COVERAGE)
    return found


def _apart(
    volume: NDArray[np.float64], time: NDArray[np.float64], least: NDArray[np.float64], width: int
) -> NDArray[np.bool_]:
    """Readings that stand apart, so many in a row."""
    found = np.zeros(len(volume), np.bool_)
    if len(volume) < width + 2:
        return found
    before, after = volume[: -width - 1], volume[width + 1 :]
    inner = np.stack([volume[1 + k : len(volume) - width + k] for k in range(width)])
    out, back = inner - before, after - inner
    clear = least[1 : len(volume) - width]
    apart = (np.abs(out) > clear).all(axis=0) & (np.abs(back) > clear).all(axis=0)
    apart &= (np.sign(out) == np.sign(out[0])).all(axis=0) & (np.sign(back) == -np.sign(out[0])).all(axis=0)
    net, span = after - before, np.maximum(time[width + 1 :] - time[: -width - 1], 1e-9)
    part = 0.25 * np.minimum(np.abs(out), np.abs(back)).min(axis=0)
    rate = (np.abs(net) / span)[np.isfinite(span)]
    used = MARGIN * (float(np.quantile(rate, USUAL_CHANGE)) if len(rate) else 0.0) * np.nan_to_num(span)
    filling = np.concatenate([[False], np.diff(volume)[: -width - 1] > least[: -width - 2]])
    apart &= (net > -np.maximum(part, used)) & (net < np.where(filling, part, clear))
    for k in range(width):
        found[1 + k : len(volume) - width + k] |= apart
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
