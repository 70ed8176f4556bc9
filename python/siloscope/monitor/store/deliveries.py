"""The outbox's rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import Connection, delete, func, select, update

from siloscope.monitor.store.engine import Store
from siloscope.monitor.store.rows import Record
from siloscope.monitor.store.schema import outbox


def put(store: Store, connection: Connection, channel: str, key: str, payload: dict[str, Any], now: int) -> bool:
    """Adds a delivery; whether it is new."""
    row = {"channel": channel, "key": key, "payload": payload, "created": now, "attempts": 0, "next": now}
    return store.insert_new(connection, outbox, row)


def due(connection: Connection, channel: str, now: int, count: int) -> Sequence[Record]:
    """What a channel is to deliver now, the oldest first."""
    chosen = [outbox.c.channel == channel, outbox.c.delivered.is_(None), outbox.c.next <= now]
    return connection.execute(select(outbox).where(*chosen).order_by(outbox.c.id).limit(count)).all()


def done(connection: Connection, number: int, now: int) -> None:
    """The other side has it."""
    connection.execute(update(outbox).where(outbox.c.id == number).values(delivered=now, error=None))


def postpone(connection: Connection, number: int, error: str, next_: int) -> None:
    """It could not be delivered."""
    values = {"attempts": outbox.c.attempts + 1, "error": error, "next": next_}
    connection.execute(update(outbox).where(outbox.c.id == number).values(**values))


def pending(connection: Connection) -> dict[str, int]:
    """Number of undelivered things by channel."""
    wanted = select(outbox.c.channel, func.count()).where(outbox.c.delivered.is_(None)).group_by(outbox.c.channel)
    return {str(channel): int(count) for channel, count in connection.execute(wanted)}


def prune(connection: Connection, before: int) -> int:
    """Forgets what was delivered before a time."""
    return connection.execute(delete(outbox).where(outbox.c.delivered < before)).rowcount
