"""A part of the service with an event loop of its own, in a thread of its own: it never holds up intake or the page."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from abc import ABC, abstractmethod

STOP_S = 5.0


class AsyncPart(ABC):
    """Runs `main` from `start` to `stop`."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._thread: threading.Thread | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._task: asyncio.Task[None] | None = None
        self._ready = threading.Event()

    @abstractmethod
    async def main(self) -> None:
        """Runs until it is cancelled."""

    @property
    def loop(self) -> asyncio.AbstractEventLoop | None:
        """Its event loop while it runs."""
        return self._loop

    def start(self) -> None:
        """Starts the thread."""
        self._thread = threading.Thread(target=lambda: asyncio.run(self._run()), name=self._name, daemon=True)
        self._thread.start()
        self._ready.wait(STOP_S)

    def stop(self) -> None:
        """Cancels `main` and waits for its end."""
        if self._thread is None or self._loop is None or self._task is None:
            return
        with contextlib.suppress(RuntimeError):  # the loop has ended already
            self._loop.call_soon_threadsafe(self._task.cancel)
        self._thread.join(STOP_S)
        self._thread = None

    async def _run(self) -> None:
        self._loop, self._task = asyncio.get_running_loop(), asyncio.current_task()
        self._ready.set()
        try:
            with contextlib.suppress(asyncio.CancelledError):
                await self.main()
        finally:
            self._loop = None
