"""What goes when: old frames and surfaces by their age, and frames by the room there is. Readings stay for ever."""

from __future__ import annotations

from dataclasses import dataclass

from siloscope.monitor.blobs import Blobs
from siloscope.monitor.clock import DAY, Clock
from siloscope.monitor.settings import Limits, Retention
from siloscope.monitor.store import aging, changes, deliveries, people, sync
from siloscope.monitor.store.engine import Store

BATCH = 500
"""Frames of one transaction."""

ROOM = 1.5
"""Until so many times the reserve is free, frames go for want of room."""


@dataclass(frozen=True)
class Gone:
    """How much went."""

    by_age: int
    for_room: int
    surfaces: int


class Keeper:
    """Removes what has had its time."""

    def __init__(self, store: Store, blobs: Blobs, limits: Limits, retention: Retention, clock: Clock) -> None:
        self._store, self._blobs, self._limits, self._retention, self._clock = store, blobs, limits, retention, clock

    def keep(self) -> Gone:
        """One round."""
        now, ages = self._clock.now(), self._retention
        by_age = self._forget_aged(now - ages.frames)
        with self._store.write() as connection:
            surfaces = aging.thin_surfaces(connection, now - ages.surfaces, DAY)
            changes.prune(connection, now - ages.changes)
            deliveries.prune(connection, now - ages.changes)
            people.prune(connection, now - ages.audit)
        return Gone(by_age, self._make_room(), surfaces)

    def _forget_aged(self, before: int) -> int:
        """All frames from before a time, but for one a day and camera."""
        total = 0
        while True:
            with self._store.write() as connection:
                rows = aging.aged(connection, before, DAY, BATCH, *sync.free(connection))
                aging.forget(connection, [row.id for row in rows])
            self._remove({row.sha256 for row in rows})
            total += len(rows)
            if len(rows) < BATCH:
                return total

    def _make_room(self) -> int:
        """The oldest frames that are done with, whatever their age, while the disk is nearly full."""
        total = 0
        while self._short():
            with self._store.write() as connection:
                rows = aging.oldest(connection, BATCH // 10, *sync.free(connection))
                rows = rows or aging.oldest(
                    connection, BATCH // 10
                )  # what the hub has not, only where nothing else is left
                aging.forget(connection, [row.id for row in rows])
            self._remove({row.sha256 for row in rows})
            total += len(rows)
            if not rows:
                break
        return total

    def _short(self) -> bool:
        free, whole = self._blobs.free()
        return free < ROOM * min(self._limits.reserve, self._limits.reserve_fraction * whole)

    def _remove(self, hashes: set[str]) -> None:
        """Removes bytes that no kept frame has, while no frame is being recorded."""
        with self._store.write() as connection:
            self._store.while_blobs_stay(connection, removing=True)
            for sha256 in aging.unused(connection, hashes):
                self._blobs.remove(sha256)
