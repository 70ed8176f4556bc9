"""Frames that arrive at the same time share a commit: of what a commit takes, nearly all is the disk's flush.

Whoever comes while a commit is under way waits for it, and then commits for all who have come meanwhile. Nobody is told
that a frame is safe before the commit that has it is on the disk.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass

from sqlalchemy.exc import IntegrityError

from siloscope.monitor.store import frames
from siloscope.monitor.store.engine import Store


@dataclass
class Waiting:
    """A frame that is to be recorded, and what became of it."""

    arrival: frames.Arrival
    there: Callable[[], bool]
    archived: bool
    taken: tuple[str, bool] | None = None
    error: BaseException | None = None

    @property
    def done(self) -> bool:
        """Whether it is committed, or will not be."""
        return self.taken is not None or self.error is not None


class Recorder:
    """Records frames of many senders."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._turn, self._lock = threading.Lock(), threading.Lock()
        self._waiting: list[Waiting] = []

    def record(self, arrival: frames.Arrival, there: Callable[[], bool], *, archived: bool = False) -> tuple[str, bool]:
        """Adds a frame to the queue, durably, as `siloscope.monitor.store.frames.record` does within a transaction."""
        mine = Waiting(arrival, there, archived)
        with self._lock:
            self._waiting.append(mine)
        with self._turn:
            if not mine.done:
                with self._lock:
                    all_, self._waiting = self._waiting, []
                self._commit(all_)
        if mine.taken is None:
            raise mine.error or RuntimeError("a frame was left out of its commit")
        return mine.taken

    def _commit(self, some: list[Waiting]) -> None:
        """All in one transaction; where one of them can't be, each in its own."""
        try:
            self._together(some)
        except IntegrityError as error:
            if len(some) == 1:
                some[0].error = error
            else:
                for one in some:
                    self._commit([one])
        except BaseException as error:
            for one in some:
                one.error = error

    def _together(self, some: list[Waiting]) -> None:
        found: list[tuple[str, bool] | None] = []
        with self._store.write() as connection:
            self._store.while_blobs_stay(connection)
            for one in some:
                try:
                    found.append(frames.record(self._store, connection, one.arrival, one.there, archived=one.archived))
                except frames.BytesGone as gone:
                    one.error = gone
                    found.append(None)
        for one, taken in zip(some, found, strict=True):
            one.taken = taken
