"""A box at the edge and its hub: what is measured goes up, settings come down; nothing is lost while the link is.

Two lanes lead up: the newest readings first, so that the hub shows what is; and, at a rate, what it missed, the oldest
first. What the hub has acknowledged is noted by number of reading, so a restart goes on where it was.
"""

from __future__ import annotations

import base64
import threading
import time
from pathlib import Path
from typing import Any

from sqlalchemy.exc import OperationalError

from siloscope.client import Client, ServiceError
from siloscope.monitor.clock import CORRECTED
from siloscope.monitor.epochs import Epochs, Uptime, uptime
from siloscope.monitor.outlets import EdgeEntry
from siloscope.monitor.service import Service
from siloscope.monitor.store import alerts, changes, hub, places, readings, sync
from siloscope.monitor.store.engine import Store

BATCH = 50
"""Readings of a request."""

FILES = 5
"""Frames of a round."""

LOOK_S = 1.0
SETTINGS_S = 10.0
"""How often the hub is asked for changed settings."""

FIRST_WAIT_S, LAST_WAIT_S = 2.0, 120.0
"""After a failure; doubled each time."""

SETTINGS, ACKNOWLEDGED, SENT = "hub_settings", "hub_alerts", "hub_calibrations"
"""Facts: the hub's change up to which its settings are known; our change up to which our acknowledgements are told;
the calibrations that the hub has."""

CHANGES = frozenset(("place", "product", "silo", "camera", "rule", "calibration"))
"""Kinds of the hub's changes that settings are made of."""


