"""`track`: the content of many frames as a story: readings, refills and withdrawals, daily use, empty-by date."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from hashlib import blake2b
from itertools import islice
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from siloscope.content.reading import with_movement
from siloscope.errors import InputError, UsageError
from siloscope.io import FrameSource
from siloscope.io.given import given_frames
from siloscope.measure import measure
from siloscope.tracking.clock import Clock
from siloscope.tracking.story import reading_of, track_of
from siloscope.types.calibration import Calibration
from siloscope.types.content import Content
from siloscope.types.frame import Frame
from siloscope.types.track import Reading, Track

MOST_JOBS = 256

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
    readings, last = _measured(
        progress(source) if progress else source, silo, Clock(interval, start), settings, earlier, jobs
    )
    problems = tuple(source.problems) if isinstance(source, FrameSource) else ()
    if all(reading.status == "unreadable" for reading in readings):
        causes = (*(str(reading.reason) for reading in readings), *problems, "give at least one")
        raise InputError(f"no frame could be used; {causes[0]}")
    return track_of(in_order([*earlier, *readings]), last, problems, name=name)


def stored(track: Track | Pathlike) -> tuple[Reading, ...]:
    """The readings of an earlier track, or of the file that it wrote.

    Raises
    ------
    InputError
        For a file that is no track.
    """
    if isinstance(track, Track):
        return tuple(reading for reading in track.readings if reading.status != "unreadable")
    from siloscope.schema.track import read

    return tuple(Reading(**entry) for entry in read(Path(track)) if entry["status"] != "unreadable")


def in_order(readings: Sequence[Reading]) -> list[Reading]:
    """Readings by their time where all have one, else as they came; numbered anew."""
    if all(reading.time is not None for reading in readings):
        readings = sorted(readings, key=lambda reading: reading.time or 0.0)
    return [replace(reading, index=index) for index, reading in enumerate(readings)]


def _measured(
    frames: Iterable[Frame],
    silo: Calibration,
    clock: Clock,
    settings: dict[str, Any],
    earlier: Sequence[Reading],
    jobs: int,
) -> tuple[list[Reading], Content | None]:
    """New readings, each frame once, and the last answer with its surface."""
    seen = {reading.digest for reading in earlier if reading.digest is not None}
    readings: list[Reading] = []
    before: tuple[float | None, Content] | None = None
    last: Content | None = None
    for index, (frame, digest, content) in enumerate(_contents(frames, silo, settings, jobs)):
        if digest in seen:
            continue
        seen.add(digest)
        time = clock.time(index, frame.timestamp, frame.source)
        if before is not None and _together(before[0], time):
            content = with_movement(content, before[1])
        readings.append(reading_of(len(earlier) + len(readings), time, content, digest))
        if content.ok:
            before, last = (time, replace(content, surface=None)), content
    return readings, last


def _contents(
    frames: Iterable[Frame], silo: Calibration, settings: dict[str, Any], jobs: int
) -> Iterator[tuple[Frame, str, Content]]:
    """Frames with their hash and content in their order, some measured at a time."""

    def one(frame: Frame) -> tuple[Frame, str, Content]:
        try:
            content = measure(frame, silo, **settings)
        except InputError as error:
            content = Content("unreadable", message=str(error), source=frame.source)
        kept = Frame(timestamp=frame.timestamp, source=frame.source)
        return kept, digest_of(frame), content

    if jobs == 1:
        yield from map(one, frames)
        return
    with ThreadPoolExecutor(jobs) as pool:
        for some in batched(frames, 2 * jobs):
            yield from pool.map(one, some)


def batched(frames: Iterable[Frame], size: int) -> Iterator[tuple[Frame, ...]]:
    """Frames in tuples of a size."""
    source = iter(frames)
    while some := tuple(islice(source, size)):
        yield some


def digest_of(frame: Frame) -> str:
    """Hash of a frame's measurements, whatever its file is called."""
    values = frame.depth if frame.depth is not None else frame.points
    return blake2b(b"" if values is None else np.ascontiguousarray(values).tobytes(), digest_size=16).hexdigest()


def _together(before: float | None, now: float | None) -> bool:
    return before is not None and now is not None and 0.0 <= now - before <= TOGETHER
