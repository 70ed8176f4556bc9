"""Readings of a shard's frames: each measured by itself, then told as a story within the shard."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

from siloscope import sensors
from siloscope.content.capacity import Strapping
from siloscope.content.density import choose
from siloscope.content.knowledge import know
from siloscope.content.silo_content import SiloContent
from siloscope.errors import InputError
from siloscope.fleet.reading import StoredFrame
from siloscope.fleet.settings import Table, with_files
from siloscope.measure import measure
from siloscope.tracking.sequence import TOGETHER
from siloscope.tracking.story import reading_of, track_of
from siloscope.types.calibration import Calibration
from siloscope.types.content import Content, with_movement
from siloscope.types.frame import Frame
from siloscope.types.track import Event, Reading
from siloscope.vessel.floor import STEEPEST_REPOSE
from siloscope.vessel.vessel import given

Measure = Callable[[Frame], Content]

_LENGTHS = ("diameter", "cylinder", "cone", "bottom", "outlet_diameter", "outlet_length")


@dataclass(frozen=True, eq=False)
class Measured:
    """The readings of a shard in their order, each with its frame's hash and its content (None: unreadable)."""

    readings: tuple[Reading, ...]
    hashes: tuple[str, ...]
    contents: tuple[Content | None, ...]
    events: tuple[Event, ...]


@contextmanager
def measurer(silo: Calibration, table: Table) -> Iterator[Measure]:
    """`siloscope.measure` with a silo's calibration and settings, which are worked out once."""
    with with_files(table) as settings:
        if "vessel" in settings and given(settings["vessel"], None).outline is not None:
            yield lambda frame: measure(frame, silo, **settings)
            return
        yield _prepared(silo, settings).measure


def _prepared(silo: Calibration, settings: dict[str, Any]) -> SiloContent:
    lengths = {name: settings[name] for name in _LENGTHS if name in settings}
    about = given(settings.get("vessel"), settings.get("top"), **lengths)
    profile = sensors.load(settings["sensor"]) if "sensor" in settings else None
    density = choose(*(settings.get(name) for name in ("density", "density_std", "product", "test_weight")))
    steepest = STEEPEST_REPOSE if density is None else density.steepest
    known = know(silo, profile, about.sheet, about.top, about.sheet.diameter, steepest)
    strapping = Strapping.read(settings["strapping"]) if "strapping" in settings else None
    return SiloContent(silo, about, known, profile, strapping, density, settings.get("moisture"))


def measured(frames: Iterable[StoredFrame], one: Measure) -> Measured:
    """The story of a shard's frames."""
    rows: list[tuple[StoredFrame, Content]] = []
    before: tuple[float | None, Content] | None = None
    for stored in frames:
        content = _content(stored, one)
        if before is not None and _together(before[0], stored.time):
            content = with_movement(content, before[1])
        if content.ok:
            before = stored.time, replace(content, surface=None)
        rows.append((replace(stored, frame=None), _slim(content)))
    return _told(rows)


def refused(frames: Iterable[StoredFrame], calibration: Calibration) -> Measured:
    """Readings without an answer, because the silo's own calibration has none."""
    why = f"the calibration has no answer: {calibration.message}"
    content = Content("refused", "no-calibration", why)
    return _told([(stored, replace(content, source=stored.source)) for stored in frames])


def _content(stored: StoredFrame, one: Measure) -> Content:
    if stored.frame is None:
        return Content("unreadable", message=stored.problem, source=stored.source)
    try:
        return one(stored.frame)
    except InputError as error:
        return Content("unreadable", message=str(error), source=stored.source)


def _slim(content: Content) -> Content:
    """Without the maps, which a thousand readings need not hold; the datum of the heights stays."""
    surface = content.surface
    return content if surface is None else replace(content, surface=_Datum(surface.datum))  # type: ignore[arg-type]


@dataclass(frozen=True)
class _Datum:
    """What a reading takes of a surface."""

    datum: float


def _told(rows: list[tuple[StoredFrame, Content]]) -> Measured:
    """By their time where all have one, else as they were stored."""
    if all(stored.time is not None for stored, _ in rows):
        rows = sorted(rows, key=lambda row: row[0].time or 0.0)
    readings = [reading_of(i, stored.time, content, stored.sha256) for i, (stored, content) in enumerate(rows)]
    capacity = next((content.capacity for _, content in reversed(rows) if content.ok), None)
    story = track_of(readings, capacity=capacity)
    contents = tuple(None if content.status == "unreadable" else content for _, content in rows)
    return Measured(story.readings, tuple(stored.sha256 for stored, _ in rows), contents, story.events)


def _together(before: float | None, now: float | None) -> bool:
    return before is not None and now is not None and 0.0 <= now - before <= TOGETHER
