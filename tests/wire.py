"""A line between a client and a server on this machine that tests cut and mend."""

from __future__ import annotations

import socket
import threading
from typing import Any


class Wire:
    """A line to the service that can be cut, and that notes what goes over it."""

    def __init__(self, root: str) -> None:
        self._target = int(root.rsplit(":", 1)[1])
        self._open: list[socket.socket] = []
        self.sent: list[bytes] = []
        self.whole = True
        self.budget: int | None = None
        """After so many bytes from the client the line is cut, in the middle of whatever is under way."""
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.root = f"http://127.0.0.1:{self._listener.getsockname()[1]}"
        threading.Thread(target=self._listen, daemon=True).start()

    def cut(self) -> None:
        """Ends all connections; new ones end at once."""
        self.whole = False
        for one in self._open:
            try:
                one.shutdown(socket.SHUT_RDWR)
            except OSError:
                continue
        self._open.clear()

    def mend(self) -> None:
        """New connections go through again."""
        self.whole = True

    def asked(self, text: bytes, page: Any) -> bytes:
        """What was sent in lower case, once `text` is in it or after 10 s: a page says that it sends before it does."""
        for _ in range(100):
            if text in (sent := b"".join(self.sent).lower()):
                break
            page.wait_for_timeout(100)
        return sent

    def close(self) -> None:
        """Ends it."""
        self.cut()
        self._listener.close()

    def _listen(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            if not self.whole:
                client.close()
                continue
            server = socket.create_connection(("127.0.0.1", self._target))
            self._open += [client, server]
            for source, sink in ((client, server), (server, client)):
                threading.Thread(target=self._carry, args=(source, sink, source is client), daemon=True).start()

    def _spend(self, count: int) -> None:
        if self.budget is not None:
            self.budget -= count
            if self.budget < 0:
                self.budget = None
                self.cut()

    def _carry(self, source: socket.socket, sink: socket.socket, note: bool) -> None:
        try:
            while data := source.recv(65_536):
                if note:
                    self.sent.append(data)
                    self._spend(len(data))
                sink.sendall(data)
        except OSError:
            return
        finally:
            for one in (source, sink):
                try:
                    one.shutdown(socket.SHUT_RDWR)
                except OSError:
                    continue
