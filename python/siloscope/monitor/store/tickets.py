"""Weighbridge tickets."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import Connection, insert, select

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


def listed(connection: Connection, silo: str, span: Span) -> Sequence[Record]:
    """A silo's tickets of a span, in the order of their times."""
    chosen = [ticket.c.silo == silo]
    if span.since is not None:
        chosen.append(ticket.c.time >= span.since)
    if span.until is not None:
        chosen.append(ticket.c.time < span.until)
    return connection.execute(select(ticket).where(*chosen).order_by(ticket.c.time)).all()
