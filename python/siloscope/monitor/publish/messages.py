"""What is said of an alert: one document, as a program reads it, and as a person does."""

from __future__ import annotations

from typing import Any

from sqlalchemy import Connection

from siloscope.monitor import rules
from siloscope.monitor.clock import iso
from siloscope.monitor.outbox import Delivery
from siloscope.monitor.store import alerts, places
from siloscope.monitor.store.engine import Store

SCHEMA = "siloscope.alert/1"


def document(store: Store, delivery: Delivery) -> dict[str, Any] | None:
    """What happened to an alert; None where the alert is gone."""
    with store.read() as connection:
        row = alerts.get(connection, str(delivery.payload["alert"]))
        return None if row is None else _document(connection, row, delivery)


def _document(connection: Connection, row: Any, delivery: Delivery) -> dict[str, Any]:
    silo = places.get(connection, "silo", row.silo)
    place = None if silo is None or silo.place is None else places.get(connection, "place", silo.place)
    kind = rules.DEFAULTS[row.kind]
    return {
        "schema": SCHEMA,
        "delivery": delivery.key,
        "event": delivery.payload["state"],
        "time": iso(delivery.payload["time"]),
        "alert": row.id,
        "kind": row.kind,
        "meaning": kind.meaning,
        "box": places.fact(connection, "box"),
        "silo": row.silo,
        "silo_name": row.silo if silo is None else silo.name,
        "place": None if place is None else place.id,
        "place_name": None if place is None else place.name,
        "value": row.value,
        "threshold": row.threshold,
        "unit": kind.unit,
        "fired": iso(row.fired),
        "resolved": None if row.resolved is None else iso(row.resolved),
        "acknowledged_by": row.acknowledged_by,
    }


def subject(told: dict[str, Any]) -> str:
    """One line for people."""
    word = "ALERT" if told["event"] == "firing" else "over"
    where = told["silo_name"] if told["place_name"] is None else f"{told['silo_name']}, {told['place_name']}"
    return " ".join(f"{word}: {where}: {told['meaning']}".split())


def text(told: dict[str, Any]) -> str:
    """A few lines for people."""
    lines = [subject(told), ""]
    if told["value"] is not None:
        limit = "" if told["threshold"] is None else f" (limit {_amount(told['threshold'], told['unit'])})"
        lines.append(f"Value: {_amount(told['value'], told['unit'])}{limit}")
    lines.append(f"Since: {told['fired']}")
    if told["resolved"] is not None:
        lines.append(f"Over:  {told['resolved']}")
    return "\n".join([*lines, f"Silo:  {told['silo']}", f"Alert: {told['alert']}", ""])


def _amount(value: float, unit: str) -> str:
    return f"{100 * value:.0f} %" if unit.startswith("fraction") else f"{value:.4g} {unit}"
