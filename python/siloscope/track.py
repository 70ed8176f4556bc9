"""`track`: the content of many frames as a story: readings, refills and withdrawals, daily use, empty-by date."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any

from siloscope.content import Content
from siloscope.errors import InputError, UsageError
from siloscope.io import FrameSource
from siloscope.io.given import given_frames
from siloscope.measure import measure
from siloscope.tracking.events import events
from siloscope.tracking.story import Moment
from siloscope.tracking.use import use
from siloscope.types.calibration import Calibration
from siloscope.types.frame import Frame
from siloscope.types.track import Reading, Track

TOGETHER = 120.0
"""Seconds between two frames that still tell whether the content moves while they are taken."""

LONGEST_INTERVAL = 1e7
"""Seconds between frames without a time of their own: some months."""

Pathlike = str | PathLike[str]


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
        A path or several, what `siloscope.open` gives, or frames.
    calibration : Calibration or path
        Pose and geometry.
    interval : float, optional
        Seconds between frames that have no time of their own, at most `LONGEST_INTERVAL`.
    start : float, optional
        Time of the first of them, seconds since 1970, with `interval`; 0 where not given.
    progress : callable, optional
        Is given the frames and gives them on, to show how far it has come.
    **settings
        As for `siloscope.measure`: sensor, density, product, datasheet, ...

    Raises
    ------
    InputError
        Where no frame can be used, or the calibration can't.
    UsageError
        For settings that can't be.
    """
    if interval is not None and not 0.0 < interval <= LONGEST_INTERVAL:
        raise UsageError(f"interval must be above 0 and at most {LONGEST_INTERVAL:g} s, got {interval}")
    if start is not None and (interval is None or not math.isfinite(start)):
        raise UsageError("start needs an interval: the frames after the first are that many seconds apart")
    silo = calibration if isinstance(calibration, Calibration) else Calibration.load(calibration)
    source = given_frames(frames)
    clock = _Clock(interval, start)
    moments: list[Moment] = []
    last: Content | None = None
    for moment, whole in _measured(progress(source) if progress else source, silo, clock, settings):
        moments.append(moment)
        last = whole if whole.ok else last
    problems = tuple(source.problems) if isinstance(source, FrameSource) else ()
    if all(moment.content.status == "unreadable" for moment in moments):
        causes = (*(str(moment.content.message) for moment in moments), *problems, "give at least one")
        raise InputError(f"no frame could be used; {causes[0]}")
    return track_of(moments, last, problems)


@dataclass(frozen=True)
class _Clock:
    """Times of frames that have none."""

    interval: float | None
    start: float | None

    def time(self, index: int, own: float | None) -> float | None:
        if own is not None or self.interval is None:
            return own
        return (self.start or 0.0) + index * self.interval


def _measured(
    frames: Iterable[Frame], silo: Calibration, clock: _Clock, settings: dict[str, Any]
) -> Iterator[tuple[Moment, Content]]:
    """Every frame's reading without its surface, to be kept, and with it."""
    before: Moment | None = None
    for index, frame in enumerate(frames):
        time = clock.time(index, frame.timestamp)
        previous = before.content if before is not None and _together(before.time, time) else None
        try:
            content = measure(frame, silo, previous=previous, **settings)
        except InputError as error:
            content = Content("unreadable", message=str(error), source=frame.source)
        datum = None if content.surface is None else content.surface.datum
        moment = Moment(index, time, replace(content, surface=None), datum)
        before = moment if content.ok else before
        yield moment, content


def _together(before: float | None, now: float | None) -> bool:
    return before is not None and now is not None and 0.0 <= now - before <= TOGETHER


def track_of(moments: Sequence[Moment], last: Content | None = None, problems: tuple[str, ...] = ()) -> Track:
    """The story of readings in their order; `last` is the newest one with its surface, `problems` what was not read."""
    answered = [m for m in moments if m.content.volume is not None]
    happened = tuple(events(answered))
    readings = tuple(_readings(moments))
    unread = tuple(Reading(len(moments) + i, name, None, "unreadable", name) for i, name in enumerate(problems))
    return Track(
        readings + unread,
        happened,
        use(answered, happened),
        None if last is None else last.capacity,
        None if last is None else last.height_datum,
        problems,
        last,
        {} if last is None else last.config,
    )


def _readings(moments: Sequence[Moment]) -> Iterator[Reading]:
    """The rows of the table; where the cone is not known, heights are over the lowest point of the whole story."""
    lowest = max((m.datum for m in moments if m.datum is not None), default=0.0)
    before: Moment | None = None
    for moment in moments:
        c = moment.content
        lift = 0.0 if moment.datum is None else lowest - moment.datum
        flow = None if before is None else _flow(before, moment)
        dense = c if c.volume or before is None else before.content
        tonnes = (
            None if flow is None or dense.mass is None or not dense.volume else 1e-3 * flow * dense.mass / dense.volume
        )
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


def _flow(before: Moment, now: Moment) -> float | None:
    """m³/h between two readings."""
    if before.content.volume is None or now.content.volume is None or before.time is None or now.time is None:
        return None
    hours = (now.time - before.time) / 3600.0
    return (now.content.volume - before.content.volume) / hours if hours > 0.0 else None
