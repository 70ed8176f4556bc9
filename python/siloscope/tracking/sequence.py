"""Frames in their order to readings, each frame once, and readings that are already there."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import islice
from os import PathLike
from pathlib import Path

from siloscope.errors import InputError
from siloscope.tracking.clock import Clock
from siloscope.tracking.story import reading_of
from siloscope.types.content import Content, with_movement
from siloscope.types.frame import Frame
from siloscope.types.track import Reading, Track

Measure = Callable[[Frame], Content]
"""A frame's content; raises `InputError` where it can't be used."""

TOGETHER = 120.0
"""Seconds between two frames that still tell whether the content moves while they are taken."""


def stored(track: Track | str | PathLike[str]) -> tuple[Reading, ...]:
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


def measured(
    frames: Iterable[Frame],
    measure: Measure,
    clock: Clock,
    earlier: Sequence[Reading],
    jobs: int,
) -> tuple[list[Reading], Content | None]:
    """New readings, each frame once, and the last answer with its surface."""
    seen = {reading.digest for reading in earlier if reading.digest is not None}
    readings: list[Reading] = []
    before: tuple[float | None, Content] | None = None
    last: Content | None = None
    for index, (frame, digest, content) in enumerate(_contents(frames, measure, jobs)):
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


def _contents(frames: Iterable[Frame], measure: Measure, jobs: int) -> Iterator[tuple[Frame, str, Content]]:
    """Frames with their hash and content in their order, some measured at a time."""

    def one(frame: Frame) -> tuple[Frame, str, Content]:
        try:
            content = measure(frame)
        except InputError as error:
            content = Content("unreadable", message=str(error), source=frame.source)
        kept = Frame(timestamp=frame.timestamp, source=frame.source)
        return kept, frame.digest, content

    if jobs == 1:
        yield from map(one, frames)
        return
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(jobs) as pool:
        for some in batched(frames, 2 * jobs):
            yield from pool.map(one, some)


def batched(frames: Iterable[Frame], size: int) -> Iterator[tuple[Frame, ...]]:
    """Frames in tuples of a size."""
    source = iter(frames)
    while some := tuple(islice(source, size)):
        yield some


def _together(before: float | None, now: float | None) -> bool:
    return before is not None and now is not None and 0.0 <= now - before <= TOGETHER
