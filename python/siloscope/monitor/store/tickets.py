"""Weighbridge tickets."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import Connection, delete, insert, select

from siloscope.monitor.store import changes
from siloscope.monitor.store.engine import new_id
from siloscope.monitor.store.readings import Span
from siloscope.monitor.store.rows import Record
from siloscope.monitor.store.schema import ticket


def add(connection: Connection, values: dict[str, Any]) -> Record:
    """Adds a ticket."""
    key = new_id()
    connection.execute(insert(ticket).values(id=key, **values))
    changes.note(connection, "ticket", key, values["silo"], values["created"])
    return connection.execute(select(ticket).where(ticket.c.id == key)).one()


def remove(connection: Connection, silo: str, key: str, now: int) -> Record | None:
    """Removes a silo's ticket; what it was, None where there is none."""
    of = (ticket.c.silo == silo, ticket.c.id == key)
    found = connection.execute(select(ticket).where(*of)).one_or_none()
    if found is not None:
        connection.execute(delete(ticket).where(*of))
        changes.note(connection, "ticket", key, silo, now)
    return found


def listed(connection: Connection, silo: str, span: Span) -> Sequence[Record]:
    """A silo's tickets of a span, in the order of their times."""
    chosen = [ticket.c.silo == silo]
    if span.since is not None:
        chosen.append(ticket.c.time >= span.since)
    if span.until is not None:
        chosen.append(ticket.c.time < span.until)
    return connection.execute(select(ticket).where(*chosen).order_by(ticket.c.time)).all()