class Edge:
    """Keeps the link with the hub."""

    def __init__(self, service: Service, client: Client, entry: EdgeEntry, told: Uptime | None = None) -> None:
        self._service, self._client, self._entry = service, client, entry
        self._store: Store = service.store
        self.epochs = Epochs(service.store, service.clock, told or uptime())
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="edge", daemon=True)
        self.asked = float("-inf")
        self._known: int | None = None
        """The hub's change up to which its settings are applied since the start."""
        self._allowed, self._last = 0.0, time.monotonic()
        self.problem: str | None = None
        """Why the link does not work; None while it does."""
        with service.store.write() as connection:
            places.set_fact(connection, sync.HUB, entry.frames)
            self._box = str(places.fact(connection, "box"))

    def start(self) -> None:
        """Begins."""
        self._thread.start()

    def stop(self) -> None:
        """Ends after the request that is under way."""
        self._stopping.set()
        self._thread.join(10)

    def _run(self) -> None:
        wait = LOOK_S
        while not self._stopping.wait(wait):
            try:
                self.round()
                wait, self.problem = LOOK_S, None
            except (ServiceError, OperationalError) as error:
                self.problem = str(error)
                wait = min(LAST_WAIT_S, max(FIRST_WAIT_S, 2.0 * wait))

    def round(self) -> None:
        """One round of everything; raises `ServiceError` where the hub can't be reached or refuses."""
        self.epochs.look()
        self._settings()
        self._live()
        self._backlog()
        self._acknowledgements()
        self._frames()

    def _settings(self) -> None:
        now = time.monotonic()
        if now - self.asked < SETTINGS_S:
            return
        self.asked = now
        if self._known is not None and not self._changed(self._known):
            return
        with self._store.read() as connection:
            cameras = [row.id for row in places.listed(connection, "camera")]
        if not cameras:
            return
        query = [("camera", camera) for camera in cameras]
        found = self._client.get("/api/v1/edge/settings", query)
        with self._store.write() as connection:
            hub.apply(connection, found["settings"], self._service.clock.now())
        self._known = found["cursor"]
        self._service.announce()

    def _changed(self, cursor: int) -> bool:
        """Whether the hub's settings changed after a number; goes on from there."""
        while True:
            page = self._client.get("/api/v1/changes", {"after": str(cursor), "count": "1000"})
            if any(item["kind"] in CHANGES for item in page["items"]):
                return True
            cursor = int(page["next"] or (page["items"][-1]["id"] if page["items"] else cursor))
            self._known = cursor
            if page["next"] is None:
                return False

    def _live(self) -> None:
        """The newest of what the hub has not."""
        with self._store.read() as connection:
            lost = sync.missing(connection, sync.READINGS)
        if lost and lost[-1][1] >= self._newest():
            self._send(lost[-1], BATCH, newest=True)

    def _newest(self) -> int:
        with self._store.read() as connection:
            return sync.newest(connection)

    def _backlog(self) -> None:
        """The oldest of what it has not, as much as the rate allows."""
        now = time.monotonic()
        self._allowed = min(
            10.0 * self._entry.backlog_per_s, self._allowed + (now - self._last) * self._entry.backlog_per_s
        )
        self._last = now
        while self._allowed >= 1.0 and not self._stopping.is_set():
            with self._store.read() as connection:
                lost = sync.missing(connection, sync.READINGS)
            if not lost:
                return
            self._allowed -= self._send(lost[0], min(BATCH, int(self._allowed)), newest=False)

    def _send(self, gap: tuple[int, int], count: int, *, newest: bool) -> int:
        """Sends readings from an end of a gap, and notes the stretch once the hub has them; how many."""
        with self._store.read() as connection:
            rows = sync.batch(connection, gap, count, from_end=newest)
            surfaces = {row.id: readings.surface_of(connection, row.id) for row in rows}
        going = [row for row in rows if row.superseded is None and row.sha256 is not None]
        if going:
            for key in {row.calibration for row in going if row.calibration is not None}:
                self._calibration(key)
            epochs = self.epochs.known()
            told = [self._told(row, surfaces[row.id], epochs) for row in going]
            body = {"box": self._box, "sent": self._service.clock.now(), "readings": told}
            self._client.send_document("POST", "/api/v1/edge/readings", body)
        full = len(rows) == count
        first = rows[0].id if newest and full else gap[0]
        last = rows[-1].id if not newest and full else gap[1]
        with self._store.write() as connection:
            sync.acknowledge(connection, sync.READINGS, first, last)
        return max(1, len(rows))

    def _told(self, row: Any, surface: bytes | None, epochs: list[dict[str, Any]]) -> dict[str, Any]:
        shift, current = self.epochs.of(epochs, row.id)
        names = ("camera", "sha256", "format", "bytes", "calibration", "run", "run_version", "run_config")
        return {name: getattr(row, name) for name in names} | {
            "time": max(0, row.time + shift),
            "clock": CORRECTED if shift else row.clock,
            "current": current,
            "values": {name: getattr(row, name) for name in hub.COLUMNS},
            "surface": None if surface is None else base64.b64encode(surface).decode(),
        }

    def _calibration(self, key: str) -> None:
        with self._store.read() as connection:
            sent = list(places.fact(connection, SENT) or ())
            row = places.calibration_get(connection, key)
        if key in sent or row is None:
            return
        names = ("silo", "camera", "origin", "state", "frames", "valid_from", "valid_to", "confirmed_by")
        document = base64.b64encode(places.document_bytes(row)).decode()
        told = {name: getattr(row, name) for name in names} | {"document": document}
        self._client.send_document("PUT", f"/api/v1/edge/calibrations/{key}", told)
        with self._store.write() as connection:
            places.set_fact(connection, SENT, [*sent, key])

    def _frames(self) -> None:
        """The bytes of the frames that the hub is to have, of readings that it has."""
        if self._entry.frames == "none":
            return
        with self._store.read() as connection:
            lost, unread = sync.missing(connection, sync.FRAMES), sync.missing(connection, sync.READINGS)
            gap = lost[0] if lost else (1, 0)
            last = min([gap[1], *(first - 1 for first, _ in unread if first > gap[0])])
            if last < gap[0] or any(first <= gap[0] <= end for first, end in unread):
                return
            rows = sync.batch(connection, (gap[0], last), FILES * BATCH, from_end=False)
            going = [row for row in rows if row.kept and self._is_wanted(connection, row)][:FILES]
        for row in going:
            path = self._service.blobs.path(row.sha256)
            if path.exists():
                self._client.send_file(f"/api/v1/edge/frames/{row.camera}/{row.sha256}", path)
        if len(going) == FILES:
            last = going[-1].id
        elif len(rows) == FILES * BATCH:
            last = rows[-1].id
        with self._store.write() as connection:
            sync.acknowledge(connection, sync.FRAMES, gap[0], last)

    def _is_wanted(self, connection: Any, row: Any) -> bool:
        return self._entry.frames == "all" or sync.is_sample(connection, row)

    def _acknowledgements(self) -> None:
        """What people here have seen."""
        with self._store.read() as connection:
            cursor = int(places.fact(connection, ACKNOWLEDGED) or 0)
            rows = changes.after(connection, cursor, 1000)
            seen = [alerts.get(connection, row.subject) for row in rows if row.kind == "alert"]
        if not rows:
            return
        for row in {row.id: row for row in seen if row is not None and row.acknowledged is not None}.values():
            told = {"silo": row.silo, "kind": row.kind, "who": row.acknowledged_by, "note": row.note}
            self._client.send_document("POST", "/api/v1/edge/acknowledgements", told)
        with self._store.write() as connection:
            places.set_fact(connection, ACKNOWLEDGED, int(rows[-1].id))


def linked(service: Service, address: str, token: str, entry: EdgeEntry, site: Path) -> Edge:
    """The link of a service with the hub at an address."""
    import ssl

    context = None if entry.ca_file is None else ssl.create_default_context(cafile=str(site.parent / entry.ca_file))
    return Edge(service, Client(address, token, context=context), entry)
