"""Frames: what arrived, what waits, what became of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, bindparam, func, insert, select, update

from siloscope.monitor.clock import SUSPECT
from siloscope.monitor.store import changes
from siloscope.monitor.store.engine import Store, new_id
from siloscope.monitor.store.rows import Record
from siloscope.monitor.store.schema import camera, frame, reading

QUEUED, MEASURING, MEASURED, GATHERING, FAILED = "queued", "measuring", "measured", "gathering", "failed"
STATES = (QUEUED, MEASURING, MEASURED, GATHERING, FAILED)
"""A frame waits, is in a worker, has a reading (or a refusal), waits for a calibration, or can't be used."""


FOUND = select(frame).where(frame.c.camera == bindparam("of"), frame.c.sha256 == bindparam("hash"))
"""Made once: making a statement takes longer than it takes SQLite to answer it."""


class BytesGone(Exception):
    """The bytes were removed between their arrival and their frame's; the sender sends them again."""


@dataclass(frozen=True)
class Arrival:
    """A frame whose bytes are safe."""

    camera: str
    sha256: str
    captured: int
    received: int
    clock: str
    format: str
    bytes: int


def find(connection: Connection, camera_id: str, sha256: str) -> Record | None:
    """The frame of a camera with these bytes."""
    return connection.execute(FOUND, {"of": camera_id, "hash": sha256}).one_or_none()


def get(connection: Connection, frame_id: str) -> Record | None:
    """A frame with its silo."""
    wanted = select(frame, camera.c.silo).join(camera, camera.c.id == frame.c.camera).where(frame.c.id == frame_id)
    return connection.execute(wanted).one_or_none()


def record(
    store: Store, connection: Connection, arrival: Arrival, there: Callable[[], bool], *, archived: bool = False
) -> tuple[str, bool]:
    """Adds a frame to the queue; its id, and whether it is new.

    A frame whose bytes were lost is queued again with the new ones. Raises `BytesGone` unless the bytes are `there`
    while nothing can remove them.
    """
    if not there():
        raise BytesGone
    frame_id = new_id()
    row = {name: getattr(arrival, name) for name in Arrival.__dataclass_fields__}
    row |= {"id": frame_id, "kept": True, "state": QUEUED, "attempts": 0, "not_before": 0}
    if store.insert_new(connection, frame, row):
        return frame_id, True
    found = find(connection, arrival.camera, arrival.sha256)
    if found is not None and lost(found):
        again = {"kept": True, "state": QUEUED, "attempts": 0, "not_before": 0, "error": None}
        connection.execute(update(frame).where(frame.c.id == found.id).values(**again))
        return str(found.id), True
    if found is not None and archived and not found.kept:
        connection.execute(update(frame).where(frame.c.id == found.id).values(kept=True, bytes=arrival.bytes))
        return str(found.id), True
    return str(found.id if found else frame_id), False


def lost(row: Record) -> bool:
    """Whether a frame's bytes were lost before it was measured."""
    return not row.kept and row.state == FAILED


def waiting(connection: Connection) -> int:
    """Frames that are queued or in a worker."""
    states = frame.c.state.in_((QUEUED, MEASURING))
    return connection.execute(select(func.count()).select_from(frame).where(states)).scalar_one()


def claim(store: Store, now: int, until: int = 0) -> Record | None:
    """Takes the newest waiting frame into measurement; the attempt counts from here, whatever becomes of it.

    A process that has not settled it `until` then is taken for gone (`requeue_interrupted`).
    """
    with store.write() as connection:
        return claimed(connection, now, until)


def claimed(connection: Connection, now: int, until: int) -> Record | None:
    """The same within a transaction, such as that which settles the frame before."""
    wanted = (
        select(frame.c.id)
        .where(frame.c.state == QUEUED, frame.c.not_before <= now)
        .order_by(frame.c.captured.desc())
        .limit(1)
        .with_for_update(skip_locked=True)
    )
    found = connection.execute(wanted).scalar()
    if found is None:
        return None
    taken = {"state": MEASURING, "attempts": frame.c.attempts + 1, "not_before": until}
    connection.execute(update(frame).where(frame.c.id == found).values(**taken))
    return get(connection, found)


def settle(connection: Connection, frame_id: str, silo: str, state: str, now: int, **more: Any) -> None:
    """Writes what became of a frame."""
    connection.execute(update(frame).where(frame.c.id == frame_id).values(state=state, **more))
    changes.note(connection, "frame", frame_id, silo, now)


