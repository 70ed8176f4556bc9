"""A story as a picture and a page, and everything that goes into a folder."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from siloscope.reporting.renewal import without_older
from siloscope.reporting.report import Report, picture, table, text
from siloscope.schema import documents
from siloscope.tracking.tables import write_csv, write_jsonl, write_parquet
from siloscope.types.track import ABSOLUTE, DAY, Event, Reading, Track, utc
from siloscope.wording import with_std

FORECAST_POINTS = 60

LONGEST = 30.0
"""Days that a forecast is drawn."""


def write_track(directory: Path, found: Track, parquet: bool = False) -> list[Path]:
    """Writes ``track.json``, ``readings.csv``, ``readings.jsonl``, ``trend.png``, ``report.html`` (and Parquet).

    Raises `OSError` where the directory can't be written, `UsageError` for Parquet without pyarrow.
    """
    from siloscope.reporting.plots import save

    directory.mkdir(parents=True, exist_ok=True)
    document = documents.write(directory / "track.json", found.to_dict())
    written = [document, write_csv(directory / "readings.csv", found), write_jsonl(directory / "readings.jsonl", found)]
    if parquet:
        written.append(write_parquet(directory / "readings.parquet", found))
    written.append(save(trend(found), directory / "trend.png"))
    return without_older(directory, [*written, report(found).write(directory / "report.html")], ["readings.parquet"])


def trend(found: Track) -> Any:
    """The picture of the story: the volume, or the level where nobody knows the floor."""
    from siloscope.reporting.plots.trend import trend as drawn

    shown = [r for r in found.readings if r.status != "unreadable"]
    place, label = _axis(shown)
    by_level = all(r.volume is None for r in shown) and any(r.level is not None for r in shown)
    values = [r.level if by_level else r.volume for r in shown]
    return drawn(
        [place(r.time, r.index) for r in shown],
        np.array([np.nan if v is None else v for v in values]),
        np.array([np.nan if r.volume_std is None else r.volume_std for r in shown]),
        [(place(e.start, e.first), place(e.end, e.last), _signed(e)) for e in found.events],
        _forecast(found, place),
        None if by_level else found.capacity,
        label,
        "level (m)" if by_level else "volume (m³)",
    )


def _axis(shown: list[Reading]) -> tuple[Callable[[float | None, int], Any], str]:
    """Where a reading is drawn: dates if all have them, else hours, else the reading's number."""
    if shown and all(utc(r.time) is not None for r in shown):
        return lambda time, _: datetime.fromtimestamp(time or 0.0, UTC), ""
    if shown and all(r.time is not None for r in shown):
        return lambda time, _: (time or 0.0) / 3600.0, "time (h)"
    return lambda _, index: float(index), "reading"


def _signed(event: Event) -> float:
    return event.volume if event.kind == "refill" else -event.volume


def _forecast(found: Track, place: Callable[[float | None, int], Any]) -> Any:
    """Times with the expected volume and its 95 % band, until the band's end or a month."""
    use, last = found.use, _last(found)
    if use is None or last is None or last.time is None or last.volume is None:
        return None
    end = use.latest if use.latest is not None else use.empty_by
    days = min(LONGEST if end is None else (end - last.time) / DAY, LONGEST)
    t = np.linspace(0.0, max(days, 1e-3), FORECAST_POINTS)
    own = last.volume_std or 0.0
    doubt = 2.0 * np.sqrt(use.day_to_day**2 * t + (use.daily_std * t) ** 2 + own**2)
    middle = last.volume - use.daily * t
    times = [place(last.time + DAY * float(day), 0) for day in t]
    shown = np.where(middle >= 0.0, middle, np.nan)
    return times, shown, np.maximum(middle - doubt, 0.0), np.maximum(middle + doubt, 0.0)


def _last(found: Track) -> Reading | None:
    """The last reading with a volume."""
    return next((r for r in reversed(found.readings) if r.volume is not None), None)


def report(found: Track) -> Report:
    """The page: numbers, trend, events, readings that need attention, the last surface."""
    from siloscope.reporting.plots import png
    from siloscope.reporting.plots.content import height_map

    page = Report(found.name or "Silo content", _lead(found)).cards(_cards(found))
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
    last = next((r.time for r in reversed(found.readings) if utc(r.time) is not None), None)
    until = "" if last is None else f" until {when(last)}"
    missing = f" {len(found.gaps)} stretches without readings." if found.gaps else ""
    counted = "" if found.basis == "volume" else " The bottom is not known: changes are those of the free space."
    return f"{len(found.readings)} readings{until}{left_out}; amounts with one standard deviation.{missing}{counted}"


def _cards(found: Track) -> list[tuple[str, str]]:
    last = _last(found)
    if last is None:
        return [("no answer", "last reading")]
    cards = [(with_std(last.volume, last.volume_std, 1.0, " m³"), "in the silo")]
    if last.fill_fraction is not None:
        cards.append((f"{100 * last.fill_fraction:.0f} %", "full"))
    if last.mass is not None:
        cards.append((f"{last.mass / 1000.0:.2f} t", "mass"))
    if found.use is not None:
        cards.append((with_std(found.use.daily, found.use.daily_std, 1.0, " m³"), "used a day"))
        cards.append((when(found.use.empty_by), "empty by"))
    return cards


def when(time: float | None) -> str:
    """A time as people write it: a date, or hours since the recording's start."""
    if time is None:
        return "not within ten years"
    if time > ABSOLUTE and utc(time) is not None:
        return datetime.fromtimestamp(time, UTC).strftime("%Y-%m-%d %H:%M UTC")
    return f"{timedelta(seconds=round(time))} after the start"


def moment(time: float | None, index: int) -> str:
    """A reading's time, or its number where it has none."""
    return f"reading {index}" if time is None else when(time)


def _events_table(found: Track) -> str:
    if not found.events:
        return text("None: the volume did not change by more than its deviations allow to tell.")
    rows = [
        (
            event.kind,
            moment(event.start, event.first),
            moment(event.end, event.last),
            with_std(event.volume, event.volume_std, 1.0, " m³"),
            "" if event.mass is None else f"{event.mass:.0f} kg",
        )
        for event in found.events
    ]
    return table(("Event", "From", "To", "Amount", "Mass"), rows)
