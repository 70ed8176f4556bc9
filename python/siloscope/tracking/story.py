"""From readings in their order to the story: flow, events, use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from siloscope.tracking.events import events
from siloscope.tracking.outliers import doubtful, gaps, outliers, without_steps
from siloscope.tracking.use import use
from siloscope.types.content import Content
from siloscope.types.track import Reading, Track, Use

MOVED = "camera-moved"
"""Remark on a reading whose errors are no longer those of its calibration."""

OUTLIER = "outlier"
"""Code of a reading that stands apart from both neighbours; it makes no event."""


def reading_of(index: int, time: float | None, content: Content, digest: str | None = None) -> Reading:
    """One frame's reading, without what only its neighbours tell."""
    loose = (content.density or {}).get("loose_kg_m3")
    density = content.mass / content.volume if content.mass and content.volume else loose
    return Reading(
        index,
        content.source,
        time,
        content.status,
        {"refused": content.reason, "unreadable": content.message}.get(content.status),
        content.volume,
        content.volume_std,
        content.fill_fraction,
        content.level.mean,
        content.mass,
        content.mass_std,
        content.coverage,
        quality=tuple(remark.code for remark in content.quality),
        ullage=content.ullage,
        ullage_std=content.ullage_std,
        own_std=content.own_std,
        density=density,
        datum=None if content.surface is None else content.surface.datum,
        digest=digest,
    )


def track_of(
    readings: Sequence[Reading],
    last: Content | None = None,
    problems: tuple[str, ...] = (),
    capacity: float | None = None,
    name: str | None = None,
) -> Track:
    """The story of readings in their order.

    Changes are those of the volume, or of the ullage where the bottom is not known: a difference needs no bottom.

    Parameters
    ----------
    readings : sequence of Reading
        Stored ones and new ones; what their neighbours tell is told anew.
    last : Content, optional
        The newest reading with its surface.
    problems : tuple of str
        Files that can't be read.
    capacity : float, optional
        Of the silo, m³; that of `last` where not given.
    name : str, optional
        The silo's.
    """
    capacity = last.capacity if capacity is None and last is not None else capacity
    basis = basis_of(readings)
    stock = [_stock(reading, basis) for reading in readings]
    answered = [k for k, value in enumerate(stock) if value is not None]
    doubted = doubtful([readings[k].quality for k in answered])
    beside = (np.append(doubted[1:], False) | np.insert(doubted[:-1], 0, False))[~doubted]
    answered = [k for k, doubt in zip(answered, doubted, strict=True) if not doubt]
    columns = _columns([readings[k] for k in answered], [stock[k] for k in answered])
    time, amount, std, own, coverage, density = columns
    apart = outliers(amount, own, coverage, time=time, capacity=capacity, beside_doubt=beside)
    kept = [k for k, out in zip(answered, apart, strict=True) if not out]
    time, amount, std, own, density = (values[~apart] for values in (time, amount, std, own, density))
    still = without_steps(amount, std, [MOVED in readings[k].quality for k in kept])
    found = events(time, still, own, std=std, capacity=capacity, mass=still * density)
    told = _told(readings, stock, {k for k, out in zip(answered, apart, strict=True) if out})
    unread = tuple(Reading(len(told) + i, cause, None, "unreadable", cause) for i, cause in enumerate(problems))
    used = use(time, still - (0.0 if basis == "volume" else still.min(initial=0.0)), std, found)
    return Track(
        tuple(told) + unread,
        tuple(replace(e, first=readings[kept[e.first]].index, last=readings[kept[e.last]].index) for e in found),
        used if used is None or basis == "volume" else _without_bottom(used),
        capacity,
        None if last is None else last.height_datum,
        problems,
        last,
        {} if last is None else last.config,
        basis,
        gaps(time),
        name,
    )


def _without_bottom(used: Use) -> Use:
    """A forecast down to the lowest content seen, which is not the bottom."""
    return replace(used, empty_by=None, earliest=None, latest=None, lowest_by=used.empty_by)


def basis_of(readings: Sequence[Reading]) -> str:
    """What changes are counted by: "volume", or "ullage" where most readings have no volume."""
    volumes = sum(reading.volume is not None for reading in readings)
    ullages = sum(reading.ullage is not None for reading in readings)
    return "ullage" if 2 * volumes < ullages else "volume"


def _stock(reading: Reading, basis: str) -> float | None:
    """The volume, up to a constant."""
    if basis == "volume":
        return reading.volume
    return None if reading.ullage is None else -reading.ullage


def _columns(readings: Sequence[Reading], stock: Sequence[float | None]) -> tuple[NDArray[np.float64], ...]:
    """Times, stock, its deviation, the part that differs from frame to frame, coverage, density; NaN for unknown."""
    lists = (
        [reading.time for reading in readings],
        stock,
        [reading.volume_std if reading.volume_std is not None else reading.ullage_std for reading in readings],
        [reading.own_std for reading in readings],
        [reading.coverage for reading in readings],
        [reading.density for reading in readings],
    )
    return tuple(np.array([np.nan if value is None else value for value in values], np.float64) for values in lists)


def _told(readings: Sequence[Reading], stock: Sequence[float | None], apart: set[int]) -> list[Reading]:
    """The rows with flow; where the floor is not known, heights are over the lowest point of the whole story."""
    lowest = max((r.datum for r in readings if r.datum is not None), default=0.0)
    rows: list[Reading] = []
    before: int | None = None
    for k, reading in enumerate(readings):
        lift = 0.0 if reading.datum is None else lowest - reading.datum
        flow = None if before is None or k in apart else _flow(readings, stock, before, k)
        density = reading.density if reading.density is not None or before is None else readings[before].density
        quality = tuple(code for code in reading.quality if code != OUTLIER)
        rows.append(
            replace(
                reading,
                level=None if reading.level is None else reading.level + lift,
                datum=None if reading.datum is None else lowest,
                flow=flow,
                mass_flow=None if flow is None or density is None else 1e-3 * flow * density,
                quality=(*quality, OUTLIER) if k in apart else quality,
            )
        )
        before = k if stock[k] is not None and k not in apart else before
    return rows


def _flow(readings: Sequence[Reading], stock: Sequence[float | None], before: int, now: int) -> float | None:
    """m³/h between two readings."""
    first, second = readings[before].time, readings[now].time
    old, new = stock[before], stock[now]
    if first is None or second is None or old is None or new is None or second <= first:
        return None
    return (new - old) / ((second - first) / 3600.0)
