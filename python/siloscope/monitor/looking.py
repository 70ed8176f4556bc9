"""Looking at one frame on request: its picture, and the pose that it shows alone.

It is done by a process of its own, so that no file from outside is decoded in the server, and measuring goes on.
"""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from pathlib import Path

from siloscope.monitor import worker
from siloscope.monitor.settings import Limits
from siloscope.monitor.workers import Process

KEPT = 64
"""Frames of which what was seen is remembered."""


class Looking:
    """One process, started by the first request and ended when nobody looks any more."""

    def __init__(self, limits: Limits, idle_s: float) -> None:
        self._limits, self._idle_s = limits, idle_s
        self._process, self._lock = Process(limits), threading.Lock()
        self._seen: OrderedDict[str, worker.Looked | worker.Unusable] = OrderedDict()

    def at(self, frame: str, path: Path, camera: worker.CameraSettings) -> worker.Looked | worker.Unusable:
        """What a frame shows; the last frames that were looked at cost nothing. Raises `workers.Lost`."""
        with self._lock:
            found = self._seen.get(frame)
            if found is None:
                found = self._process.answer(worker.LookJob(path, camera), self._limits.measure_s)
                self._seen[frame] = found
            self._seen.move_to_end(frame)
            if len(self._seen) > KEPT:
                self._seen.popitem(last=False)
            return found

    def rest(self) -> None:
        """Ends the process where nobody has looked for long."""
        with self._lock:
            if self._process.running and time.monotonic() - self._process.used > self._idle_s:
                self._process.stop()

    def stop(self) -> None:
        """Ends the process."""
        with self._lock:
            self._process.stop()
