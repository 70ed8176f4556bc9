"""Servers that break their word, so that the tests of the word can fail."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

from siloscope.cli import main
from siloscope.monitor.store import engine, frames
from siloscope.monitor.store.engine import new_id
from siloscope.monitor.store.recording import Recorder


def acknowledge_first() -> None:
    """Frames are recorded a moment after they were acknowledged."""
    promised = threading.local()
    frames.__dict__["new_id"] = lambda: promised.id

    def later(self: Any, arrival: Any, there: Callable[[], bool], *, archived: bool = False) -> tuple[str, bool]:
        key, store = new_id(), self._store

        def work() -> None:
            time.sleep(0.2)
            promised.id = key
            with store.write() as connection:
                frames.record(store, connection, arrival, there, archived=archived)

        threading.Thread(target=work, daemon=True).start()
        return key, True

    setattr(Recorder, "record", later)  # noqa: B010


def no_flush() -> None:
    """Nothing is flushed to the disk."""
    os.__dict__["fsync"] = lambda _file: None
    durable = engine.__dict__["_durable_file"]

    def careless(connection: Any, record: Any) -> None:
        durable(connection, record)
        connection.execute("PRAGMA synchronous=OFF")

    engine.__dict__["_durable_file"] = careless


if __name__ == "__main__":
    {"acknowledge-first": acknowledge_first, "no-flush": no_flush}[sys.argv[1]]()
    sys.exit(main(sys.argv[2:]))