def requeue_interrupted(store: Store, now: int | None = None) -> int:
    """Queues again what was in a worker when its service ended: all, or what should have been settled by `now`."""
    chosen = [frame.c.state == MEASURING, *([] if now is None else [frame.c.not_before < now])]
    with store.write() as connection:
        back = update(frame).where(*chosen).values(state=QUEUED, not_before=0)
        return connection.execute(back).rowcount


def requeue(connection: Connection, camera_id: str, span: tuple[int, int | None], run: int) -> int:
    """Queues a camera's kept frames of a time again, as part of a run; how many."""
    since, until = span
    states = (GATHERING, MEASURED, FAILED)
    chosen = [frame.c.camera == camera_id, frame.c.captured >= since, frame.c.kept, frame.c.state.in_(states)]
    if until is not None:
        chosen.append(frame.c.captured < until)
    back = update(frame).where(*chosen).values(state=QUEUED, attempts=0, not_before=0, error=None, run=run)
    return connection.execute(back).rowcount


def counts(connection: Connection) -> dict[str, int]:
    """Number of frames by state."""
    found = connection.execute(select(frame.c.state, func.count()).group_by(frame.c.state)).all()
    return dict.fromkeys(STATES, 0) | {str(state): int(number) for state, number in found}


def failures(connection: Connection) -> dict[str, int]:
    """Number of failed frames by reason."""
    wanted = select(frame.c.error, func.count()).where(frame.c.state == FAILED).group_by(frame.c.error)
    return {str(reason or "unknown"): int(number) for reason, number in connection.execute(wanted)}


def reading_of(connection: Connection, frame_id: str) -> Record | None:
    """The frame's current reading."""
    wanted = select(reading).where(reading.c.frame == frame_id, reading.c.superseded.is_(None))
    return connection.execute(wanted.order_by(reading.c.id.desc()).limit(1)).one_or_none()


def newest(connection: Connection, camera_id: str) -> Record | None:
    """The camera's newest frame; one of a wrong clock only where there is no other."""
    order = (frame.c.clock == SUSPECT, frame.c.captured.desc())
    wanted = select(frame).where(frame.c.camera == camera_id).order_by(*order).limit(1)
    return connection.execute(wanted).one_or_none()


def listed(
    connection: Connection, camera_id: str | None, state: str | None, before: str | None, count: int
) -> Sequence[Record]:
    """Frames, the last arrived first; ids rise with the time of arrival, so one is the cursor."""
    wanted = select(frame, camera.c.silo).join(camera, camera.c.id == frame.c.camera)
    if camera_id is not None:
        wanted = wanted.where(frame.c.camera == camera_id)
    if state is not None:
        wanted = wanted.where(frame.c.state == state)
    if before is not None:
        wanted = wanted.where(frame.c.id < before)
    return connection.execute(wanted.order_by(frame.c.id.desc()).limit(count)).all()


def gathering(connection: Connection, camera_id: str, since: int | None) -> Sequence[Record]:
    """Kept frames from which a camera is to be calibrated, in their order: those that wait, or all since a move."""
    chosen = [frame.c.camera == camera_id, frame.c.kept]
    chosen.append(frame.c.state == GATHERING if since is None else frame.c.captured >= since)
    return connection.execute(select(frame).where(*chosen).order_by(frame.c.captured)).all()


def dated(connection: Connection, camera_id: str) -> Iterator[Record]:
    """A camera's kept frames whose time can be relied on, in its order: id, hash, time."""
    chosen = [frame.c.camera == camera_id, frame.c.kept, frame.c.clock != SUSPECT, frame.c.state != FAILED]
    wanted = select(frame.c.id, frame.c.sha256, frame.c.captured).where(*chosen)
    yield from connection.execute(wanted.order_by(frame.c.captured, frame.c.id))


def insert_many(connection: Connection, rows: Sequence[dict[str, Any]]) -> None:
    """Adds rows as they are."""
    if rows:
        connection.execute(insert(frame), list(rows))


def received_since(connection: Connection, since: int) -> Sequence[Record]:
    """Kept frames that arrived since a time and still wait, with their silos."""
    wanted = select(frame, camera.c.silo).join(camera, camera.c.id == frame.c.camera)
    chosen = [frame.c.received >= since, frame.c.kept, frame.c.state.in_((QUEUED, GATHERING))]
    return connection.execute(wanted.where(*chosen)).all()
