"""`track`: the content of many frames as a story: readings, refills and withdrawals, daily use, empty-by date."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from itertools import pairwise
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope import frames as readers
from siloscope.calibration import Calibration
from siloscope.content import Content, measure
from siloscope.errors import InputError, UsageError
from siloscope.frame import Frame
from siloscope.frames import FrameSource

SCHEMA = "siloscope.track/1"

DAY = 86_400.0
"""Seconds."""

ABSOLUTE = 1e8
"""Timestamps beyond this are seconds since 1970; smaller ones count from the recording's start."""

TURN_SIGMAS = 5.0
"""A rise or fall must exceed so many standard deviations of a difference to be an event."""

TURN_SHARE = 0.002
"""And this share of the capacity: what dust, settling and temperature do to a quiet silo."""

FEWEST_DAYS = 2.0
"""Shorter histories tell no spread of the daily use."""

FARTHEST = 3650.0
"""Days beyond which nobody forecasts."""

Pathlike = str | PathLike[str]


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
            "fill_fraction": self.fill_fraction,
            "level_m": self.level,
            "mass_kg": self.mass,
            "mass_std_kg": self.mass_std,
            "coverage": self.coverage,
            "flow_m3_h": self.flow,
            "mass_flow_t_h": self.mass_flow,
            "quality": list(self.quality),
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
            "mass_kg": self.mass,
        }


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

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "daily_m3": self.daily,
            "daily_std_m3": self.daily_std,
            "day_to_day_std_m3": self.day_to_day,
            **{key: getattr(self, key) for key in ("empty_by", "earliest", "latest")},
            **{f"{key}_utc": utc(getattr(self, key)) for key in ("empty_by", "earliest", "latest")},
        }


@dataclass(frozen=True, eq=False)
class Track:
    """The story of a silo's content."""

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

    @property
    def counts(self) -> dict[str, int]:
        """Number of readings by status."""
        return {s: sum(r.status == s for r in self.readings) for s in ("ok", "refused", "unreadable")}

    def to_dict(self) -> dict[str, Any]:
        """The document of ``siloscope track --json`` (schema ``siloscope.track/1``)."""
        return {
            "schema": SCHEMA,
            "status": "ok" if self.counts["ok"] else "refused",
            "reason": None if self.counts["ok"] else _commonest(self.readings),
            "counts": self.counts,
            "capacity_m3": self.capacity,
            "height_datum": self.height_datum,
            "readings": [reading.to_dict() for reading in self.readings],
            "events": [event.to_dict() for event in self.events],
            "use": None if self.use is None else self.use.to_dict(),
            "config": self.config,
        }


def track(
    frames: Iterable[Frame] | FrameSource | Pathlike | Sequence[Pathlike],
    calibration: Calibration | Pathlike,
    *,
    interval: float | None = None,
    start: float | None = None,
    progress: Callable[[Iterable[Any]], Iterable[Any]] | None = None,
    **settings: Any,
) -> Track:
    """Measure many frames of one silo in their order, and tell what happened in it.

    Parameters
    ----------
    frames : files, frame source, or iterable of Frame
        A path or several, what `siloscope.frames.open` gives, or frames.
    calibration : Calibration or path
        Pose and geometry.
    interval : float, optional
        Seconds between frames that have no time of their own.
    start : float, optional
        Time of the first of them, seconds since 1970; 0 where not given.
    progress : callable, optional
        Is given the frames and gives them on, to show how far it has come.
    **settings
        As for `siloscope.measure`: sensor, density, product, datasheet, ...

    Raises
    ------
    InputError
        Where no frame can be read, or the calibration can't be used.
    UsageError
        For settings that can't be.
    """
    if interval is not None and not (math.isfinite(interval) and interval > 0.0):
        raise UsageError(f"interval must be a positive number of seconds, got {interval}")
    silo = calibration if isinstance(calibration, Calibration) else Calibration.load(calibration)
    source = readers.open(frames) if _is_path(frames) else frames  # type: ignore[arg-type]
    clock = _Clock(interval, start)
    moments: list[_Moment] = []
    last: Content | None = None
    for moment, whole in _measured(progress(source) if progress else source, silo, clock, settings):  # type: ignore[arg-type]
        moments.append(moment)
        last = whole if whole.ok else last
    problems = tuple(source.problems) if isinstance(source, FrameSource) else ()
    if not moments:
        raise InputError("no frame could be read; " + (problems[0] if problems else "give at least one"))
    return _told(moments, last, problems)


