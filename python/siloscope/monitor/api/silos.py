"""Silos and what is in them: now, over time, the surface, events, forecast."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query

from siloscope.monitor import access, surfaces
from siloscope.monitor.api import models, vessels, views
from siloscope.monitor.api.context import After, Count, PersonOf, Reading, ServiceOf, SiloOf, micros_of, refusals
from siloscope.monitor.api.models.base import Time
from siloscope.monitor.problems import Problem
from siloscope.monitor.store import places, readings

router = APIRouter(tags=["silos"])


@router.get("/silos", response_model=models.Page[models.Silo], responses=refusals())
def get_silos(connection: Reading, person: PersonOf, service: ServiceOf) -> models.Page[models.Silo]:
    """All silos that may be seen, each with what a card shows; never more than one page."""
    cameras = list(places.listed(connection, "camera"))
    found = []
    for row in places.listed(connection, "silo"):
        role = person.role_at(access.around(connection, row))
        if role is not None:
            silo = views.silo(connection, row, cameras, role, service.clock.now())
            found.append(_for(silo, role))
    return models.Page(items=found)


def _for(silo: models.Silo, role: str) -> models.Silo:
    if role != "percent":
        return silo
    hidden = {
        "now": views.only_percent(silo.now),
        "forecast": views.only_percent(silo.forecast),
        "vessel": {},
        "drawn": None,
    }
    return silo.model_copy(update=hidden)


@router.get("/silos/{silo}", response_model=models.Silo, responses=refusals("not-found"))
def get_silo(silo: SiloOf, connection: Reading, service: ServiceOf) -> models.Silo:
    """One silo."""
    cameras = list(places.listed(connection, "camera"))
    return _for(views.silo(connection, silo.row, cameras, silo.role, service.clock.now()), silo.role)


@router.get("/silos/{silo}/now", response_model=models.Now, responses=refusals("not-found"))
def get_now(silo: SiloOf, connection: Reading, service: ServiceOf) -> models.Now:
    """The newest answer with its age; stale numbers are given and said to be stale."""
    found = views.now(connection, silo.row, list(places.listed(connection, "camera")), service.clock.now())
    return views.only_percent(found) if silo.percent_only else found


@router.get("/silos/{silo}/surface", response_model=models.Surface, responses=refusals("not-found", "forbidden"))
def get_surface(
    silo: SiloOf,
    connection: Reading,
    service: ServiceOf,
    at: Annotated[Time | None, Query(description="The newest surface up to this time; now unless given.")] = None,
) -> models.Surface:
    """The content's surface at a time, on 32 x 32 cells."""
    if silo.percent_only:
        raise Problem("forbidden", "this needs the role viewer")
    time = micros_of(at, "at")
    row = readings.surface_at(connection, silo.row.id, service.clock.now() if time is None else time)
    if row is None:
        raise Problem("not-found", f"there is no surface of '{silo.row.id}' up to then")
    return models.Surface(
        silo=silo.row.id,
        time=views.at(row.time),
        reading=row.id,
        height_datum=row.datum,
        vessel=vessels.vessel(connection, silo.row.vessel, row),
        **surfaces.unpacked(row.blob),
    )


@router.get("/silos/{silo}/events", response_model=models.Page[models.Event], responses=refusals("not-found"))
def get_events(
    silo: SiloOf,
    connection: Reading,
    since: Annotated[Time | None, Query(alias="from")] = None,
    until: Annotated[Time | None, Query(alias="to")] = None,
    after: After = None,
    count: Count = 500,
) -> models.Page[models.Event]:
    """Refills and withdrawals, in their order."""
    span = readings.Span(micros_of(since, "from"), micros_of(until, "to"))
    rows = readings.events(connection, silo.row.id, span)
    if after is not None:
        places_of = [k for k, row in enumerate(rows) if row.id == after]
        if not places_of:
            raise Problem("invalid", "'after' is no cursor of these events; begin again without it")
        rows = rows[places_of[0] + 1 :]
    items = [views.event(row) for row in rows[:count]]
    if silo.percent_only:
        raise Problem("forbidden", "this needs the role viewer")
    return models.Page(items=items, next=items[-1].id if len(rows) > count else None)


@router.get("/silos/{silo}/forecast", response_model=models.Forecast, responses=refusals("not-found"))
def get_forecast(silo: SiloOf, connection: Reading) -> models.Forecast:
    """Daily use and when the silo will be empty, with a 95 % band."""
    last = readings.last(connection, silo.row.id, answered=True)
    found = views.forecast(connection, silo.row.id, None if last is None else last.density)
    return views.only_percent(found) if silo.percent_only else found
