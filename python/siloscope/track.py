"""`track`: the content of many frames as a story: readings, refills and withdrawals, daily use, empty-by date."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from os import PathLike
from typing import Any

from siloscope.errors import InputError, UsageError
from siloscope.io import FrameSource
from siloscope.io.given import given_frames
from siloscope.measure import measure
from siloscope.tracking.clock import Clock
from siloscope.tracking.sequence import in_order, measured, stored
from siloscope.tracking.story import track_of
from siloscope.types.calibration import Calibration
from siloscope.types.frame import Frame
from siloscope.types.track import Track

MOST_JOBS = 256


LONGEST_INTERVAL = 1e7
"""Seconds between frames without a time of their own: some months."""

Pathlike = str | PathLike[str]


def track(
    frames: Iterable[Frame] | FrameSource | Pathlike | Sequence[Pathlike],
    calibration: Calibration | Pathlike,
    *,
    interval: float | None = None,
    start: float | None = None,
    continue_from: Track | Pathlike | None = None,
    jobs: int = 1,
    name: str | None = None,
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
        Seconds between frames that have a time neither of their own nor in their name, at most `LONGEST_INTERVAL`.
    start : float, optional
        Time of the first of them, seconds since 1970, with `interval`; 0 where not given.
    continue_from : Track or path, optional
        An earlier track of the same silo (``track.json``): its readings are kept; a frame in it is not counted again.
    jobs : int
        Frames measured at the same time.
    name : str, optional
        The silo's, for the report.
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
    if not 1 <= jobs <= MOST_JOBS:
        raise UsageError(f"jobs {jobs} is not between 1 and {MOST_JOBS}; give the number of frames at a time")
    silo = calibration if isinstance(calibration, Calibration) else Calibration.load(calibration)
    earlier = () if continue_from is None else stored(continue_from)
    source = given_frames(frames)
    shown = progress(source) if progress else source
    one = partial(measure, calibration=silo, **settings)
    readings, last = measured(shown, one, Clock(interval, start), earlier, jobs)
    problems = tuple(source.problems) if isinstance(source, FrameSource) else ()
    if all(reading.status == "unreadable" for reading in readings):
        causes = (*(str(reading.reason) for reading in readings), *problems, "give at least one")
        raise InputError(f"no frame could be used; {causes[0]}")
    return track_of(in_order([*earlier, *readings]), last, problems, name=name)
