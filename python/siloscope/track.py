"""`track`: the content of many frames as a story: readings, refills and withdrawals, daily use, empty-by date."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any

from siloscope.errors import InputError, UsageError
from siloscope.io import FrameSource
from siloscope.io.given import given_frames
from siloscope.measure import measure
from siloscope.tracking.story import Moment, track_of
from siloscope.types.calibration import Calibration
from siloscope.types.content import Content
from siloscope.types.frame import Frame
from siloscope.types.track import Track

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