@dataclass(frozen=True)
class _Clock:
    """Times of frames that have none."""

    interval: float | None
    start: float | None

    def time(self, index: int, own: float | None) -> float | None:
        if own is not None or self.interval is None:
            return own
        return (self.start or 0.0) + index * self.interval


@dataclass(frozen=True, eq=False)
class _Moment:
    """One frame as measured, without its surface."""

    index: int
    time: float | None
    content: Content
    datum: float | None
    """z of the heights' zero."""


def _is_path(frames: Any) -> bool:
    if isinstance(frames, str | PathLike):
        return True
    return isinstance(frames, list | tuple) and bool(frames) and all(isinstance(f, str | PathLike) for f in frames)


def _measured(
    frames: Iterable[Frame], silo: Calibration, clock: _Clock, settings: dict[str, Any]
) -> Iterator[tuple[_Moment, Content]]:
    """Every frame's reading without its surface, to be kept, and with it."""
    before: Content | None = None
    for index, frame in enumerate(frames):
        time = clock.time(index, frame.timestamp)
        try:
            content = measure(frame, silo, previous=before, **settings)
        except InputError as error:
            content = Content("unreadable", message=str(error), source=frame.source)
        datum = None if content.surface is None else content.surface.datum
        bare = replace(content, surface=None)
        before = bare if content.ok else before
        yield _Moment(index, time, bare, datum), content


def _told(moments: list[_Moment], last: Content | None, problems: tuple[str, ...]) -> Track:
    answered = [m for m in moments if m.content.volume is not None]
    events = tuple(_events(answered))
    readings = tuple(_readings(moments))
    unread = tuple(Reading(len(moments) + i, name, None, "unreadable", name) for i, name in enumerate(problems))
    return Track(
        readings + unread,
        events,
        _use(answered, events),
        None if last is None else last.capacity,
        None if last is None else last.height_datum,
        problems,
        last,
        {} if last is None else last.config,
    )


def _readings(moments: list[_Moment]) -> Iterator[Reading]:
    """The rows of the table; where the cone is not known, heights are over the lowest point of the whole story."""
    lowest = max((m.datum for m in moments if m.datum is not None), default=0.0)
    before: _Moment | None = None
    for moment in moments:
        c = moment.content
        lift = 0.0 if moment.datum is None else lowest - moment.datum
        flow = None if before is None else _flow(before, moment)
        tonnes = None if flow is None or c.mass is None or not c.volume else 1e-3 * flow * c.mass / c.volume
        yield Reading(
            moment.index,
            c.source,
            moment.time,
            c.status,
            c.reason if c.status == "refused" else c.message,
            c.volume,
            c.volume_std,
            c.fill_fraction,
            None if c.level.mean is None else c.level.mean + lift,
            c.mass,
            c.mass_std,
            c.coverage,
            flow,
            tonnes,
            tuple(remark.code for remark in c.quality),
        )
        before = moment if c.volume is not None else before


def _flow(before: _Moment, now: _Moment) -> float | None:
    """m³/h between two readings."""
    if before.content.volume is None or now.content.volume is None or before.time is None or now.time is None:
        return None
    hours = (now.time - before.time) / 3600.0
    return (now.content.volume - before.content.volume) / hours if hours > 0.0 else None


