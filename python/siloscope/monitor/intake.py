"""From bytes on the line to a frame that survives a power cut.

A frame is acknowledged when its file is flushed, renamed to its hash, its folder flushed, and its row committed.
Whoever gets no acknowledgement sends it again: the same camera and bytes are the same frame.
"""

from __future__ import annotations

import errno
import sqlite3
import time
from collections.abc import AsyncIterable, Callable
from dataclasses import dataclass

from anyio import to_thread
from sqlalchemy import Connection
from sqlalchemy.exc import OperationalError

from siloscope.monitor.blobs import Blobs, Part
from siloscope.monitor.clock import Clock, capture
from siloscope.monitor.formats import HEAD, format_of
from siloscope.monitor.problems import Problem
from siloscope.monitor.settings import Limits
from siloscope.monitor.store import frames
from siloscope.monitor.store.engine import Store
from siloscope.monitor.store.recording import Recorder

RETRY_S = 30
"""What a sender is asked to wait where too much waits already."""

COUNTED_S = 0.5
"""So long a count of the queue holds."""

Check = Callable[[Connection], None]
"""Raises `Problem` for who may not send."""

FULL = (errno.ENOSPC, errno.EDQUOT)


@dataclass(frozen=True)
class Told:
    """What a sender says of a frame."""

    camera: str
    sha256: str | None = None
    captured: int | None = None
    age: int | None = None
    """µs since it was taken, by the sender's monotonic clock."""
    length: int | None = None
    archived: bool = False
    """Whether it was measured elsewhere: its reading is here, its bytes are to be kept beside it."""


@dataclass(frozen=True)
class Taken:
    """A frame that is safe."""

    frame: str
    new: bool


class Intake:
    """Takes frames in."""

    def __init__(self, store: Store, blobs: Blobs, limits: Limits, clock: Clock) -> None:
        self._store, self._blobs, self._clock = store, blobs, clock
        self.limits = limits
        """What is taken in; may be changed while it runs."""
        self._recorder = Recorder(store)
        self._counted, self._waiting = float("-inf"), 0

    async def take(self, told: Told, body: AsyncIterable[bytes], check: Check | None = None) -> Taken:
        """Receives a body; raises `Problem` where it can't be kept, or where the `check` does."""
        known = await to_thread.run_sync(self._room, told, check)
        if known is not None:
            return known
        try:
            with self._blobs.receiving() as part:
                await self._receive(part, body)
                return await to_thread.run_sync(self._keep, told, part)
        except OSError as error:
            if error.errno in FULL:
                raise full(self._blobs) from None
            raise
        except OperationalError as error:
            if is_full(error):
                raise full(self._blobs) from None
            raise

    async def _receive(self, part: Part, body: AsyncIterable[bytes]) -> None:
        head = b""
        async for chunk in body:
            self._check_length(part.size + len(chunk))
            part.add(chunk)
            if len(head) < HEAD:
                head += chunk[:HEAD]
        if not part.size:
            raise Problem("invalid", "the body is empty; send the frame's file as it is")
        if format_of(head[:HEAD]) is None:
            raise Problem(
                "unknown-format",
                f"a file that begins with {head[:HEAD]!r} is no frame; `siloscope info` says what is read",
            )
        part.format = format_of(head[:HEAD]) or ""

    def _check_length(self, length: int) -> None:
        if length > self.limits.body:
            raise Problem("too-large", f"the body has more than {self.limits.body} bytes; send one frame a request")

    def _room(self, told: Told, check: Check | None) -> Taken | None:
        """The frame, where it was taken before; raises `Problem` where there is no room for another."""
        with self._store.read() as connection:
            if check is not None:
                check(connection)
            self._check_length(told.length or 0)
            known = frames.find(connection, told.camera, told.sha256) if told.sha256 else None
            if known is not None and not frames.lost(known) and (known.kept or not told.archived):
                return Taken(known.id, False)
            if self._in_queue(connection) >= self.limits.queue:
                detail = f"{self.limits.queue} frames wait to be measured; keep the frame and send it later"
                raise Problem("too-many", detail, {"Retry-After": str(RETRY_S)})
        free, total = self._blobs.free()
        if free < min(self.limits.reserve, int(self.limits.reserve_fraction * total)):
            raise full(self._blobs)
        return None

    def _in_queue(self, connection: Connection) -> int:
        """Frames that wait, counted a moment ago: counting a long queue takes longer than taking a frame."""
        now = time.monotonic()
        if now - self._counted > COUNTED_S:
            self._counted, self._waiting = now, frames.waiting(connection)
        return self._waiting

    def _keep(self, told: Told, part: Part) -> Taken:
        sha256 = part.sha256
        if told.sha256 is not None and told.sha256 != sha256:
            raise Problem(
                "hash-differs", f"Content-SHA256 is {told.sha256}, the body hashes to {sha256}; send it again"
            )
        self._blobs.keep(part)
        received = self._clock.now()
        taken = capture(told.captured, told.age, received)
        arrival = frames.Arrival(told.camera, sha256, taken.time, received, taken.clock, part.format, part.size)
        place = self._blobs.path(sha256)
        try:
            return Taken(*self._recorder.record(arrival, place.exists, archived=told.archived))
        except frames.BytesGone:
            detail = "the bytes were removed with an older frame of the same content; send it again"
            raise Problem("unavailable", detail, {"Retry-After": "1"}) from None


def full(blobs: Blobs) -> Problem:
    """The disk has no room for frames."""
    free, _ = blobs.free()
    detail = f"{free} bytes are free, which are kept for readings; delete something or add a disk, and send it again"
    return Problem("storage-full", detail, {"Retry-After": str(RETRY_S)})


def is_full(error: OperationalError) -> bool:
    """Whether a database could not write for want of room."""
    code = getattr(error.orig, "sqlite_errorcode", None)
    return code in (sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR_SHMSIZE, sqlite3.SQLITE_IOERR_WRITE)
