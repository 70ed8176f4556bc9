"""Readings, surfaces, events and forecasts."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, Select, delete, exists, func, insert, or_, select, update

from siloscope.monitor.clock import SUSPECT
from siloscope.monitor.store import changes
from siloscope.monitor.store.rows import Record
from siloscope.monitor.store.schema import event, forecast, reading, run, surface


@dataclass(frozen=True)
class Span:
    """Times from (included) to (excluded), µs; None is open."""

    since: int | None = None
    until: int | None = None
    run: int | None = None
    """Of this run alone, whether its readings still count or not."""


def current(silo: str, span: Span = Span(), *, suspect: bool = False) -> list[Any]:
    """Conditions of a silo's readings that no later run replaced; those of a wrong clock only where asked for."""
    chosen = [reading.c.silo == silo]
    chosen.append(reading.c.superseded.is_(None) if span.run is None else reading.c.run == span.run)
    if not suspect:
        chosen.append(reading.c.clock != SUSPECT)
    if span.since is not None:
        chosen.append(reading.c.time >= span.since)
    if span.until is not None:
        chosen.append(reading.c.time < span.until)
    return chosen


def last(connection: Connection, silo: str, *, answered: bool, until: int | None = None) -> Record | None:
    """The newest reading, or the newest one with an answer."""
    chosen = current(silo, Span(until=until))
    if answered:
        chosen.append(reading.c.status == "ok")
    return connection.execute(select(reading).where(*chosen).order_by(reading.c.time.desc()).limit(1)).one_or_none()


def get(connection: Connection, reading_id: int) -> Record | None:
    """A reading."""
    return connection.execute(select(reading).where(reading.c.id == reading_id)).one_or_none()


def page(connection: Connection, silo: str, span: Span, cursor: tuple[int, int] | None, count: int) -> Sequence[Record]:
    """Readings in the order of their times, those of suspect clocks too, behind a cursor (time, id)."""
    chosen = current(silo, span, suspect=True)
    if cursor is not None:
        time, number = cursor
        chosen.append((reading.c.time > time) | ((reading.c.time == time) & (reading.c.id > number)))
    return connection.execute(select(reading).where(*chosen).order_by(reading.c.time, reading.c.id).limit(count)).all()


def every(connection: Connection, silo: str, span: Span) -> Iterator[Record]:
    """All of them, without holding them."""
    wanted = select(reading).where(*current(silo, span, suspect=True)).order_by(reading.c.time, reading.c.id)
    yield from connection.execution_options(yield_per=2000).execute(wanted)


def buckets(connection: Connection, silo: str, span: Span, width: int) -> Sequence[Record]:
    """Means and extremes of the answered readings in stretches of a width (µs) from a span's beginning; stretches
    without any are left out."""
    number = (reading.c.time - span.since) // width
    chosen = [*current(silo, span), reading.c.status == "ok"]
    columns = [
        number.label("bucket"),
        func.count().label("number"),
        *(func.avg(reading.c[name]).label(name) for name in ("volume", "volume_std", "fill", "mass")),
        func.min(reading.c.volume).label("volume_min"),
        func.max(reading.c.volume).label("volume_max"),
        func.min(reading.c.time).label("first"),
        func.max(reading.c.time).label("last"),
    ]
    return connection.execute(select(*columns).where(*chosen).group_by("bucket").order_by("bucket")).all()


def series(connection: Connection, silo: str, span: Span) -> Sequence[Record]:
    """What a story is told from: time, volume, ullage, deviations, coverage, mass."""
    names = ("id", "time", "volume", "volume_std", "own_std", "ullage", "ullage_std", "coverage", "mass", "capacity")
    chosen = [*current(silo, span), reading.c.status == "ok"]
    return connection.execute(select(*(reading.c[n] for n in names)).where(*chosen).order_by(reading.c.time)).all()


def add(connection: Connection, row: dict[str, Any], blob: bytes | None, now: int) -> int:
    """Adds a reading with its surface; an older one of the same frame stays, but counts no more."""
    made = insert(reading).values(**row).returning(reading.c.id)
    number = int(connection.execute(made).scalar_one())
    if row.get("frame") is not None:
        older = [reading.c.frame == row["frame"], reading.c.id != number, reading.c.superseded.is_(None)]
        connection.execute(update(reading).where(*older).values(superseded=number))
    if blob is not None:
        kept = {"reading": number, "silo": row["silo"], "time": row["time"], "blob": blob}
        connection.execute(insert(surface).values(**kept))
    changes.note(connection, "reading", str(number), row["silo"], now)
    return number


def insert_many(connection: Connection, rows: Sequence[dict[str, Any]]) -> None:
    """Adds rows as they are."""
    if rows:
        connection.execute(insert(reading), list(rows))


