"""Who of several processes on one database does what only one may do: tell stories, fire alerts, publish."""

from __future__ import annotations

import threading

from sqlalchemy import Connection, text
from sqlalchemy.exc import DBAPIError, InvalidRequestError

from siloscope.monitor.store.engine import Store

PUBLISHING, CALIBRATING = 8481, 8482
"""PostgreSQL's advisory locks of the two offices."""

PATIENCE = "SET tcp_keepalives_idle = 10; SET tcp_keepalives_interval = 5; SET tcp_keepalives_count = 3"
"""So soon the server notices that a leader's machine is gone."""


class Leadership:
    """An office that one process holds at a time, as long as its connection lasts.

    With SQLite there is one process, which has it. With PostgreSQL it is a lock of a session: the server drops it with
    the process that held it, and the next one that asks takes over.
    """

    def __init__(self, store: Store, key: int) -> None:
        self._store, self._key = store, key
        self._connection: Connection | None = None
        self._lock = threading.Lock()

    def held(self) -> bool:
        """Whether this process has it; takes it where nobody has."""
        if self._store.is_sqlite:
            return True
        with self._lock:
            try:
                if self._connection is not None:
                    self._connection.execute(text("SELECT 1"))
                    return True
                return self._take()
            except (DBAPIError, InvalidRequestError):
                self._drop()
                return False

    def _take(self) -> bool:
        connection = self._store.engine.connect().execution_options(isolation_level="AUTOCOMMIT")
        for word in PATIENCE.split(";"):
            connection.execute(text(word))
        if connection.execute(text(f"SELECT pg_try_advisory_lock({self._key})")).scalar():
            self._connection = connection
            return True
        connection.close()
        return False

    def release(self) -> None:
        """Lets another process have it."""
        with self._lock:
            self._drop()

    def _drop(self) -> None:
        """Ends the session, not only its use: the pool would keep the lock."""
        if self._connection is not None:
            self._connection.invalidate()
            self._connection.close()
        self._connection = None