def _events(moments: list[_Moment]) -> Iterator[Event]:
    """Rises and falls between the turning points of the volume."""
    if len(moments) < 2:
        return
    volume = np.array([float(m.content.volume or 0.0) for m in moments])
    least = _threshold(moments)
    for first, last in _legs(volume, least):
        first, last = _trimmed(volume, first, last, 0.1 * least)
        change = moments[last].content.change_since(moments[first].content)
        amount, std = change if change is not None else (volume[last] - volume[first], least / TURN_SIGMAS)
        start, end = moments[first], moments[last]
        kind = "refill" if amount > 0.0 else "withdrawal"
        dense = end.content if kind == "refill" else start.content
        mass = None if dense.mass is None or not dense.volume else abs(amount) * dense.mass / dense.volume
        yield Event(kind, start.index, end.index, start.time, end.time, abs(float(amount)), float(std), mass)


def _threshold(moments: list[_Moment]) -> float:
    """Smallest change that is an event."""
    pairs = pairwise(moments)
    changes = [b.content.change_since(a.content) for a, b in pairs]
    std = [change[1] for change in changes if change is not None]
    capacity = moments[-1].content.capacity or 0.0
    return max(TURN_SIGMAS * float(np.median(std)) if std else 0.0, TURN_SHARE * capacity, 1e-9)


def _legs(volume: NDArray[np.float64], least: float) -> Iterator[tuple[int, int]]:
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


def _use(moments: list[_Moment], events: tuple[Event, ...]) -> Use | None:
    """Daily use from the withdrawals, and when it has used up what there is."""
    timed = [m for m in moments if m.time is not None]
    if len(timed) < 2:
        return None
    times = np.array([float(m.time or 0.0) for m in timed])
    volume = np.array([float(m.content.volume or 0.0) for m in timed])
    span = (times[-1] - times[0]) / DAY
    used = _used(times, volume, events)
    if span <= 0.0 or used[-1] <= 0.0:
        return None
    daily = float(used[-1]) / span
    whole = int(span)
    spread = daily
    if span >= FEWEST_DAYS:
        ends = times[0] + DAY * np.arange(whole + 1)
        spread = float(np.std(np.diff(np.interp(ends, times, used)), ddof=1)) if whole > 1 else daily
    mean_std = spread / math.sqrt(max(span, 1.0))
    own = float(timed[-1].content.volume_std or 0.0)
    dates = [_empty(volume[-1], own, daily, spread, mean_std, sigmas) for sigmas in (0.0, 2.0, -2.0)]
    empty, earliest, latest = (None if days is None else float(times[-1] + DAY * days) for days in dates)
    return Use(daily, mean_std, spread, empty, earliest, latest)


def _used(times: NDArray[np.float64], volume: NDArray[np.float64], events: tuple[Event, ...]) -> NDArray[np.float64]:
    """Volume taken out since the beginning: the falls, with the refills left out."""
    change = np.diff(volume)
    filling = np.zeros(len(change), bool)
    for event in events:
        if event.kind == "refill" and event.start is not None and event.end is not None:
            filling |= (times[:-1] >= event.start) & (times[1:] <= event.end)
    taken: NDArray[np.float64] = np.concatenate([[0.0], np.cumsum(np.where(filling, 0.0, -change))])
    return np.maximum.accumulate(taken)


def _empty(volume: float, std: float, daily: float, spread: float, mean_std: float, sigmas: float) -> float | None:
    """Days until `daily t + sigmas √(spread² t + mean_std² t² + std²)` reaches the volume; None beyond ten years."""

    def left(t: float) -> float:
        doubt = math.sqrt(spread**2 * t + (mean_std * t) ** 2 + std**2)
        return volume - daily * t - sigmas * doubt

    low, high = 0.0, FARTHEST
    if left(low) <= 0.0:
        return 0.0
    if left(high) > 0.0:
        return None
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if left(middle) > 0.0 else (low, middle)
    return high


def _commonest(readings: Sequence[Reading]) -> str | None:
    reasons = [reading.reason for reading in readings if reading.reason]
    return max(set(reasons), key=reasons.count) if reasons else None


def utc(time: float | None) -> str | None:
    """RFC 3339 of seconds since 1970; None for times that only count from a recording's start."""
    if time is None or not ABSOLUTE < time < 2.5e11:
        return None
    return datetime.fromtimestamp(time, UTC).isoformat(timespec="seconds").replace("+00:00", "Z")
