"""An edge's side of its link with the hub: what the hub has, by number of reading, and what it has not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import ColumnElement, Connection, exists, func, not_, or_, select

from siloscope.monitor.clock import DAY
from siloscope.monitor.store import places
from siloscope.monitor.store.rows import Record
from siloscope.monitor.store.schema import frame, reading, run

HUB = "hub"
"""The fact that there is a hub: which frames' bytes it gets ("none", "samples", "all")."""

READINGS, FRAMES = "hub_readings", "hub_frames"
"""Facts: stretches [first, last] of readings that the hub has acknowledged; of those whose frames are dealt with."""

Stretches = list[tuple[int, int]]


def stretches(connection: Connection, lane: str) -> Stretches:
    """What is dealt with, in order."""
    return [(int(first), int(last)) for first, last in places.fact(connection, lane) or ()]


def acknowledge(connection: Connection, lane: str, first: int, last: int) -> None:
    """Adds a stretch."""
    places.set_fact(connection, lane, [list(one) for one in joined([*stretches(connection, lane), (first, last)])])


def joined(told: Stretches) -> Stretches:
    """Stretches in order, those that touch made one."""
    made: Stretches = []
    for first, last in sorted(told):
        if made and first <= made[-1][1] + 1:
            made[-1] = (made[-1][0], max(last, made[-1][1]))
        else:
            made.append((first, last))
    return made


def gaps(told: Stretches, last: int) -> Stretches:
    """What is missing of the numbers from 1 to the last one, in order."""
    made, begin = [], 1
    for first, end in told:
        if first > begin:
            made.append((begin, first - 1))
        begin = end + 1
    return [*made, (begin, last)] if begin <= last else made


def newest(connection: Connection) -> int:
    """Number of the last reading; 0 where there is none."""
    return connection.execute(select(func.max(reading.c.id))).scalar() or 0


def missing(connection: Connection, lane: str) -> Stretches:
    """What is not dealt with."""
    return gaps(stretches(connection, lane), newest(connection))


def batch(connection: Connection, gap: tuple[int, int], count: int, *, from_end: bool) -> Sequence[Record]:
    """Readings of a gap with their frames and runs, from its end or its beginning, in the order of their numbers."""
    wanted = (
        select(reading, frame.c.sha256, frame.c.captured, frame.c.format, frame.c.bytes, frame.c.kept)
        .add_columns(run.c.version.label("run_version"), run.c.config.label("run_config"))
        .join(run, run.c.id == reading.c.run)
        .outerjoin(frame, frame.c.id == reading.c.frame)
        .where(reading.c.id.between(*gap))
        .order_by(reading.c.id.desc() if from_end else reading.c.id)
        .limit(count)
    )
    return sorted(connection.execute(wanted).all(), key=lambda row: int(row.id))


def is_sample(connection: Connection, row: Any) -> bool:
    """Whether a frame is a sample: without an answer, or the first of its silo and day."""
    if row.status != "ok":
        return True
    day = row.time // DAY
    before = [reading.c.silo == row.silo, reading.c.id < row.id, reading.c.time.between(day * DAY, (day + 1) * DAY - 1)]
    return not connection.execute(select(exists().where(*before))).scalar()


def pending(connection: Connection) -> dict[str, int]:
    """Number of readings that the hub has not, where there is one."""
    if places.fact(connection, HUB) is None:
        return {}
    counted = select(func.count()).select_from(reading).where(_in(missing(connection, READINGS)))
    return {HUB: connection.execute(counted).scalar_one()}


def free(connection: Connection) -> list[ColumnElement[bool]]:
    """Conditions of the frames that may be deleted: the hub has what it is to get of them."""
    wanted = places.fact(connection, HUB)
    if wanted is None:
        return []
    lost = missing(connection, READINGS if wanted == "none" else FRAMES)
    return [not_(exists().where(reading.c.frame == frame.c.id, _in(lost)))] if lost else []


def _in(told: Stretches) -> ColumnElement[bool]:
    return or_(*(reading.c.id.between(*one) for one in told)) if told else reading.c.id < 0
