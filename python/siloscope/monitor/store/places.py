"""Places, silos, cameras, products and calibrations."""

from __future__ import annotations

import hashlib
import json
import zlib
from collections.abc import Sequence
from typing import Any

from sqlalchemy import Connection, Select, Table, bindparam, insert, or_, select, update

from siloscope.monitor.store import changes
from siloscope.monitor.store.engine import new_id
from siloscope.monitor.store.rows import Record
from siloscope.monitor.store.schema import calibration, camera, filling, place, product, silo, site

CONFIRMED, PROPOSED, REJECTED = "confirmed", "proposed", "rejected"

TABLES: dict[str, Table] = {"place": place, "silo": silo, "camera": camera, "product": product}
"""What people name and change."""


def listed(connection: Connection, kind: str) -> Sequence[Record]:
    """All of a kind by id, without removed ones."""
    table = TABLES[kind]
    wanted = select(table).order_by(table.c.id)
    if "removed" in table.c:
        wanted = wanted.where(table.c.removed.is_(None))
    return connection.execute(wanted).all()


def _one_of(table: Table) -> Select[Any]:
    wanted = select(table).where(table.c.id == bindparam("key"))
    return wanted.where(table.c.removed.is_(None)) if "removed" in table.c else wanted


ONE = {kind: _one_of(table) for kind, table in TABLES.items()}
"""Made once: making a statement takes longer than it takes SQLite to answer it."""


def get(connection: Connection, kind: str, key: str) -> Record | None:
    """One that is not removed."""
    return connection.execute(ONE[kind], {"key": key}).one_or_none()


def put(connection: Connection, kind: str, key: str, values: dict[str, Any], now: int) -> bool:
    """Sets what `values` names and leaves the rest; a removed one comes back. Whether anything changed."""
    table = TABLES[kind]
    found = connection.execute(select(table).where(table.c.id == key)).one_or_none()
    if found is None:
        connection.execute(insert(table).values(id=key, version=1, **values))
    else:
        removed = {"removed": None} if "removed" in table.c else {}
        old = found._mapping
        if all(old[name] == value for name, value in {**values, **removed}.items()):
            return False
        changed = {**values, **removed, "version": found.version + 1}
        connection.execute(update(table).where(table.c.id == key).values(**changed))
    owner = key if kind == "silo" else values.get("silo") if kind == "camera" else None
    changes.note(connection, kind, key, owner, now)
    return True


def remove(connection: Connection, kind: str, key: str, now: int) -> None:
    """Takes a silo or camera out of sight; what it measured stays."""
    table = TABLES[kind]
    gone = {"removed": now, "version": table.c.version + 1}
    connection.execute(update(table).where(table.c.id == key).values(**gone))
    changes.note(connection, kind, key, key if kind == "silo" else None, now)


def above(connection: Connection, key: str | None) -> list[str]:
    """A place and the places it lies in, from inside out."""
    found: list[str] = []
    while key is not None and key not in found:
        found.append(key)
        key = connection.execute(select(place.c.parent).where(place.c.id == key)).scalar()
    return found


def zone_of(connection: Connection, key: str | None) -> str:
    """The time zone of a place: its own, or that of the next one around it, or the site's."""
    for one in above(connection, key):
        own = connection.execute(select(place.c.zone).where(place.c.id == one)).scalar()
        if own:
            return str(own)
    return str(fact(connection, "zone") or "UTC")


def fact(connection: Connection, key: str) -> Any:
    """A fact of the whole site; None where it is not known."""
    return connection.execute(select(site.c.value).where(site.c.key == key)).scalar()


def set_fact(connection: Connection, key: str, value: Any) -> None:
    """Sets a fact of the whole site."""
    made = connection.execute(update(site).where(site.c.key == key).values(value=value))
    if not made.rowcount:
        connection.execute(insert(site).values(key=key, value=value))


def fill(connection: Connection, silo_id: str, product_id: str, since: int) -> None:
    """Notes from when on a silo holds a product."""
    last = select(filling).where(filling.c.silo == silo_id).order_by(filling.c.since.desc()).limit(1)
    found = connection.execute(last).one_or_none()
    if found is None or (found.product != product_id and found.since < since):
        connection.execute(insert(filling).values(silo=silo_id, product=product_id, since=since))


def product_at(connection: Connection, silo_id: str, time: int) -> Record | None:
    """The product that was in a silo at a time; before the first note, the first one."""
    of = select(product).join(filling, filling.c.product == product.c.id).where(filling.c.silo == silo_id)
    before = of.where(filling.c.since <= time).order_by(filling.c.since.desc()).limit(1)
    found = connection.execute(before).one_or_none()
    return found or connection.execute(of.order_by(filling.c.since).limit(1)).one_or_none()


