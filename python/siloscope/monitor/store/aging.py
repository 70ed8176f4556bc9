"""Which frames and surfaces have had their time."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import ColumnElement, Connection, delete, func, select, update

from siloscope.monitor.store.frames import FAILED, MEASURED
from siloscope.monitor.store.rows import Record
from siloscope.monitor.store.schema import frame, surface


def aged(connection: Connection, before: int, step: int, count: int, *free: ColumnElement[bool]) -> Sequence[Record]:
    """Kept frames that are done with, from before a time, but for the first of each camera and step.

    `free` are conditions of the frames that may go.
    """
    done = [frame.c.kept, frame.c.state.in_((MEASURED, FAILED)), frame.c.captured < before, *free]
    rank = func.row_number().over(
        partition_by=(frame.c.camera, frame.c.captured // step), order_by=(frame.c.state.desc(), frame.c.captured)
    )
    ranked = select(frame.c.id, frame.c.sha256, rank.label("rank")).where(*done).subquery()
    wanted = select(ranked.c.id, ranked.c.sha256).where(ranked.c.rank > 1).limit(count)
    return connection.execute(wanted).all()


def oldest(connection: Connection, count: int, *free: ColumnElement[bool]) -> Sequence[Record]:
    """The oldest kept frames that are done with; `free` are conditions of those that may go."""
    wanted = select(frame.c.id, frame.c.sha256).where(frame.c.kept, frame.c.state.in_((MEASURED, FAILED)), *free)
    return connection.execute(wanted.order_by(frame.c.captured).limit(count)).all()


def forget(connection: Connection, ids: Sequence[str]) -> None:
    """Notes that frames' bytes are gone; the rows stay, so that a frame sent again is known."""
    if ids:
        connection.execute(update(frame).where(frame.c.id.in_(ids)).values(kept=False))


def unused(connection: Connection, hashes: set[str]) -> set[str]:
    """Those of some hashes that no kept frame has."""
    if not hashes:
        return set()
    wanted = select(frame.c.sha256).where(frame.c.sha256.in_(hashes), frame.c.kept)
    return hashes - {str(found) for found in connection.execute(wanted).scalars()}


def thin_surfaces(connection: Connection, before: int, step: int) -> int:
    """Removes surfaces from before a time, but for the first of each silo and step."""
    rank = func.row_number().over(partition_by=(surface.c.silo, surface.c.time // step), order_by=surface.c.time)
    ranked = select(surface.c.reading, rank.label("rank")).where(surface.c.time < before).subquery()
    gone = delete(surface).where(surface.c.reading.in_(select(ranked.c.reading).where(ranked.c.rank > 1)))
    return connection.execute(gone).rowcount


def kept_hashes(connection: Connection) -> Sequence[str]:
    """Hashes whose bytes have to be there."""
    return connection.execute(select(frame.c.sha256).where(frame.c.kept).distinct()).scalars().all()
