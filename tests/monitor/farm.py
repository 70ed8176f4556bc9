"""A service in this process with readings made by hand, for what tells others of them."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import uvicorn

from siloscope import _core
from siloscope.monitor import access, server
from siloscope.monitor.alerts import Alerting
from siloscope.monitor.api.app import create_app
from siloscope.monitor.clock import DAY, HOUR, SECOND, SetClock
from siloscope.monitor.publish.attach import attach
from siloscope.monitor.service import Service
from siloscope.monitor.settings import Settings
from siloscope.monitor.store import frames, people, places, readings
from siloscope.monitor.store.recording import Recorder

NOON = 1_798_718_400 * SECOND
"""2026-12-31 12:00 UTC, µs; the first reading is a second later."""

SILOS = """[site]
name = "Test"
[[place]]
id = "farm"
name = "Farm North"
[[silo]]
id = "silo7"
place = "farm"
name = "Silo 7"
serial = 4711
modbus_unit = 7
stale_after_s = 7200
[[silo]]
id = "silo8"
modbus_unit = 8
[[camera]]
id = "cam7"
silo = "silo7"
[[camera]]
id = "cam8"
silo = "silo8"
"""


class Farm(Service):
    """A service whose clock stands until it is set."""

    clock: SetClock


def make(folder: Path, more: str = "", *, clock: SetClock | None = None, silos: str = SILOS) -> Farm:
    """A prepared service that is not started, with what `more` adds to its SITE.toml; a table begins `more`."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "SITE.toml").write_text(silos + more)
    clock = clock or SetClock(NOON)
    service = Farm(replace(Settings(folder / "data"), site=folder / "SITE.toml", workers=0), clock)
    service.prepare()
    attach(service)
    return service


def reading(service: Farm, silo: str = "silo7", *, time: int | None = None, fill: float = 0.5, **more: Any) -> int:
    """Adds an answered reading of a silo of 20 m³, a second after what was before."""
    service.clock.time += SECOND
    now = service.clock.now()
    volume = 20.0 * fill
    values = {
        "silo": silo,
        "camera": f"cam{silo[-1]}",
        "time": now if time is None else time,
        "clock": "good",
        "status": "ok",
        "volume": volume,
        "volume_std": 0.1,
        "own_std": 0.05,
        "ullage": 20.0 - volume,
        "ullage_std": 0.1,
        "fill": fill,
        "capacity": 20.0,
        "mass": 770.0 * volume,
        "mass_std": 100.0,
        "density": 770.0,
        "level": 3.0,
        "level_min": 2.5,
        "level_max": 3.5,
        "level_axis": 3.2,
        "level_std": 0.01,
        "distance": 4.0,
        "distance_min": 3.5,
        "distance_max": 4.5,
        "datum": "bottom",
        "coverage": 0.9,
        "quality": [],
    } | more
    with service.store.write() as connection:
        values["run"] = readings.run_of(connection, _core.__version__, "test", "measured", now)
        return readings.add(connection, values, None, now)


def forecast(service: Farm, silo: str = "silo7", days: float = 3.0) -> None:
    """Says when a silo will be empty."""
    now = service.clock.now()
    row = {"time": now, "daily": 3.0, "daily_std": 0.1, "day_to_day": 0.2, "empty_by": now + int(days * DAY)}
    with service.store.write() as connection:
        readings.replace_forecast(connection, silo, row | {"earliest": now + DAY, "latest": now + 5 * DAY})


def close(service: Farm) -> None:
    """Lets go of a service that was not started."""
    service.store.close()
    service.lock.release()


def look(service: Farm, silo: str = "silo7") -> None:
    """Lets the rules see a silo."""
    Alerting(service.store, service.outbox).look(silo, service.clock.now())


def gone(service: Farm, silo: str) -> None:
    """Removes a silo."""
    with service.store.write() as connection:
        places.remove(connection, "silo", silo, service.clock.now())


def rule(channel: str, kind: str = "low") -> str:
    """A rule of SITE.toml."""
    return f'[[rule]]\nid = "{kind}"\nkind = "{kind}"\nchannels = {json.dumps([channel])}\n'


LATE = 3 * HOUR
"""Longer than silo 7's readings are fresh."""


def measured(service: Farm, time: int, *, silo: str = "silo7", status: str = "ok", **more: Any) -> int:
    """Adds a reading of a frame whose bytes are there."""
    content = b"\x89PNG\r\n\x1a\n" + f"{silo} {time} {more}".encode()
    with service.blobs.receiving() as part:
        part.add(content)
        service.blobs.keep(part)
    arrival = frames.Arrival(f"cam{silo[-1]}", part.sha256, time, time, "good", "png", len(content))
    frame, _ = Recorder(service.store).record(arrival, lambda: True)
    with service.store.write() as connection:
        frames.settle(connection, frame, silo, frames.MEASURED, time)
    return reading(service, silo, time=time, frame=frame, status=status, **more)


@contextmanager
def listening(service: Farm) -> Iterator[str]:
    """The service's web server in a thread of this process; its address."""
    sock = server.listening("127.0.0.1", 0)
    config = uvicorn.Config(create_app(service), log_level="warning", timeout_graceful_shutdown=1)
    web = uvicorn.Server(config)
    thread = threading.Thread(target=web.run, kwargs={"sockets": [sock]}, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{sock.getsockname()[1]}"
    finally:
        web.should_exit = True
        thread.join(30)


def token(service: Farm, role: str) -> str:
    """A token of a service."""
    secret = access.new_secret(role)
    with service.store.write() as connection:
        people.add_token(connection, access.hash_of(secret), role, None, role, service.clock.now())
    return secret
