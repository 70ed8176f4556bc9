"""Worker processes: started with their first job, ended when they take too long, and started again."""

from __future__ import annotations

import multiprocessing
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from siloscope.monitor import worker
from siloscope.monitor.settings import Limits
from siloscope.monitor.store import places
from siloscope.schema.files import write_json

ENDED = "the measurement ended its process (out of memory, or a fault)"
TOO_LONG = "the measurement took longer than {:g} s"


class Lost(Exception):
    """The worker has ended without an answer."""


class Process:
    """A worker process that starts with its first job and again after it was lost."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._pipe: Connection | None = None
        self._process: Any = None
        self.used = time.monotonic()

    def answer(self, job: worker.Job, seconds: float) -> Any:
        """The answer of a job; raises `Lost` where the process ends or takes longer."""
        pipe = self._started()
        try:
            pipe.send(job)
            if not pipe.poll(seconds):
                raise Lost(TOO_LONG.format(seconds))
            return pipe.recv()
        except (EOFError, OSError):
            raise Lost(ENDED) from None
        except Lost:
            self.stop()
            raise
        finally:
            self.used = time.monotonic()
            if self._process is not None and not self._process.is_alive():
                self.stop()

    @property
    def running(self) -> bool:
        """Whether there is a process."""
        return self._process is not None

    def _started(self) -> Connection:
        if self._pipe is None:
            context = multiprocessing.get_context("spawn")
            self._pipe, theirs = context.Pipe()
            arguments = (theirs, self._limits.memory)
            self._process = context.Process(target=worker.serve, args=arguments, daemon=True, name="siloscope-worker")
            self._process.start()
            theirs.close()
        return self._pipe

    def stop(self) -> None:
        """Ends the process."""
        if self._pipe is not None:
            self._pipe.close()
        if self._process is not None:
            self._process.kill()
            self._process.join(5)
        self._pipe = self._process = None


class CalibrationFiles:
    """Calibrations as files, as the workers read them; made from the store whenever one is missing.

    They are made anew after every start: a power cut may have left an empty one under a whole name.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True)

    def clear(self) -> None:
        """Removes them all."""
        for left in self._folder.glob("*.json"):
            left.unlink()

    def of(self, row: Any) -> Path:
        """The file of a calibration's row."""
        path = self._folder / f"{row.id}.json"
        if not path.exists():
            write_json(path, places.document(row))
        return path


def camera_of(row: Any) -> worker.CameraSettings:
    """A camera's row as a worker needs it."""
    return worker.CameraSettings(row.intrinsics, row.sensor, row.depth_unit)
