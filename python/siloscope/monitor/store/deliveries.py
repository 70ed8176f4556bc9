"""The outbox's rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import ColumnElement, Connection, delete, func, select, update

from siloscope.monitor.store.engine import Store
from siloscope.monitor.store.rows import Record
from siloscope.monitor.store.schema import outbox

NEVER = 1 << 62
"""When that is tried again which is given up."""


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
    """Number of things by channel that are still tried."""
    wanted = select(outbox.c.channel, func.count()).where(*_state("pending")).group_by(outbox.c.channel)
    return {str(channel): int(count) for channel, count in connection.execute(wanted)}


def given_up(connection: Connection) -> dict[str, int]:
    """Number of things by channel that are tried no more."""
    wanted = select(outbox.c.channel, func.count()).where(*_state("failed")).group_by(outbox.c.channel)
    return {str(channel): int(count) for channel, count in connection.execute(wanted)}


def listed(connection: Connection, state: str, before: int | None, count: int) -> Sequence[Record]:
    """Deliveries in a state ("pending", "failed", "delivered"), the newest first."""
    wanted = select(outbox).where(*_state(state))
    if before is not None:
        wanted = wanted.where(outbox.c.id < before)
    return connection.execute(wanted.order_by(outbox.c.id.desc()).limit(count)).all()


def again(connection: Connection, number: int, now: int) -> bool:
    """Tries an undelivered thing again at once, for as long as a new one; whether there is such a one."""
    chosen = [outbox.c.id == number, outbox.c.delivered.is_(None)]
    values = {"next": now, "created": now, "attempts": 0}
    return connection.execute(update(outbox).where(*chosen).values(**values)).rowcount == 1


def _state(state: str) -> list[ColumnElement[bool]]:
    if state == "delivered":
        return [outbox.c.delivered.is_not(None)]
    return [outbox.c.delivered.is_(None), outbox.c.next >= NEVER if state == "failed" else outbox.c.next < NEVER]


def prune(connection: Connection, before: int) -> int:
    """Forgets what was delivered before a time."""
    return connection.execute(delete(outbox).where(outbox.c.delivered < before)).rowcount