def surface_at(connection: Connection, silo: str, time: int) -> Record | None:
    """The newest surface up to a time, with its reading: one that counts, or one that a reading without a surface
    replaced, as those of an imported run are."""
    after = surface.alias()
    bare = ~exists().where(after.c.reading == reading.c.superseded)
    wanted: Select[Any] = (
        select(surface.c.blob, reading)
        .join(reading, reading.c.id == surface.c.reading)
        .where(surface.c.silo == silo, surface.c.time <= time, reading.c.clock != SUSPECT)
        .where(or_(reading.c.superseded.is_(None), bare))
        .order_by(surface.c.time.desc(), surface.c.reading.desc())
        .limit(1)
    )
    return connection.execute(wanted).one_or_none()


def surface_of(connection: Connection, reading_id: int) -> bytes | None:
    """A reading's surface as it is kept."""
    found: bytes | None = connection.execute(select(surface.c.blob).where(surface.c.reading == reading_id)).scalar()
    return found


def run_of(connection: Connection, version: str, config: str, origin: str, now: int, note: str | None = None) -> int:
    """The run of a program and its settings; a recomputation is always a new one."""
    if origin != "recomputed":
        same = [run.c.version == version, run.c.config == config, run.c.origin == origin]
        found = connection.execute(select(run.c.id).where(*same).order_by(run.c.id.desc()).limit(1)).scalar()
        if found is not None:
            return int(found)
    row = {"version": version, "config": config, "origin": origin, "created": now, "note": note}
    return int(connection.execute(insert(run).values(**row).returning(run.c.id)).scalar_one())


def events(connection: Connection, silo: str, span: Span) -> Sequence[Record]:
    """Events that touch a span, in their order."""
    chosen = [event.c.silo == silo]
    if span.since is not None:
        chosen.append(event.c.end >= span.since)
    if span.until is not None:
        chosen.append(event.c.start < span.until)
    return connection.execute(select(event).where(*chosen).order_by(event.c.start)).all()


def replace_events(connection: Connection, silo: str, since: int, rows: Sequence[dict[str, Any]]) -> None:
    """A silo's events from a time on, told anew."""
    connection.execute(delete(event).where(event.c.silo == silo, event.c.start >= since))
    if rows:
        connection.execute(insert(event), list(rows))


def forecast_of(connection: Connection, silo: str) -> Record | None:
    """The silo's daily use and when it will be empty."""
    return connection.execute(select(forecast).where(forecast.c.silo == silo)).one_or_none()


def replace_forecast(connection: Connection, silo: str, row: dict[str, Any] | None) -> None:
    """The silo's forecast, told anew; none where nothing can be told."""
    connection.execute(delete(forecast).where(forecast.c.silo == silo))
    if row is not None:
        connection.execute(insert(forecast).values(silo=silo, **row))


def packed(values: bytes) -> bytes:
    """A surface's bytes as they are kept."""
    return zlib.compress(values, 6)


def unpacked(blob: bytes) -> bytes:
    """The other way round."""
    return zlib.decompress(blob)


def newest(connection: Connection, silo: str, count: int) -> Sequence[Record]:
    """The newest readings, answered or not, the last first."""
    wanted = select(reading).where(*current(silo)).order_by(reading.c.time.desc()).limit(count)
    return connection.execute(wanted).all()


def first_times(connection: Connection, numbers: Sequence[int]) -> dict[str, int]:
    """The earliest time of some readings, by silo."""
    wanted = select(reading.c.silo, func.min(reading.c.time)).where(
        reading.c.id.in_(numbers), reading.c.clock != SUSPECT
    )
    return {str(silo): int(time) for silo, time in connection.execute(wanted.group_by(reading.c.silo))}


def recent(connection: Connection, silo: str, since: int, until: int) -> Sequence[Record]:
    """Answered readings of a stretch, both ends included: time, fill, volume, its own deviation."""
    names = ("time", "fill", "volume", "own_std")
    chosen = [*current(silo, Span(since, until + 1)), reading.c.status == "ok"]
    return connection.execute(select(*(reading.c[n] for n in names)).where(*chosen).order_by(reading.c.time)).all()


def newest_of_camera(connection: Connection, camera: str, count: int) -> Sequence[Record]:
    """A camera's newest readings, the last first."""
    chosen = [reading.c.camera == camera, reading.c.superseded.is_(None), reading.c.clock != SUSPECT]
    return connection.execute(select(reading).where(*chosen).order_by(reading.c.time.desc()).limit(count)).all()


def add_surface(connection: Connection, row: Record, blob: bytes) -> None:
    """Adds the surface of a reading that is there, unless it has one."""
    if connection.execute(select(surface.c.reading).where(surface.c.reading == row.id)).scalar() is None:
        connection.execute(insert(surface).values(reading=row.id, silo=row.silo, time=row.time, blob=blob))
