"""Alerts: what fires, and who has seen it."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Body, Query
from sqlalchemy import Connection

from siloscope.monitor import access
from siloscope.monitor.access import Person
from siloscope.monitor.api import models, views
from siloscope.monitor.api.context import After, Count, PersonOf, Reading, ServiceOf, need, refusals
from siloscope.monitor.problems import Problem
from siloscope.monitor.store import alerts, people, places

router = APIRouter(tags=["alerts"])


@router.get("/alerts", response_model=models.Page[models.Alert], responses=refusals())
def get_alerts(
    connection: Reading,
    person: PersonOf,
    silo: str | None = None,
    state: Annotated[Literal["firing", "resolved"] | None, Query()] = None,
    after: After = None,
    count: Count = 100,
) -> models.Page[models.Alert]:
    """Alerts, the newest first."""
    firing = None if state is None else state == "firing"
    rows = alerts.listed(connection, silo=silo, firing=firing, before=after, count=count + 1)
    items = [views.alert(row) for row in rows[:count] if around_of(connection, person, row.silo) is not None]
    return models.Page(items=items, next=rows[count - 1].id if len(rows) > count else None)


def around_of(connection: Connection, person: Person, silo: str) -> list[str] | None:
    """The places a silo lies in, for who may see more of it than its fill; None for others."""
    row: Any = places.get(connection, "silo", silo)
    around = access.around(connection, row)
    return around if row is not None and person.may("viewer", around) else None


@router.post(
    "/alerts/{alert}:acknowledge",
    response_model=models.Alert,
    responses=refusals("forbidden", "not-found", "cross-origin"),
)
def acknowledge(
    alert: str,
    person: PersonOf,
    service: ServiceOf,
    body: Annotated[models.Acknowledgement | None, Body()] = None,
) -> models.Alert:
    """Says that somebody has seen it; who was first stays."""
    with service.store.write() as connection:
        row = alerts.get(connection, alert)
        around = None if row is None else around_of(connection, person, row.silo)
        if row is None or around is None:
            raise Problem("not-found", f"there is no alert '{alert}'")
        need("operator", person, around)
        now = service.clock.now()
        found = alerts.acknowledge(connection, alert, person.name, None if body is None else body.note, now)
        people.log(connection, now, person.name, "acknowledge", alert)
    service.announce()
    return views.alert(found)
