"""The tables of a run: readings and events of a shard."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from siloscope.fleet.naming import Series
from siloscope.fleet.tables import schema_of, table_bytes
from siloscope.types.content import Content
from siloscope.types.track import ABSOLUTE, Event, Reading

RESULTS = "siloscope.results/1"
EVENTS = "siloscope.events/1"

_NUMBERS = (
    *("volume_m3", "volume_std_m3", "ullage_m3", "ullage_std_m3", "own_std_m3", "fill_fraction", "capacity_m3"),
    *("level_m", "level_std_m", "level_min_m", "level_max_m", "level_axis_m", "datum_m", "coverage"),
    *("mass_kg", "mass_std_kg", "density_kg_m3", "flow_m3_h", "mass_flow_t_h"),
)

READING_COLUMNS = (
    ("camera", "string"),
    ("shard", "string"),
    ("captured", "time"),
    ("seconds", "float64"),
    ("sha256", "string"),
    ("status", "string"),
    ("reason", "string"),
    *((name, "float64") for name in _NUMBERS),
    ("quality", "words"),
)
"""Columns of ``results``; the silo is the folder's. ``captured`` is null where ``seconds`` only count from a start."""

EVENT_COLUMNS = (
    ("camera", "string"),
    ("shard", "string"),
    ("kind", "string"),
    ("start", "time"),
    ("end", "time"),
    ("volume_m3", "float64"),
    ("volume_std_m3", "float64"),
    ("mass_kg", "float64"),
)
"""Columns of ``events``: refills and withdrawals that begin and end within the shard."""


def readings_bytes(rows: Sequence[dict[str, Any]], said: dict[str, str]) -> bytes:
    """The table of readings; `said` is written into the file's description."""
    return table_bytes(rows, schema_of(READING_COLUMNS, {"siloscope.schema": RESULTS, **said}))


def events_bytes(rows: Sequence[dict[str, Any]], said: dict[str, str]) -> bytes:
    """The table of events."""
    return table_bytes(rows, schema_of(EVENT_COLUMNS, {"siloscope.schema": EVENTS, **said}))


def reading_row(series: Series, number: int, sha256: str, reading: Reading, content: Content | None) -> dict[str, Any]:
    """A reading with what its content says beyond it."""
    level = None if content is None else content.level
    return {
        "camera": series.camera,
        "shard": series.shard(number),
        "captured": micros(reading.time),
        "seconds": reading.time,
        "sha256": sha256,
        "status": reading.status,
        "reason": reading.reason,
        "volume_m3": reading.volume,
        "volume_std_m3": reading.volume_std,
        "ullage_m3": reading.ullage,
        "ullage_std_m3": reading.ullage_std,
        "own_std_m3": reading.own_std,
        "fill_fraction": reading.fill_fraction,
        "capacity_m3": None if content is None else content.capacity,
        "level_m": reading.level,
        "level_std_m": None if level is None else level.std,
        "level_min_m": None if level is None else level.min,
        "level_max_m": None if level is None else level.max,
        "level_axis_m": None if level is None else level.at_axis,
        "datum_m": reading.datum,
        "coverage": reading.coverage,
        "mass_kg": reading.mass,
        "mass_std_kg": reading.mass_std,
        "density_kg_m3": reading.density,
        "flow_m3_h": reading.flow,
        "mass_flow_t_h": reading.mass_flow,
        "quality": list(reading.quality),
    }


def event_row(series: Series, number: int, event: Event) -> dict[str, Any]:
    """An event of a shard."""
    return {
        "camera": series.camera,
        "shard": series.shard(number),
        "kind": event.kind,
        "start": micros(event.start),
        "end": micros(event.end),
        "volume_m3": event.volume,
        "volume_std_m3": event.volume_std,
        "mass_kg": event.mass,
    }


def micros(time: float | None) -> int | None:
    """Microseconds since 1970; None for a time that only counts from a recording's start."""
    return None if time is None or not ABSOLUTE < time < 2.5e11 else round(time * 1e6)
