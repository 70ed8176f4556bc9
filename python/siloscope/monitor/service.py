"""The parts of a running service, put together; started and stopped in order."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from sqlalchemy.exc import OperationalError

from siloscope import _core
from siloscope.monitor import site
from siloscope.monitor.aiming import Aiming
from siloscope.monitor.alerts import Alerting, add_defaults
from siloscope.monitor.blobs import Blobs
from siloscope.monitor.calibrating import Calibrating
from siloscope.monitor.clock import DAY, Clock, SystemClock
from siloscope.monitor.intake import Intake
from siloscope.monitor.lock import Lock
from siloscope.monitor.looking import Looking
from siloscope.monitor.measuring import Measuring
from siloscope.monitor.outbox import Outbox
from siloscope.monitor.outlets import Outlets
from siloscope.monitor.retention import Keeper
from siloscope.monitor.settings import Settings
from siloscope.monitor.store import changes, frames, places, readings
from siloscope.monitor.store.engine import Store, new_id, opened
from siloscope.monitor.store.leader import PUBLISHING, Leadership
from siloscope.monitor.story import Storyteller
from siloscope.monitor.workers import CalibrationFiles

TOLD = "told_change"
"""The fact that says up to which change stories and rules are told, where several processes share a database."""

FOLLOWED = 2000
"""Changes that are looked at in a beat."""

BEAT_S = 1.0
"""How often what readings changed is told anew."""


@dataclass(frozen=True)
class Swept:
    """What the start found and put right."""

    stray: int
    """Unfinished files."""
    requeued: int
    """Frames that were in a worker."""
    damaged: int
    """Frames of the last day whose bytes are gone or wrong."""


class Part(Protocol):
    """Something that runs while the service does."""

    def start(self) -> None:
        """Begins."""

    def stop(self) -> None:
        """Ends."""


class Service:
    """Everything but the web server."""

    def __init__(self, settings: Settings, clock: Clock | None = None) -> None:
        settings.data.mkdir(parents=True, exist_ok=True)
        self.settings = settings
        self.clock = clock or SystemClock()
        self.lock = Lock(settings.data / "lock", shared=not settings.url.startswith("sqlite"))
        self.store: Store = opened(settings.url)
        self._leadership = Leadership(self.store, PUBLISHING)
        self.leads = self.store.is_sqlite
        """Whether this process tells stories, fires alerts and publishes; of several on a database one does."""
        self.blobs = Blobs(settings.data / "frames")
        self.outbox = Outbox(self.store)
        self.intake = Intake(self.store, self.blobs, settings.limits, self.clock)
        self.files = CalibrationFiles(settings.data / "calibrations")
        self.measuring = Measuring(
            self.store, self.blobs, self.files, settings.limits, self.clock, self.changed, settings.idle_s
        )
        self.calibrating = Calibrating(self.store, self.blobs, settings.limits, self.clock, self.measuring.wake)
        self.looking = Looking(settings.limits, settings.idle_s)
        self._stories, self._alerting = Storyteller(self.store), Alerting(self.store, self.outbox)
        self._keeper = Keeper(self.store, self.blobs, settings.limits, settings.retention, self.clock)
        self._dirty: dict[str, int] = {}
        self._was_short = False
        self._lock, self._stopping = threading.Lock(), threading.Event()
        self._threads: list[threading.Thread] = []
        self.parts: list[Part] = []
        """What else runs, such as the publishers."""
        self.outlets = Outlets()
        self.live: dict[str, tuple[str, Path]] = {}
        """Cameras that the service drives: their source, and the folder where its paths begin."""
        self.aiming = Aiming()
        self.listeners: list[Callable[[], None]] = []
        """Called when something changed, from any thread."""
        self.started = self.clock.now()

    def prepare(self) -> Swept:
        """Sweeps, requeues, applies SITE.toml."""
        now = self.clock.now()
        swept = self._tidied(now) if self.lock.alone else Swept(0, 0, 0)
        with self.store.write() as connection:
            if places.fact(connection, "box") is None:
                places.set_fact(connection, "box", new_id())
            add_defaults(connection, now)
            if self.settings.site is not None:
                found = site.read(self.settings.site)
                site.apply(connection, found, self.settings.site, now)
                self.outlets = found
                self.live = found.live(self.settings.site.parent)
        self.live |= {camera: (source, Path()) for camera, source in self.settings.live}
        self.lock.share()
        return swept

    def _tidied(self, now: int) -> Swept:
        """What the first process on the folder does; of others on the database, frames may be in work."""
        self.files.clear()
        since = None if self.store.is_sqlite else now
        return Swept(self.blobs.sweep(), frames.requeue_interrupted(self.store, since), self._check_recent(now))

    def _check_recent(self, now: int) -> int:
        """Fails the waiting frames of the last day whose bytes can't be relied on."""
        with self.store.read() as connection:
            recent = frames.received_since(connection, now - DAY)
        damaged = [row for row in recent if not self.blobs.intact(row.sha256)]
        for row in damaged:
            with self.store.write() as connection:
                why = "the stored bytes are gone or damaged; send the frame again"
                frames.settle(connection, row.id, row.silo, frames.FAILED, now, error=why, kept=False)
        return len(damaged)

    def start(self) -> None:
        """Starts workers and the beat."""
        if self.settings.workers:
            self.measuring.start(self.settings.workers)
            self.calibrating.start()
        thread = threading.Thread(target=self._run, name="beat", daemon=True)
        thread.start()
        self._threads.append(thread)
        for part in self.parts:
            part.start()

    def stop(self) -> None:
        """Ends them all."""
        for part in self.parts:
            part.stop()
        self._stopping.set()
        self.measuring.stop()
        self.calibrating.stop()
        self.looking.stop()
        for thread in self._threads:
            thread.join(5)
        self._leadership.release()
        self.store.close()
        self.lock.release()

    def changed(self, silo: str, time: int) -> None:
        """Says that a silo's readings changed at a time: its story is told anew from there."""
        if self.store.is_sqlite:
            self._remember({silo: time})
        self.calibrating.wake()
        self.announce()

    def _remember(self, dirty: dict[str, int]) -> None:
        with self._lock:
            for silo, time in dirty.items():
                self._dirty[silo] = min(time, self._dirty.get(silo, time))

    def recompute(self, silo: str, who: str) -> tuple[int, int]:
        """Queues a silo's frames that are still there as a new run; the run, and how many frames."""
        with self.store.write() as connection:
            now = self.clock.now()
            run = readings.run_of(connection, _core.__version__, silo, "recomputed", now, f"asked for by {who}")
            cameras = [row for row in places.listed(connection, "camera") if row.silo == silo]
            count = sum(frames.requeue(connection, row.id, (0, None), run) for row in cameras)
        self.measuring.wake()
        return run, count

    def has_room(self) -> bool:
        """Whether frames are taken."""
        free, total = self.blobs.free()
        limits = self.settings.limits
        return free >= min(limits.reserve, int(limits.reserve_fraction * total))

    def _tell_of_room(self, now: int) -> None:
        """Notes that the disk has become short of room, or has room again, so that the page says so."""
        short = not self.has_room()
        if short == self._was_short:
            return
        with self.store.write() as connection:
            changes.note(connection, "site", "disk", None, now)
        self._was_short = short
        self.announce()

    def announce(self) -> None:
        """Says that the log of changes has grown."""
        for listener in list(self.listeners):
            listener()

    def _run(self) -> None:
        ticked = kept = 0
        while not self._stopping.wait(BEAT_S):
            now = self.clock.now()
            self.leads = self._leadership.held()
            try:
                self._follow()
                self.beat()
                if now - kept >= self.settings.retention.every or not self.has_room():
                    kept = now
                    self._keeper.keep()
                self._tell_of_room(now)
            except OperationalError:
                continue  # a full disk or a busy database: the next beat tries again
            if self.leads and now - ticked >= self.settings.tick:
                ticked = now
                self.tick()

    def _follow(self) -> None:
        """Learns from the log of changes what readings came, whichever process measured them.

        How far it is told is noted in the database, so that whoever takes over goes on there.
        """
        if self.store.is_sqlite or not self.leads:
            return
        with self.store.read() as connection:
            cursor = int(places.fact(connection, TOLD) or 0)
            rows = changes.after(connection, cursor, FOLLOWED)
            numbers = [int(row.subject) for row in rows if row.kind == "reading" and row.subject.isdecimal()]
            first = readings.first_times(connection, numbers)
        self._remember(first)
        if rows:
            self.beat()
            with self.store.write() as connection:
                places.set_fact(connection, TOLD, int(rows[-1].id))

    def beat(self) -> None:
        """Stories and rules of the silos whose readings changed."""
        with self._lock:
            dirty, self._dirty = self._dirty, {}
        told = False
        while dirty:
            silo, since = dirty.popitem()
            try:
                self._stories.tell(silo, since, self.clock.now())
                self._alerting.look(silo, self.clock.now())
            except OperationalError:
                self._remember({**dirty, silo: since})
                raise
            told = True
        if told:
            self.announce()

    def tick(self) -> None:
        """Rules of all silos, for what has not come."""
        self.looking.rest()
        frames.requeue_interrupted(self.store, self.clock.now())
        with self.store.read() as connection:
            silos = [row.id for row in places.listed(connection, "silo")]
            before = changes.newest(connection)
        for silo in silos:
            self._alerting.look(silo, self.clock.now())
        with self.store.read() as connection:
            if changes.newest(connection) != before:
                self.announce()
