"""What changed, in order: the page's live events and a hub's synchronisation follow this log."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import Connection, delete, func, insert, select

from siloscope.monitor.store.rows import Record
from siloscope.monitor.store.schema import change

KINDS = (
    *("frame", "reading", "event", "forecast", "alert", "silo", "camera", "calibration", "ticket", "rule", "place"),
    "site",
)
"""What a change can be of."""


def note(connection: Connection, kind: str, subject: str, silo: str | None, now: int) -> None:
    """Adds a change, in the transaction that makes it."""
    connection.execute(insert(change).values(kind=kind, subject=subject, silo=silo, time=now))


def after(connection: Connection, cursor: int, count: int) -> Sequence[Record]:
    """Changes behind a number, the oldest first."""
    wanted = select(change).where(change.c.id > cursor).order_by(change.c.id).limit(count)
    return connection.execute(wanted).all()


def newest(connection: Connection) -> int:
    """Number of the last change; 0 where there is none."""
    return connection.execute(select(func.max(change.c.id))).scalar() or 0


def oldest(connection: Connection) -> int:
    """Number of the first change that is still there; 0 where there is none."""
    return connection.execute(select(func.min(change.c.id))).scalar() or 0


def prune(connection: Connection, before: int) -> int:
    """Forgets changes from before a time, but for the last one, which holds the count."""
    last = newest(connection)
    gone = connection.execute(delete(change).where(change.c.time < before, change.c.id < last))
    return gone.rowcount
