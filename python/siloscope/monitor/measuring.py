"""The measuring processes: each takes a waiting frame, measures it within its limits, and its reading is committed."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from sqlalchemy.exc import OperationalError

from siloscope import _core
from siloscope.monitor import worker
from siloscope.monitor.blobs import Blobs
from siloscope.monitor.clock import SECOND, Clock
from siloscope.monitor.settings import Limits
from siloscope.monitor.store import frames, places, readings
from siloscope.monitor.store.engine import Store
from siloscope.monitor.store.rows import Record
from siloscope.monitor.workers import CalibrationFiles, Lost, Process, camera_of

RETRY = 5 * SECOND
"""How long a frame rests that has ended its worker."""

LEASE = 3.0
"""After so many times the longest measurement, a frame's process is taken for gone."""

POLL_S = 1.0
"""How often the queue is looked at without being told of a frame."""


@dataclass(frozen=True)
class Known:
    """What a frame is measured with."""

    job: worker.MeasureJob
    calibration: str
    config: str


class Measuring:
    """Threads that keep the worker processes busy."""

    def __init__(
        self,
        store: Store,
        blobs: Blobs,
        files: CalibrationFiles,
        limits: Limits,
        clock: Clock,
        told: Callable[[str, int], None],
        idle_s: float,
    ) -> None:
        self._store, self._blobs, self._files, self._limits, self._clock = store, blobs, files, limits, clock
        self._told = told
        self._idle_s = idle_s
        self._wake, self._stop = threading.Condition(), threading.Event()
        self._threads: list[threading.Thread] = []
        self.seconds = 0.0
        self.count = 0

    def start(self, workers: int) -> None:
        """Starts the threads."""
        for number in range(workers):
            thread = threading.Thread(target=self._work, name=f"measuring-{number}", daemon=True)
            thread.start()
            self._threads.append(thread)

    def wake(self) -> None:
        """Says that a frame waits."""
        with self._wake:
            self._wake.notify()

    def stop(self) -> None:
        """Ends threads and processes; what they had in work is queued again at the next start."""
        self._stop.set()
        with self._wake:
            self._wake.notify_all()
        for thread in self._threads:
            thread.join(5)

    def _work(self) -> None:
        process, row = Process(self._limits), None
        try:
            while not self._stop.is_set():
                try:
                    row = row or frames.claim(self._store, *self._lease())
                    following = None if row is None else self._one(process, row)
                except OperationalError:  # a full disk or a busy database: the frame comes back after its lease
                    row = following = None
                if row is None:
                    self._rest(process)
                row = following
        finally:
            process.stop()

    def _lease(self) -> tuple[int, int]:
        """Now, and until when a frame that is claimed now belongs to this process."""
        now = self._clock.now()
        return now, now + int(LEASE * self._limits.measure_s * SECOND)

    def _rest(self, process: Process) -> None:
        if process.running and time.monotonic() - process.used > self._idle_s:
            process.stop()
        with self._wake:
            self._wake.wait(POLL_S)

    def _one(self, process: Process, row: Record) -> Record | None:
        """Measures a frame; the next one, which is claimed in the transaction that settles it."""
        known = self._known(row)
        if known is None:
            return self._settle(row, frames.GATHERING)
        try:
            found = process.answer(known.job, self._limits.measure_s)
        except Lost as lost:
            return self._after_loss(row, str(lost))
        if self._stop.is_set():
            return None
        if isinstance(found, worker.Unusable):
            return self._settle(row, frames.FAILED, error=found.message)
        return self._keep(row, known, found)

    def _after_loss(self, row: Record, reason: str) -> Record | None:
        if self._stop.is_set():
            return None
        if row.attempts >= self._limits.attempts:
            return self._settle(row, frames.FAILED, error=f"{reason}; tried {row.attempts} times")
        return self._settle(row, frames.QUEUED, error=reason, not_before=self._clock.now() + RETRY)

    def _known(self, row: Record) -> Known | None:
        """What the frame is measured with; None where its camera has no calibration yet."""
        with self._store.read() as connection:
            calibration = places.calibration_at(connection, row.camera, row.captured)
            if calibration is None:
                return None
            camera = places.get(connection, "camera", row.camera)
            silo = places.get(connection, "silo", row.silo)
            if camera is None or silo is None:
                return None
            product = places.product_at(connection, row.silo, row.captured)
        content = None if product is None else product.document
        config = worker.digest({"vessel": silo.vessel, "product": content, "camera": camera_of(camera).__dict__})
        file = self._files.of(calibration)
        job = worker.MeasureJob(self._blobs.path(row.sha256), camera_of(camera), file, dict(silo.vessel), content)
        return Known(job, calibration.id, config)

    def _settle(self, row: Record, state: str, **more: Any) -> Record | None:
        with self._store.write() as connection:
            frames.settle(connection, row.id, row.silo, state, self._clock.now(), **more)
            following = frames.claimed(connection, *self._lease())
        self._told(row.silo, row.captured)
        return following

    def _keep(self, row: Record, known: Known, found: worker.Measured) -> Record | None:
        now = self._clock.now()
        with self._store.write() as connection:
            origin = "measured" if row.run is None else "recomputed"
            run = row.run or readings.run_of(connection, _core.__version__, known.config, origin, now)
            values = {
                **found.values,
                "frame": row.id,
                "silo": row.silo,
                "camera": row.camera,
                "time": row.captured,
                "clock": row.clock,
                "run": run,
                "calibration": known.calibration,
            }
            readings.add(connection, values, found.surface, now)
            frames.settle(connection, row.id, row.silo, frames.MEASURED, now, error=None)
            following = frames.claimed(connection, *self._lease())
        self.seconds += found.seconds
        self.count += 1
        self._told(row.silo, row.captured)
        return following
