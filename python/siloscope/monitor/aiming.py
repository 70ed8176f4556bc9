"""Which cameras somebody is aiming: those give frames in quick succession while their installer's view is open."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

LASTS_S = 30.0
"""So long after the view last asked, somebody still stands on the ladder."""

AIMED_S = 1.0
"""Between the frames of a camera that is being aimed."""


class Aiming:
    """Shared by the routes, which say what is looked at, and the live cameras, which hurry."""

    def __init__(self) -> None:
        self._until: dict[str, float] = {}
        self._changed = threading.Condition()

    def look(self, camera: str) -> None:
        """Says that somebody looks at a camera's pose."""
        with self._changed:
            self._until[camera] = time.monotonic() + LASTS_S
            self._changed.notify_all()

    def wanted(self, camera: str) -> bool:
        """Whether somebody does."""
        return self._until.get(camera, 0.0) > time.monotonic()

    def wait(self, camera: str, seconds: float, stopped: Callable[[], bool]) -> None:
        """Waits, less long where somebody looks or begins to."""
        with self._changed:
            if self.wanted(camera):
                self._changed.wait_for(stopped, min(seconds, AIMED_S))
            else:
                self._changed.wait_for(lambda: self.wanted(camera) or stopped(), seconds)

    def wake(self) -> None:
        """Has those who wait look whether they are to stop."""
        with self._changed:
            self._changed.notify_all()
