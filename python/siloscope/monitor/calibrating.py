"""Calibrations in the background: from frames that wait for one, and from frames since a camera moved.

What is found is proposed; a person's word makes it the camera's, and the frames are measured with it.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from siloscope import _core
from siloscope.monitor import worker
from siloscope.monitor.blobs import Blobs
from siloscope.monitor.clock import Clock
from siloscope.monitor.settings import Limits
from siloscope.monitor.store import frames, places, readings
from siloscope.monitor.store.engine import Store
from siloscope.monitor.store.leader import CALIBRATING, Leadership
from siloscope.monitor.workers import Lost, Process, camera_of

FEWEST = 8
"""Frames for a first proposal; the next is made from twice as many."""

MOST = 256
"""Frames of a proposal; of more, evenly spread ones are taken."""

MOVED = 3
"""Readings in a row that say that the camera moved before it is believed."""

POLL_S = 5.0


class Calibrating:
    """One thread and one process for calibrations."""

    def __init__(self, store: Store, blobs: Blobs, limits: Limits, clock: Clock, wake: Callable[[], None]) -> None:
        self._store, self._blobs, self._limits, self._clock, self._wake_measuring = store, blobs, limits, clock, wake
        self._wake, self._stopping = threading.Event(), threading.Event()
        self._process = Process(limits)
        self._tried: dict[str, int] = {}
        self._leadership = Leadership(store, CALIBRATING)
        self._thread = threading.Thread(target=self._work, name="calibrating", daemon=True)

    def start(self) -> None:
        """Starts the thread."""
        self._thread.start()

    def wake(self) -> None:
        """Says that frames have come."""
        self._wake.set()

    def stop(self) -> None:
        """Ends thread and process."""
        self._stopping.set()
        self._wake.set()
        self._process.stop()
        if self._thread.is_alive():
            self._thread.join(5)
        self._leadership.release()

    def _work(self) -> None:
        while not self._stopping.is_set():
            self._wake.wait(60.0)
            self._wake.clear()
            if not self._stopping.wait(POLL_S) and self._leadership.held():
                self.look()

    def look(self) -> None:
        """Proposes calibrations for the cameras that have frames for one."""
        with self._store.read() as connection:
            cameras = places.listed(connection, "camera")
        for camera in cameras:
            self._note_move(camera)
            self._propose(camera)
        self._process.stop()

    def _note_move(self, camera: Any) -> None:
        """Opens a new calibration where the newest readings say that the camera moved."""
        if camera.moved_since is not None:
            return
        with self._store.read() as connection:
            newest = readings.newest_of_camera(connection, camera.id, MOVED)
        if len(newest) < MOVED or not all(moved(reading) for reading in newest):
            return
        with self._store.write() as connection:
            places.set_moved(connection, camera.id, newest[-1].time, self._clock.now())

    def _propose(self, camera: Any) -> None:
        with self._store.read() as connection:
            camera = places.get(connection, "camera", camera.id)
            rows = frames.gathering(connection, camera.id, camera.moved_since)
            silo = places.get(connection, "silo", camera.silo)
            before = places.proposed(connection, camera.id)
        tried = max(self._tried.get(camera.id, 0), 0 if before is None else before.frames)
        if silo is None or len(rows) < max(FEWEST, 2 * tried):
            return
        self._tried[camera.id] = len(rows)
        chosen = rows[:: -(-len(rows) // MOST)]
        paths = tuple(self._blobs.path(row.sha256) for row in chosen)
        job = worker.CalibrateJob(paths, camera_of(camera), dict(silo.vessel))
        try:
            found = self._process.answer(job, self._limits.calibrate_s)
        except Lost:
            return
        if isinstance(found, worker.Calibrated) and found.ok:
            self._keep(camera, found.document, rows)

    def _keep(self, camera: Any, document: dict[str, Any], rows: Any) -> None:
        now = self._clock.now()
        with self._store.write() as connection:
            before = places.proposed(connection, camera.id)
            if before is not None:
                places.reject(connection, before.id, "replaced by one of more frames", now)
            origin = "gathered" if camera.moved_since is None else "moved"
            row = {"origin": origin, "state": places.PROPOSED, "frames": len(rows), "valid_from": rows[0].captured}
            places.add_calibration(connection, camera.silo, camera.id, document, now, **row)

    def confirm(self, key: str, who: str) -> bool:
        """Makes a proposed calibration the camera's and measures its frames with it; whether there was one."""
        with self._store.write() as connection:
            found = places.confirm(connection, key, who, self._clock.now())
            if found is None:
                return False
            places.set_moved(connection, found.camera, None, self._clock.now())
            run = readings.run_of(
                connection, _core.__version__, found.sha256, "recomputed", self._clock.now(), "confirmed"
            )
            frames.requeue(connection, found.camera, (found.valid_from, found.valid_to), run)
        self._tried.pop(found.camera, None)
        self._wake_measuring()
        return True


def moved(reading: Any) -> bool:
    """Whether a reading says that its camera moved."""
    return reading.reason == "camera-moved" or any(remark["code"] == "camera-moved" for remark in reading.quality)
