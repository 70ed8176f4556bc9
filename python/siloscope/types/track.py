"""The story of a silo's content: its readings, what happened between them, and when it will be empty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib import import_module
from typing import Any

from siloscope.errors import InputError
from siloscope.schema import TRACK
from siloscope.types.by_value import ByValue
from siloscope.types.content import Content

DAY = 86_400.0
"""Seconds."""


ABSOLUTE = 1e8
"""Timestamps beyond this are seconds since 1970; smaller ones count from the recording's start."""


@dataclass(frozen=True)
class Reading:
    """One frame of the story. Volumes in m³, masses in kg, heights in m, times in s."""

    index: int
    name: str
    time: float | None
    status: str
    """"ok", "refused" or "unreadable"."""
    reason: str | None = None
    volume: float | None = None
    volume_std: float | None = None
    fill_fraction: float | None = None
    level: float | None = None
    """Mean height of the surface over the datum of the whole story."""
    mass: float | None = None
    mass_std: float | None = None
    coverage: float | None = None
    flow: float | None = None
    """Change since the reading before, m³/h; negative when emptying."""
    mass_flow: float | None = None
    """The same in t/h."""
    quality: tuple[str, ...] = ()
    ullage: float | None = None
    """Free space, m³."""
    ullage_std: float | None = None
    own_std: float | None = None
    """The part of the deviation that differs from reading to reading, m³ (`Content.own_std`)."""
    density: float | None = None
    """kg/m³."""
    datum: float | None = None
    """z of the height's zero, m."""
    digest: str | None = None
    """Hash of the frame's measurements, by which a frame is known again."""

    def to_dict(self) -> dict[str, Any]:
        """Plain data with the units in the names."""
        return {
            "index": self.index,
            "name": self.name,
            "time": self.time,
            "time_utc": utc(self.time),
            "status": self.status,
            "reason": self.reason,
            "volume_m3": self.volume,
            "volume_std_m3": self.volume_std,
            "ullage_m3": self.ullage,
            "ullage_std_m3": self.ullage_std,
            "own_std_m3": self.own_std,
            "fill_fraction": self.fill_fraction,
            "level_m": self.level,
            "mass_kg": self.mass,
            "mass_std_kg": self.mass_std,
            "coverage": self.coverage,
            "flow_m3_h": self.flow,
            "mass_flow_t_h": self.mass_flow,
            "density_kg_m3": self.density,
            "datum_m": self.datum,
            "quality": list(self.quality),
            "digest": self.digest,
        }


@dataclass(frozen=True)
class Event:
    """A refill or a withdrawal, from one reading to another."""

    kind: str
    """"refill" or "withdrawal"."""
    first: int
    """Index of the reading at its beginning."""
    last: int
    """Index of the reading at its end."""
    start: float | None
    end: float | None
    volume: float
    """Amount, m³, positive for both kinds."""
    volume_std: float
    mass: float | None = None
    """Amount, kg."""
    own_std: float | None = None
    """The part of the deviation that is this event's alone, m³; the rest all events of a calibration share."""

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "kind": self.kind,
            "first": self.first,
            "last": self.last,
            "start": self.start,
            "start_utc": utc(self.start),
            "end": self.end,
            "end_utc": utc(self.end),
            "volume_m3": self.volume,
            "volume_std_m3": self.volume_std,
            "own_std_m3": self.own_std,
            "mass_kg": self.mass,
        }


FORECASTS = ("empty_by", "earliest", "latest", "lowest_by")
"""Times of `Use`."""


@dataclass(frozen=True)
class Use:
    """How much is used a day, and until when it lasts."""

    daily: float
    """m³ a day."""
    daily_std: float
    """Standard deviation of that mean."""
    day_to_day: float
    """Standard deviation of one day's use."""
    empty_by: float | None
    """Time of emptiness if use goes on so; None beyond ten years."""
    earliest: float | None
    """Beginning of its 95 % band."""
    latest: float | None
    """End of its 95 % band."""
    lowest_by: float | None = None
    """Where the bottom is not known: when the content lies as low as it was ever seen, and not before it is empty."""

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "daily_m3": self.daily,
            "daily_std_m3": self.daily_std,
            "day_to_day_std_m3": self.day_to_day,
            **{key: getattr(self, key) for key in FORECASTS},
            **{f"{key}_utc": utc(getattr(self, key)) for key in FORECASTS},
        }


@dataclass(frozen=True, eq=False, repr=False)
class Track(ByValue):
    """The whole story."""

    readings: tuple[Reading, ...]
    events: tuple[Event, ...] = ()
    use: Use | None = None
    """None where the frames have no times, or nothing was withdrawn."""
    capacity: float | None = None
    height_datum: str | None = None
    problems: tuple[str, ...] = ()
    """Files that can't be read."""
    last: Content | None = None
    """The last reading with an answer, with its surface."""
    config: dict[str, Any] = field(default_factory=dict)
    basis: str = "volume"
    """What changes are counted by: "volume", or "ullage" where the bottom is not known."""
    gaps: tuple[tuple[float, float], ...] = ()
    """Beginnings and ends of stretches without a reading, s."""
    name: str | None = None
    """The silo's."""

    def to_pandas(self) -> Any:
        """The readings as a pandas data frame, a row each, with the time as its index where all have one.

        Raises `InputError` where pandas is not installed.
        """
        try:
            pandas = import_module("pandas")
        except ImportError:
            raise InputError("a data frame needs pandas: pip install pandas; to_dict() does without") from None
        table = pandas.DataFrame([reading.to_dict() for reading in self.readings])
        if not self.readings or any(utc(reading.time) is None for reading in self.readings):
            return table
        times = pandas.to_datetime([reading.time for reading in self.readings], unit="s", utc=True)
        return table.drop(columns="time_utc").set_index(times.rename("time_utc"))

    @property
    def counts(self) -> dict[str, int]:
        """Number of readings by status."""
        return {s: sum(r.status == s for r in self.readings) for s in ("ok", "refused", "unreadable")}

    def to_dict(self) -> dict[str, Any]:
        """The document of ``siloscope track --json`` (schema ``siloscope.track/1``)."""
        return {
            "schema": TRACK,
            "status": "ok" if self.counts["ok"] else "refused",
            "reason": None if self.counts["ok"] else _commonest(self.readings),
            "counts": self.counts,
            "name": self.name,
            "basis": self.basis,
            "gaps": [{"start": a, "end": b, "start_utc": utc(a), "end_utc": utc(b)} for a, b in self.gaps],
            "capacity_m3": self.capacity,
            "height_datum": self.height_datum,
            "readings": [reading.to_dict() for reading in self.readings],
            "events": [event.to_dict() for event in self.events],
            "use": None if self.use is None else self.use.to_dict(),
            "config": self.config,
        }


def _commonest(readings: Sequence[Reading]) -> str | None:
    reasons = [reading.reason for reading in readings if reading.reason]
    return max(set(reasons), key=reasons.count) if reasons else None


def utc(time: float | None) -> str | None:
    """RFC 3339 of seconds since 1970; None for times that only count from a recording's start."""
    if time is None or not ABSOLUTE < time < 2.5e11:
        return None
    return datetime.fromtimestamp(time, UTC).isoformat(timespec="seconds").replace("+00:00", "Z")
