"""A track as files: tables for people and programs, one picture, one page."""

from __future__ import annotations

import csv
import json
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from siloscope.errors import UsageError
from siloscope.report import Report, picture, table, text
from siloscope.track import ABSOLUTE, DAY, Track, utc

COLUMNS = (
    *("index", "name", "time", "time_utc", "status", "reason", "volume_m3", "volume_std_m3", "fill_fraction"),
    *("level_m", "mass_kg", "mass_std_kg", "coverage", "flow_m3_h", "mass_flow_t_h", "quality"),
)
"""Columns of the tables, in their order."""

FORECAST_POINTS = 60


def write_track(directory: Path, found: Track, parquet: bool = False) -> list[Path]:
    """Writes ``track.json``, ``readings.csv``, ``readings.jsonl``, ``trend.png``, ``report.html`` (and Parquet).

    Raises `OSError` where the directory can't be written, `UsageError` for Parquet without pyarrow.
    """
    from siloscope.plots import save

    directory.mkdir(parents=True, exist_ok=True)
    document = directory / "track.json"
    document.write_text(json.dumps(found.to_dict(), indent=2) + "\n", "utf-8")
    written = [document, write_csv(directory / "readings.csv", found), write_jsonl(directory / "readings.jsonl", found)]
    if parquet:
        written.append(write_parquet(directory / "readings.parquet", found))
    written.append(save(trend(found), directory / "trend.png"))
    return [*written, report(found).write(directory / "report.html")]


def write_csv(path: Path, found: Track) -> Path:
    """One line a reading; empty cells for what is not known, quality codes joined by blanks."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(_rows(found))
    return path


def write_jsonl(path: Path, found: Track) -> Path:
    """One JSON document a line and reading."""
    lines = (json.dumps(reading.to_dict(), allow_nan=False) for reading in found.readings)
    path.write_text("".join(f"{line}\n" for line in lines), "utf-8")
    return path


def write_parquet(path: Path, found: Track) -> Path:
    """The readings as a Parquet table; needs pyarrow (``pip install 'siloscope[parquet]'``)."""
    try:
        pyarrow, writer = (import_module(name) for name in ("pyarrow", "pyarrow.parquet"))
    except ImportError:
        raise UsageError("Parquet needs pyarrow; pip install 'siloscope[parquet]'") from None
    whole, words = pyarrow.int64(), pyarrow.string()
    kinds = {"index": whole, "name": words, "time_utc": words, "status": words, "reason": words, "quality": words}
    schema = pyarrow.schema([(name, kinds.get(name, pyarrow.float64())) for name in COLUMNS])
    writer.write_table(pyarrow.Table.from_pylist(_rows(found), schema=schema), path)
    return path


def _rows(found: Track) -> list[dict[str, Any]]:
    return [{**reading.to_dict(), "quality": " ".join(reading.quality)} for reading in found.readings]


def trend(found: Track) -> Any:
    """The picture of the story."""
    from siloscope.plots.content import trend as drawn

    timed = [r for r in found.readings if r.status != "unreadable"]
    times = [_moment(r.time, r.index) for r in timed]
    volume = np.array([np.nan if r.volume is None else r.volume for r in timed])
    std = np.array([np.nan if r.volume_std is None else r.volume_std for r in timed])
    spans = [
        (_moment(e.start, e.first), _moment(e.end, e.last), e.volume if e.kind == "refill" else -e.volume)
        for e in found.events
    ]
    return drawn(times, volume, std, spans, _forecast(found), found.capacity)


def _moment(time: float | None, index: int) -> Any:
    """A date where the time is absolute, else hours, else the reading's number."""
    if time is None:
        return float(index)
    return datetime.fromtimestamp(time, UTC) if utc(time) is not None else time / 3600.0


def _forecast(found: Track) -> Any:
    """Times with the expected volume and its 95 % band, until emptiness or a month."""
    use = found.use
    last = next((r for r in reversed(found.readings) if r.volume is not None and r.time is not None), None)
    if use is None or last is None or last.time is None or last.volume is None:
        return None
    ends = [e for e in (use.latest, use.empty_by) if e is not None]
    days = min((min(ends) - last.time) / DAY if ends else 30.0, 30.0)
    t = np.linspace(0.0, max(days, 1e-3), FORECAST_POINTS)
    own = last.volume_std or 0.0
    doubt = 2.0 * np.sqrt(use.day_to_day**2 * t + (use.daily_std * t) ** 2 + own**2)
    middle = last.volume - use.daily * t
    times = [_moment(last.time + DAY * float(day), 0) for day in t]
    return times, np.maximum(middle, 0.0), np.maximum(middle - doubt, 0.0), np.maximum(middle + doubt, 0.0)


def report(found: Track) -> Report:
    """The page: numbers, trend, events, readings that need attention, the last surface."""
    from siloscope.plots import png
    from siloscope.plots.content import height_map

    page = Report("Silo content", _lead(found)).cards(_cards(found))
    page.section("Volume over time", picture(png(trend(found)), "Volume with its 95 % band and the forecast."))
    if found.last is not None and found.last.surface is not None:
        shown = picture(png(height_map(found.last)), "Height map of the last reading, and how sure it is.")
        page.section("The surface now", shown)
    page.section("Refills and withdrawals", _events_table(found))
    attention = [r for r in found.readings if r.status != "ok" or r.quality]
    rows = [(r.name, r.status, ", ".join(r.quality) or (r.reason or "")) for r in attention[:100]]
    if rows:
        page.section("Readings that need attention", table(("Reading", "Status", "Why"), rows))
    return page


def _lead(found: Track) -> str:
    counts = found.counts
    failed = counts["refused"] + counts["unreadable"]
    left_out = f", {failed} without an answer" if failed else ""
    return f"{len(found.readings)} readings{left_out}; volumes with one standard deviation."


def _cards(found: Track) -> list[tuple[str, str]]:
    last = next((r for r in reversed(found.readings) if r.volume is not None), None)
    if last is None:
        return [("no answer", "last reading")]
    cards = [(f"{last.volume:.2f} ± {last.volume_std:.2f} m³", "in the silo")]
    if last.fill_fraction is not None:
        cards.append((f"{100 * last.fill_fraction:.0f} %", "full"))
    if last.mass is not None:
        cards.append((f"{last.mass / 1000.0:.2f} t", "mass"))
    if found.use is not None:
        cards.append((f"{found.use.daily:.2f} m³", "used a day"))
        cards.append((when(found.use.empty_by), "empty by"))
    return cards


def when(time: float | None) -> str:
    """A time as people write it: a date, or hours since the recording's start."""
    if time is None:
        return "not within ten years"
    if time > ABSOLUTE and utc(time) is not None:
        return datetime.fromtimestamp(time, UTC).strftime("%Y-%m-%d %H:%M UTC")
    return f"{time / 3600.0:.1f} h after the start"


def _events_table(found: Track) -> str:
    if not found.events:
        return text("None: the volume did not change by more than its deviations allow to tell.")
    rows = [
        (
            event.kind,
            when(event.start) if event.start is not None else f"reading {event.first}",
            when(event.end) if event.end is not None else f"reading {event.last}",
            f"{event.volume:.3f} ± {event.volume_std:.3f} m³",
            "" if event.mass is None else f"{event.mass:.0f} kg",
        )
        for event in found.events
    ]
    return table(("Event", "From", "To", "Amount", "Mass"), rows)
