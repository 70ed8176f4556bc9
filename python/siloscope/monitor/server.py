"""The web server around the application: uvicorn on one socket."""

from __future__ import annotations

import contextlib
import signal
import socket
from collections.abc import Iterator

import uvicorn

from siloscope.errors import UsageError
from siloscope.monitor.api.app import create_app
from siloscope.monitor.service import Service

GRACE_S = 5
"""Open streams are cut off so long after a stop."""


def listening(host: str, port: int) -> socket.socket:
    """A socket that listens; raises `UsageError` where the address is taken."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    found = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)  # asyncio sets TCP_NODELAY by the protocol
    found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        found.bind((host, port))
    except OSError as error:
        found.close()
        raise UsageError(f"--bind {host}:{port}: {error.strerror}; give another address") from None
    found.listen(2048)
    return found


def run(service: Service, sock: socket.socket) -> None:
    """Serves until it is told to stop."""
    app = create_app(service)
    config = uvicorn.Config(
        app,
        log_level="warning",
        access_log=False,
        timeout_graceful_shutdown=GRACE_S,
        timeout_keep_alive=75,
        server_header=False,
        proxy_headers=False,
        lifespan="on",
    )
    _Server(config, app).run(sockets=[sock])


class _Server(uvicorn.Server):
    """Tells the streams to end before it waits for them."""

    def __init__(self, config: uvicorn.Config, app: object) -> None:
        super().__init__(config)
        self._app = app

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Being told to stop is no fault: the process ends with 0, where uvicorn would raise the signal again."""
        before = {number: signal.signal(number, self.handle_exit) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        stopping = getattr(self._app.state, "stopping", None)  # type: ignore[attr-defined]
        if stopping is not None:
            stopping.set()
        await super().shutdown(sockets)
