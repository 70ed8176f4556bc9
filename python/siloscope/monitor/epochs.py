"""By which clock a reading has its time: a box without a network for weeks may have its clock set in between.

The readings between two settings of the clock are an epoch. When the clock is set, the epochs of the same run of the
machine are as wrong as it was, and their shift says by how much; of what was measured before the machine was switched
off nothing more can be told.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from siloscope.monitor.clock import SECOND, Clock
from siloscope.monitor.store import places, sync
from siloscope.monitor.store.engine import Store

EPOCHS, SEEN = "clock_epochs", "clock_seen"
"""Facts: the epochs; and by how much wall clock and uptime differed when last looked at."""

JUMP = 10 * SECOND
"""A clock that is off by less is not worth a word."""

MOST = 500
"""Epochs that are kept."""

BOOT = Path("/proc/sys/kernel/random/boot_id")


@dataclass(frozen=True)
class Uptime:
    """A clock that nobody sets, µs, and the run of the machine that it counts from."""

    now: Callable[[], int]
    boot: str


def uptime() -> Uptime:
    """The machine's."""
    boot = BOOT.read_text("ascii").strip() if BOOT.exists() else str(time.time_ns() - time.monotonic_ns())
    clock = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)
    return Uptime(lambda: time.clock_gettime_ns(clock) // 1000, boot)


class Epochs:
    """Watches the clock of a box."""

    def __init__(self, store: Store, clock: Clock, uptime: Uptime) -> None:
        self._store, self._clock, self._uptime = store, clock, uptime
        with store.read() as connection:
            self._seen: dict[str, Any] = places.fact(connection, SEEN) or {}

    def look(self) -> None:
        """Begins an epoch where the machine was started anew, or its clock was set."""
        difference = self._clock.now() - self._uptime.now()
        same = self._seen.get("boot") == self._uptime.boot
        jump = difference - self._seen["difference"] if same else 0
        if same and abs(jump) <= JUMP:
            return
        self._seen = {"boot": self._uptime.boot, "difference": difference}
        with self._store.write() as connection:
            found = [
                epoch | {"shift": epoch["shift"] + jump} if epoch["boot"] == self._uptime.boot else epoch
                for epoch in places.fact(connection, EPOCHS) or ()
            ]
            found.append({"first": sync.newest(connection) + 1, "boot": self._uptime.boot, "shift": 0})
            places.set_fact(connection, EPOCHS, found[-MOST:])
            places.set_fact(connection, SEEN, self._seen)

    def of(self, epochs: list[dict[str, Any]], reading: int) -> tuple[int, bool]:
        """What is to be added to a reading's time, µs, and whether it then is by the present clock."""
        for epoch in reversed(epochs):
            if epoch["first"] <= reading:
                return int(epoch["shift"]), epoch["boot"] == self._uptime.boot
        return 0, False

    def known(self) -> list[dict[str, Any]]:
        """The epochs in their order."""
        with self._store.read() as connection:
            return list(places.fact(connection, EPOCHS) or ())
