"""Weighbridge tickets of a silo."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Request, Response

from siloscope.monitor import access
from siloscope.monitor.api import models, views
from siloscope.monitor.api.context import (
    PersonOf,
    Reading,
    ServiceOf,
    SiloOf,
    address_of,
    micros_of,
    need,
    refusals,
)
from siloscope.monitor.api.models.base import Time
from siloscope.monitor.problems import Problem
from siloscope.monitor.store import people, tickets
from siloscope.monitor.store.readings import Span

router = APIRouter(tags=["tickets"])


def _ticket(row: Any) -> models.Ticket:
    told = {name: getattr(row, name) for name in ("id", "silo", "number", "note", "created_by")}
    return models.Ticket(**told, time=views.at(row.time), created=views.at(row.created), mass_kg=row.mass)


@router.get(
    "/silos/{silo}/tickets", response_model=models.Page[models.Ticket], responses=refusals("not-found", "forbidden")
)
def get_tickets(
    silo: SiloOf,
    connection: Reading,
    since: Annotated[Time | None, Query(alias="from")] = None,
    until: Annotated[Time | None, Query(alias="to")] = None,
) -> models.Page[models.Ticket]:
    """Tickets in the order of their times."""
    if silo.percent_only:
        raise Problem("forbidden", "this needs the role viewer")
    span = Span(micros_of(since, "from"), micros_of(until, "to"))
    return models.Page(items=[_ticket(row) for row in tickets.listed(connection, silo.row.id, span)])


@router.post(
    "/silos/{silo}/tickets",
    status_code=201,
    response_model=models.Ticket,
    responses=refusals("not-found", "forbidden", "cross-origin"),
)
def post_ticket(
    silo: SiloOf, body: models.NewTicket, person: PersonOf, service: ServiceOf, request: Request
) -> models.Ticket:
    """Notes a ticket."""
    now, time = service.clock.now(), micros_of(body.time, "time")
    with service.store.write() as connection:
        need("operator", person, access.around(connection, silo.row))
        row = {"silo": silo.row.id, "time": time, "mass": body.mass_kg, "number": body.number, "note": body.note}
        found = tickets.add(connection, {**row, "created": now, "created_by": person.name})
        people.log(connection, now, person.name, "add ticket", found.id, address=address_of(request))
    service.announce()
    return _ticket(found)


@router.delete(
    "/silos/{silo}/tickets/{ticket}",
    status_code=204,
    response_class=Response,
    responses=refusals("not-found", "forbidden", "cross-origin"),
)
def delete_ticket(
    silo: SiloOf,
    ticket: Annotated[str, Path(max_length=80)],
    person: PersonOf,
    service: ServiceOf,
    request: Request,
) -> Response:
    """Takes back a ticket that was entered wrongly; the audit log keeps what it said."""
    now = service.clock.now()
    with service.store.write() as connection:
        need("operator", person, access.around(connection, silo.row))
        gone = tickets.remove(connection, silo.row.id, ticket, now)
        if gone is None:
            raise Problem("not-found", f"there is no ticket '{ticket}' of '{silo.row.id}'")
        told = {"number": gone.number, "mass_kg": gone.mass, "time": views.at(gone.time).isoformat()}
        people.log(connection, now, person.name, "remove ticket", ticket, detail=told, address=address_of(request))
    service.announce()
    return Response(status_code=204)
