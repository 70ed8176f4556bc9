"""What is to be delivered: written in the transaction that makes it, taken out only when the other side has it."""

from __future__ import annotations

import random
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from sqlalchemy import Connection
from sqlalchemy.exc import OperationalError

from siloscope.monitor.clock import DAY, HOUR, SECOND, Clock
from siloscope.monitor.store import alerts, deliveries
from siloscope.monitor.store.engine import Store

FIRST_RETRY, LAST_RETRY = 5 * SECOND, HOUR
"""Waits double from the first to the last."""

JITTER = 0.2
"""Fraction of a wait by which it varies, so that many boxes don't come at once after an outage."""

GIVE_UP = 7 * DAY
"""What could not be delivered for so long is tried no more until somebody asks for it."""

LOOK_S = 1.0
"""How often a channel looks for what is due."""

STOP_S = 5.0


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
        """What has become of an alert just now, to the channels of its rule."""
        row = alerts.get(connection, alert)
        state = "firing" if row is not None and row.resolved is None else "resolved"
        payload = {"alert": alert, "state": state, "time": now}
        for channel in channels:
            deliveries.put(self._store, connection, channel, f"alert/{alert}/{state}", payload, now)

    def put(self, connection: Connection, channel: str, key: str, payload: dict[str, Any], now: int) -> None:
        """Anything else; a key that is there already is not put twice."""
        deliveries.put(self._store, connection, channel, key, payload, now)

    def deliver(self, now: int, count: int = 50) -> int:
        """Delivers what is due on all channels, one after the other; how many were delivered."""
        return sum(self.deliver_on(channel, now, count) for channel in list(self.channels.values()))

    def deliver_on(self, channel: Channel, now: int, count: int = 50) -> int:
        """Delivers what is due on a channel, in its order; the first that fails ends the round."""
        with self._store.read() as connection:
            due = deliveries.due(connection, channel.name, now, count)
        for done, row in enumerate(due):
            if not self._one(
                channel, Delivery(row.id, row.channel, row.key, row.payload, row.attempts), row.created, now
            ):
                return done
        return len(due)

    def _one(self, channel: Channel, delivery: Delivery, created: int, now: int) -> bool:
        try:
            channel.deliver(delivery)
        except NotDelivered as error:
            later = deliveries.NEVER if now - created > GIVE_UP else now + retry(delivery.attempts)
            with self._store.write() as connection:
                deliveries.postpone(connection, delivery.id, str(error), later)
            return False
        with self._store.write() as connection:
            deliveries.done(connection, delivery.id, now)
        return True


def retry(attempts: int) -> int:
    """How long to wait after so many attempts before, µs."""
    wait = min(FIRST_RETRY << min(attempts, 20), LAST_RETRY)
    return int(wait * random.uniform(1.0 - JITTER, 1.0 + JITTER))


class Deliverer:
    """A thread of one channel: a channel that hangs holds up nobody but itself. It delivers while `leads`."""

    def __init__(self, outbox: Outbox, channel: Channel, clock: Clock, leads: Callable[[], bool]) -> None:
        self._outbox, self._channel, self._clock, self._leads = outbox, channel, clock, leads
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"deliver-{channel.name}", daemon=True)

    def start(self) -> None:
        """Starts delivering."""
        self._thread.start()

    def stop(self) -> None:
        """Ends after the delivery that is under way."""
        self._stopping.set()
        self._thread.join(STOP_S)

    def _run(self) -> None:
        while not self._stopping.wait(LOOK_S):
            if not self._leads():
                continue
            try:
                self._outbox.deliver_on(self._channel, self._clock.now())
            except OperationalError:
                continue  # a full disk or a busy database: what was delivered is delivered again