def calibration_at(connection: Connection, camera_id: str, time: int) -> Record | None:
    """The confirmed calibration that a frame of a time is measured with."""
    chosen = [calibration.c.camera == camera_id, calibration.c.state == CONFIRMED, calibration.c.valid_from <= time]
    chosen.append(or_(calibration.c.valid_to.is_(None), calibration.c.valid_to > time))
    wanted = select(calibration).where(*chosen).order_by(calibration.c.valid_from.desc(), calibration.c.created.desc())
    return connection.execute(wanted.limit(1)).one_or_none()


def calibrations(connection: Connection, silo_id: str) -> Sequence[Record]:
    """A silo's calibrations without their documents, the newest first."""
    columns = [column for column in calibration.c if column.name != "document"]
    wanted = select(*columns).where(calibration.c.silo == silo_id).order_by(calibration.c.created.desc())
    return connection.execute(wanted).all()


def calibration_get(connection: Connection, key: str) -> Record | None:
    """A calibration with its document."""
    return connection.execute(select(calibration).where(calibration.c.id == key)).one_or_none()


def proposed(connection: Connection, camera_id: str) -> Record | None:
    """The calibration of a camera that waits for a person's word."""
    chosen = [calibration.c.camera == camera_id, calibration.c.state == PROPOSED]
    wanted = select(calibration).where(*chosen).order_by(calibration.c.created.desc()).limit(1)
    return connection.execute(wanted).one_or_none()


def add_calibration(
    connection: Connection, silo_id: str, camera_id: str, document: dict[str, Any], now: int, **row: Any
) -> str:
    """Adds one; the same document for the same camera is not added twice. Its id."""
    text = json.dumps(document, allow_nan=False, separators=(",", ":")).encode()
    sha256 = hashlib.sha256(text).hexdigest()
    same = [calibration.c.camera == camera_id, calibration.c.sha256 == sha256, calibration.c.state != REJECTED]
    found = connection.execute(select(calibration.c.id).where(*same)).scalar()
    if found is not None:
        return str(found)
    key = new_id()
    values = {"id": key, "silo": silo_id, "camera": camera_id, "document": zlib.compress(text), "sha256": sha256}
    connection.execute(insert(calibration).values(**values, created=now, **row))
    changes.note(connection, "calibration", key, silo_id, now)
    return key


def confirm(connection: Connection, key: str, who: str, now: int) -> Record | None:
    """Makes a proposed calibration the camera's from its beginning on; the one before ends there."""
    found = calibration_get(connection, key)
    if found is None or found.state != PROPOSED:
        return None
    close(connection, found.camera, found.valid_from)
    values = {"state": CONFIRMED, "confirmed_by": who}
    connection.execute(update(calibration).where(calibration.c.id == key).values(**values))
    changes.note(connection, "calibration", key, found.silo, now)
    return calibration_get(connection, key)


def close(connection: Connection, camera_id: str, at: int) -> None:
    """Ends the confirmed calibrations of a camera that are open at a time."""
    open_ = [calibration.c.camera == camera_id, calibration.c.state == CONFIRMED, calibration.c.valid_to.is_(None)]
    connection.execute(update(calibration).where(*open_, calibration.c.valid_from < at).values(valid_to=at))


def reject(connection: Connection, key: str, who: str, now: int) -> bool:
    """Turns a proposed calibration down; whether there was one."""
    chosen = [calibration.c.id == key, calibration.c.state == PROPOSED]
    made = connection.execute(update(calibration).where(*chosen).values(state=REJECTED, confirmed_by=who))
    if made.rowcount:
        changes.note(connection, "calibration", key, None, now)
    return bool(made.rowcount)


def set_moved(connection: Connection, camera_id: str, since: int | None, now: int) -> None:
    """Notes since when a camera does not stand where its calibration has it."""
    changed = update(camera).where(camera.c.id == camera_id).values(moved_since=since).returning(camera.c.silo)
    changes.note(connection, "camera", camera_id, connection.execute(changed).scalar(), now)


def document(row: Record) -> dict[str, Any]:
    """A calibration's document."""
    found: dict[str, Any] = json.loads(document_bytes(row))
    return found


def document_bytes(row: Record) -> bytes:
    """A calibration's document as text."""
    return zlib.decompress(row.document)
