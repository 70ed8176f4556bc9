"""A hub's side: what edges measured, each thing once, and the settings that they go by."""

from __future__ import annotations

import base64
import hashlib
import zlib
from collections.abc import Sequence
from typing import Any

from sqlalchemy import Connection, insert, select

from siloscope.monitor.store import alerts, changes, frames, places, readings
from siloscope.monitor.store.engine import Store, new_id
from siloscope.monitor.store.rows import Record
from siloscope.monitor.store.schema import alert, calibration, frame, reading

COLUMNS = tuple(
    column.name
    for column in reading.c
    if column.name not in ("id", "frame", "silo", "camera", "run", "superseded", "calibration", "time", "clock")
)
"""Of a reading that travel as they are."""

PARTS = ("place", "product", "silo", "camera")
"""Settings that flow down, in the order in which they name each other."""


def take(store: Store, connection: Connection, box: str, told: dict[str, Any], now: int) -> str | None:
    """Adds an edge's reading with its frame; its silo, or None where it was here before."""
    camera = places.get(connection, "camera", told["camera"])
    if camera is None:
        raise KeyError(told["camera"])
    frame_id = _frame(store, connection, told, now)
    config = hashlib.sha256(f"{box}/{told['run']}/{told['run_config']}".encode()).hexdigest()
    run = readings.run_of(connection, told["run_version"], config, "edge", now)
    same = [reading.c.frame == frame_id, reading.c.run == run]
    if connection.execute(select(reading.c.id).where(*same)).scalar() is not None:
        return None
    known = told["calibration"] is not None and places.calibration_get(connection, told["calibration"]) is not None
    row = {name: told["values"].get(name) for name in COLUMNS} | {
        "frame": frame_id,
        "silo": camera.silo,
        "camera": camera.id,
        "run": run,
        "time": told["time"],
        "clock": told["clock"],
        "calibration": told["calibration"] if known else None,
    }
    readings.add(connection, row, told["surface"], now)
    return str(camera.silo)


def _frame(store: Store, connection: Connection, told: dict[str, Any], now: int) -> str:
    row = {name: told[name] for name in ("camera", "sha256", "format", "bytes", "clock")}
    row |= {"id": new_id(), "captured": told["time"], "received": now, "kept": False}
    row |= {"state": frames.MEASURED, "attempts": 0, "not_before": 0}
    if store.insert_new(connection, frame, row):
        return str(row["id"])
    found = frames.find(connection, told["camera"], told["sha256"])
    return str(row["id"] if found is None else found.id)


def add_calibration(connection: Connection, told: dict[str, Any], document: bytes, now: int) -> bool:
    """Adds a calibration under the id that it has elsewhere; whether it is new. A confirmed one ends those before."""
    if places.calibration_get(connection, told["id"]) is not None:
        return False
    if told["state"] == places.CONFIRMED:
        places.close(connection, told["camera"], told["valid_from"])
    row = {**told, "document": zlib.compress(document), "sha256": hashlib.sha256(document).hexdigest(), "created": now}
    connection.execute(insert(calibration).values(**row))
    changes.note(connection, "calibration", told["id"], told["silo"], now)
    return True


def settings(connection: Connection, cameras: Sequence[str]) -> dict[str, list[dict[str, Any]]]:
    """What an edge with some cameras goes by: their silos, places, products, rules and calibrations."""
    rows: dict[str, list[Record]] = {part: [] for part in PARTS}
    rows["camera"] = [row for row in places.listed(connection, "camera") if row.id in cameras]
    silos = {row.silo for row in rows["camera"]}
    rows["silo"] = [row for row in places.listed(connection, "silo") if row.id in silos]
    rows["product"] = [
        row for row in places.listed(connection, "product") if row.id in {s.product for s in rows["silo"]}
    ]
    around = list(dict.fromkeys(p for silo in rows["silo"] for p in reversed(places.above(connection, silo.place))))
    rows["place"] = [row for p in around if (row := places.get(connection, "place", p)) is not None]
    found = {part: [_plain(row) for row in rows[part]] for part in PARTS}
    for silo in found["silo"]:
        silo["vessel"] = {name: value for name, value in silo["vessel"].items() if name != "vessel"}
    mine = [r for r in alerts.rules(connection) if r.silo in (None, *silos) and r.place in (None, *around)]
    return found | {"rule": [_plain(row) for row in mine], "calibration": _calibrations(connection, rows["camera"])}


def _plain(row: Record) -> dict[str, Any]:
    left_out = ("version", "removed", "moved_since")
    return {name: value for name, value in row._mapping.items() if name not in left_out}


def _calibrations(connection: Connection, cameras: Sequence[Record]) -> list[dict[str, Any]]:
    """The calibration in force of each camera."""
    names = ("id", "silo", "camera", "origin", "state", "frames", "valid_from", "valid_to", "confirmed_by")
    made = []
    for camera in cameras:
        chosen = [calibration.c.camera == camera.id, calibration.c.state == places.CONFIRMED]
        wanted = select(calibration).where(*chosen, calibration.c.valid_to.is_(None))
        row = connection.execute(wanted.order_by(calibration.c.valid_from.desc()).limit(1)).one_or_none()
        if row is not None:
            document = base64.b64encode(zlib.decompress(row.document)).decode()
            made.append({name: getattr(row, name) for name in names} | {"document": document})
    return made


def apply(connection: Connection, found: dict[str, Any], now: int) -> None:
    """Sets at an edge what its hub says; the hub wins."""
    for part in PARTS:
        for row in found[part]:
            values = {name: value for name, value in row.items() if name != "id"}
            if part == "silo":
                before = places.get(connection, part, row["id"])
                own = {} if before is None else {k: v for k, v in before.vessel.items() if k == "vessel"}
                values["vessel"] = {**values["vessel"], **own}
            places.put(connection, part, row["id"], values, now)
            if part == "silo" and row["product"] is not None:
                places.fill(connection, row["id"], row["product"], now)
    for row in found["rule"]:
        alerts.put_rule(connection, row["id"], {name: value for name, value in row.items() if name != "id"}, now)
    for row in found["calibration"]:
        told = {name: value for name, value in row.items() if name != "document"}
        add_calibration(connection, told, base64.b64decode(row["document"]), now)


def acknowledge(connection: Connection, told: dict[str, Any], now: int) -> bool:
    """Notes that somebody at an edge has seen an alert: the hub's own of the same silo and kind; whether it is on."""
    chosen = [alert.c.silo == told["silo"], alert.c.kind == told["kind"], alert.c.resolved.is_(None)]
    key = connection.execute(select(alert.c.id).where(*chosen).order_by(alert.c.id.desc()).limit(1)).scalar()
    if key is None:
        return False
    alerts.acknowledge(connection, str(key), told["who"], told["note"], now)
    return True
