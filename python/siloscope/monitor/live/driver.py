"""One camera that the service drives: its frames go the way that all frames go; a source that fails is begun again."""

from __future__ import annotations

import hashlib
import threading
import time
from collections.abc import AsyncIterator
from contextlib import suppress
from functools import partial

import anyio
from sqlalchemy import Connection
from sqlalchemy.exc import OperationalError

from siloscope.errors import SiloscopeError
from siloscope.monitor.aiming import AIMED_S
from siloscope.monitor.intake import Told
from siloscope.monitor.live.captures import Capture, LiveSource
from siloscope.monitor.problems import Problem
from siloscope.monitor.service import Service
from siloscope.monitor.store import live, places

USUAL_S = 600.0
"""Between frames, where the camera names no interval."""

FIRST_WAIT_S, LAST_WAIT_S = 2.0, 300.0
"""After a failure; doubled each time."""

RETRY_S = 30.0
"""Before a frame for which there was no room is offered again."""

PASSING = (429, 503, 507)
"""What the intake refuses for a while."""

FOLLOW_S = 1.0
"""How often a process that does not lead looks whether it does now."""


class Driver:
    """Keeps a camera's source going, in a thread of its own."""

    def __init__(self, service: Service, camera: str, source: LiveSource) -> None:
        self._service, self._camera, self._source = service, camera, source
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"live {camera}", daemon=True)
        self._told: tuple[str, str | None] | None = None
        self._refused = False
        """Whether the last frame was none."""

    def start(self) -> None:
        """Begins."""
        self._thread.start()

    def stop(self) -> None:
        """Ends after the frame that is under way."""
        self._stopping.set()
        self._service.aiming.wake()
        self._thread.join(10)

    def _run(self) -> None:
        failures = 0
        while not self._stopping.is_set():
            if not self._service.leads:
                self._stopping.wait(FOLLOW_S)
                continue
            begun = time.monotonic()
            try:
                self._round()
                failures = 0
                self._rest((self._source.poll_s or self._interval()) - (time.monotonic() - begun))
            except (SiloscopeError, OSError) as error:
                failures += 1
                self._fail(str(error), failures)
            except OperationalError:  # a full disk or a busy database
                self._rest(FIRST_WAIT_S)
        self._source.close()

    def _fail(self, problem: str, failures: int) -> None:
        """Says why, and waits, the longer the more often it has failed."""
        with suppress(OperationalError):
            self._tell(live.FAILING, problem)
        self._rest(min(LAST_WAIT_S, FIRST_WAIT_S * 2.0 ** (failures - 1)))

    def _rest(self, seconds: float) -> None:
        self._service.aiming.wait(self._camera, seconds, self._stopping.is_set)

    def _interval(self) -> float:
        """Seconds between frames, as they are set now."""
        if self._service.aiming.wanted(self._camera):
            return AIMED_S
        with self._service.store.read() as connection:
            row = places.get(connection, "camera", self._camera)
        return USUAL_S if row is None or row.expected_s is None else float(row.expected_s)

    def _round(self) -> None:
        """Every frame that is due; raises what the source does."""
        for capture in self._source.captures(self._interval(), self._stopping.is_set):
            problem = self._delivered(capture)
            self._refused = problem is not None
            self._tell(live.FAILING if self._refused else live.OK, problem)
        if not self._refused:
            self._tell(live.OK, None)

    def _delivered(self, capture: Capture) -> str | None:
        """Offers a frame until it is safe; why it never will be."""
        sha256 = hashlib.sha256(capture.body).hexdigest()
        told = Told(self._camera, sha256, capture.time, length=len(capture.body))
        while not self._stopping.is_set():
            try:
                taken = anyio.run(partial(self._service.intake.take, told, _once(capture.body), self._known))
            except Problem as problem:
                if problem.status not in PASSING:
                    capture.refused()
                    return f"{capture.name}: {problem.detail}"
                self._tell(live.FAILING, problem.detail)
                self._stopping.wait(RETRY_S)
                continue
            if taken.new:
                self._service.measuring.wake()
            capture.safe()
            return None
        return None

    def _known(self, connection: Connection) -> None:
        if places.get(connection, "camera", self._camera) is None:
            raise Problem("not-found", f"there is no camera '{self._camera}' any more")

    def _tell(self, state: str, problem: str | None) -> None:
        """Notes how the camera fares, for the page and for readiness."""
        if self._told == (state, problem):
            return
        with self._service.store.write() as connection:
            live.tell(connection, self._camera, state, problem, self._service.clock.now())
        self._told = state, problem
        self._service.announce()


async def _once(body: bytes) -> AsyncIterator[bytes]:
    yield body
