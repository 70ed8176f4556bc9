"""A silo's story: events, use, and when it will be empty; told anew from where something changed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.monitor.clock import DAY, SECOND
from siloscope.monitor.store import changes, readings
from siloscope.monitor.store.engine import Store, new_id
from siloscope.tracking.events import events
from siloscope.tracking.outliers import outliers
from siloscope.tracking.use import use
from siloscope.types.track import Event, Use

USED = 28 * DAY
"""Of which time the daily use is."""

BEFORE = 7 * DAY
"""Readings before a change that its events may begin in."""

MOST = 6000
"""Readings of a story; of more, every second, third, ... is left out."""


@dataclass(frozen=True)
class Series:
    """Answered readings in their order; NaN for unknown. Times in s."""

    time: NDArray[np.float64]
    stock: NDArray[np.float64]
    """Volume, or what the ullage has lost where no volume is known, m³."""
    std: NDArray[np.float64]
    own: NDArray[np.float64]
    mass: NDArray[np.float64]
    coverage: NDArray[np.float64]
    capacity: float | None
    by_volume: bool


COLUMNS = ("time", "stock", "std", "own", "mass", "coverage")


def series_of(rows: Any) -> Series:
    """From the store's rows."""
    thin = rows[:: max(1, -(-len(rows) // MOST))]
    by_volume = 2 * sum(row.volume is not None for row in thin) >= sum(row.ullage is not None for row in thin)
    thin = [row for row in thin if (row.volume if by_volume else row.ullage) is not None]

    def column(name: str) -> NDArray[np.float64]:
        values = [getattr(row, name) for row in thin]
        return np.array([np.nan if value is None else value for value in values], np.float64)

    stock = column("volume") if by_volume else -column("ullage")
    std = column("volume_std") if by_volume else column("ullage_std")
    time = column("time") / SECOND
    capacity = next((row.capacity for row in reversed(thin) if row.capacity is not None), None)
    return Series(time, stock, std, column("own_std"), column("mass"), column("coverage"), capacity, by_volume)


def told(series: Series) -> tuple[tuple[Event, ...], Series]:
    """Events, and the readings without those that stand apart."""
    apart = outliers(series.stock, series.own, series.coverage, capacity=series.capacity)
    keep = ~apart
    columns = {name: getattr(series, name)[keep] for name in COLUMNS}
    kept = replace(series, **columns)
    found = events(kept.time, kept.stock, kept.own, std=kept.std, capacity=kept.capacity, mass=kept.mass)
    return found, kept


def used(series: Series, found: tuple[Event, ...]) -> Use | None:
    """Daily use and when it is empty; the latter only where the volume is known."""
    if not len(series.time):
        return None
    amount = series.stock if series.by_volume else series.stock - series.stock.min()
    return use(series.time, amount, series.std, found)


class Storyteller:
    """Tells silos' stories anew."""

    def __init__(self, store: Store) -> None:
        self._store = store

    def tell(self, silo: str, since: int, now: int) -> None:
        """Events from a time on, and the forecast."""
        begin = self._begin(silo, since)
        with self._store.read() as connection:
            rows = readings.series(connection, silo, readings.Span(begin))
            recent = readings.series(connection, silo, readings.Span(now - USED))
        found, _ = told(series_of(rows))
        late, kept = told(series_of(recent))
        forecast = used(kept, late)
        with self._store.write() as connection:
            readings.replace_events(connection, silo, begin, [_row(silo, event) for event in found])
            row = None if forecast is None else _forecast(forecast, kept, now)
            readings.replace_forecast(connection, silo, row)
            changes.note(connection, "forecast", silo, silo, now)

    def _begin(self, silo: str, since: int) -> int:
        """Where telling has to begin: at the start of the last event but one before the change."""
        with self._store.read() as connection:
            before = readings.events(connection, silo, readings.Span(since - BEFORE, since))
        starts = [event.start for event in before if event.start < since]
        return int(starts[-2]) if len(starts) > 1 else since - BEFORE


def _row(silo: str, event: Event) -> dict[str, Any]:
    start, end = (int((time or 0.0) * SECOND) for time in (event.start, event.end))
    values = {"volume": event.volume, "volume_std": event.volume_std, "mass": event.mass}
    return {"id": new_id(), "silo": silo, "kind": event.kind, "start": start, "end": end, **values}


def _forecast(found: Use, series: Series, now: int) -> dict[str, Any]:
    def micros(time: float | None) -> int | None:
        return None if time is None or not series.by_volume else int(time * SECOND)

    return {
        "time": now,
        "daily": found.daily,
        "daily_std": found.daily_std,
        "day_to_day": found.day_to_day,
        "empty_by": micros(found.empty_by),
        "earliest": micros(found.earliest),
        "latest": micros(found.latest),
    }
