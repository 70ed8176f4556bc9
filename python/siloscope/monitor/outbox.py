"""What is to be delivered: written in the transaction that makes it, taken out only when the other side has it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from sqlalchemy import Connection

from siloscope.monitor.clock import HOUR, SECOND
from siloscope.monitor.store import deliveries
from siloscope.monitor.store.engine import Store

FIRST_RETRY, LAST_RETRY = 5 * SECOND, HOUR
"""Waits double from the first to the last."""


@dataclass(frozen=True)
class Delivery:
    """One thing for one channel."""

    id: int
    channel: str
    key: str
    """The same thing has the same key, so that the other side can tell a repetition."""
    payload: dict[str, Any]
    attempts: int


class NotDelivered(Exception):
    """A channel could not deliver; it is tried again."""


class Channel(Protocol):
    """A way out: webhook, mail, MQTT, hub."""

    name: str

    def deliver(self, delivery: Delivery) -> None:
        """Returns when the other side has it; raises `NotDelivered` with the reason otherwise."""


class Outbox:
    """Puts things in, and has channels take them out."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self.channels: dict[str, Channel] = {}

    def announce(self, connection: Connection, channels: Sequence[str], alert: str, now: int) -> None:
        """An alert's present state to the channels of its rule."""
        for channel in channels:
            deliveries.put(self._store, connection, channel, f"alert/{alert}/{now}", {"alert": alert}, now)

    def put(self, connection: Connection, channel: str, key: str, payload: dict[str, Any], now: int) -> None:
        """Anything else; a key that is there already is not put twice."""
        deliveries.put(self._store, connection, channel, key, payload, now)

    def deliver(self, now: int, count: int = 50) -> int:
        """Delivers what is due on the channels that there are; how many were delivered."""
        done = 0
        for channel in list(self.channels.values()):
            with self._store.read() as connection:
                due = deliveries.due(connection, channel.name, now, count)
            for row in due:
                done += self._one(channel, Delivery(row.id, row.channel, row.key, row.payload, row.attempts), now)
        return done

    def _one(self, channel: Channel, delivery: Delivery, now: int) -> bool:
        try:
            channel.deliver(delivery)
        except NotDelivered as error:
            with self._store.write() as connection:
                deliveries.postpone(connection, delivery.id, str(error), now + retry(delivery.attempts))
            return False
        with self._store.write() as connection:
            deliveries.done(connection, delivery.id, now)
        return True


def retry(attempts: int) -> int:
    """How long to wait after so many attempts before, µs."""
    return min(FIRST_RETRY << min(attempts, 20), LAST_RETRY)
