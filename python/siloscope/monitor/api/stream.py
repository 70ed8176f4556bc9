"""The log of changes: as pages, and as server-sent events that go on where a client left off."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from typing import Annotated, Any

from anyio import to_thread
from fastapi import APIRouter, Header, Query, Request
from fastapi.responses import StreamingResponse
from sqlalchemy import Connection

from siloscope.monitor import access
from siloscope.monitor.access import Person
from siloscope.monitor.api import models, views
from siloscope.monitor.api.context import Count, PersonOf, Reading, person_of, refusals, service_of
from siloscope.monitor.clock import iso
from siloscope.monitor.problems import Problem
from siloscope.monitor.service import Service
from siloscope.monitor.store import changes, places

router = APIRouter(tags=["changes"])

BATCH = 500

KEEP_ALIVE_S = 15.0
"""A comment goes out so often, so that both ends see a lost link."""

POLL_S = 2.0
"""How often other processes' changes are looked for."""

RETRY_MS = 2000

LARGEST = (1 << 62) - 1


@router.get("/changes", response_model=models.Page[models.Change], responses=refusals())
def get_changes(
    connection: Reading,
    person: PersonOf,
    after: Annotated[int, Query(ge=0, le=LARGEST, description="Number of the last change that is known.")] = 0,
    count: Count = 500,
) -> models.Page[models.Change]:
    """What changed since a number, the oldest first: for whoever keeps a copy."""
    rows = changes.after(connection, after, count + 1)
    items = [_change(row) for row in rows[:count] if may_see(connection, person, row)]
    return models.Page(items=items, next=str(rows[count - 1].id) if len(rows) > count else None)


def _change(row: Any) -> models.Change:
    return models.Change(id=row.id, kind=row.kind, subject=row.subject, silo=row.silo, time=views.at(row.time))


def may_see(connection: Connection, person: Person, row: Any) -> bool:
    """Whether a change concerns what somebody may see."""
    if row.silo is None:
        return person.highest is not None
    silo = places.get(connection, "silo", row.silo)
    return person.role_at(access.around(connection, silo)) is not None


@router.get(
    "/events",
    response_class=StreamingResponse,
    responses={200: {"content": {"text/event-stream": {}}, "description": "Server-sent events."}, **refusals()},
)
async def get_events(
    request: Request,
    last_event_id: Annotated[str | None, Header(description="Number of the last event that came.")] = None,
) -> StreamingResponse:
    """Changes as they come. After a lost link the browser names the last one that came, and goes on behind it.

    Events: `change` (data: a line of `changes`), and `reset` where what was missed is no longer known, so that all is
    to be read again.
    """
    service = service_of(request)
    person, begin, lost = await to_thread.run_sync(_begin, request, service, last_event_id)
    headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
    stream = _events(request, service, person, begin, lost)
    return StreamingResponse(stream, media_type="text/event-stream", headers=headers)


def _begin(request: Request, service: Service, told: str | None) -> tuple[Person, int, bool]:
    """Who asks, behind which change the stream begins, and whether some are lost."""
    with service.store.read() as connection:
        person = person_of(request, service, connection)
        if person.highest is None:
            raise Problem("unauthorized", "this token is not for reading")
        newest, oldest = changes.newest(connection), changes.oldest(connection)
    if told is None:
        return person, newest, False
    known = told.isdecimal() and len(told) < 19 and oldest - 1 <= int(told) <= newest
    return (person, int(told), False) if known else (person, newest, True)


async def _events(request: Request, service: Service, person: Person, cursor: int, lost: bool) -> AsyncIterator[bytes]:
    loop, changed = asyncio.get_running_loop(), asyncio.Event()

    def wake() -> None:
        loop.call_soon_threadsafe(changed.set)

    service.listeners.append(wake)
    try:
        yield f"retry: {RETRY_MS}\n\n".encode()
        if lost:
            yield _event("reset", cursor, {"time": iso(service.clock.now())})
        quiet = 0.0
        while not request.app.state.stopping.is_set():
            rows, cursor = await to_thread.run_sync(_after, service, person, cursor)
            for row in rows:
                yield _event("change", row.id, _change(row).model_dump(mode="json"))
            if rows:
                quiet = 0.0
                continue
            try:
                await asyncio.wait_for(changed.wait(), POLL_S)
            except TimeoutError:
                quiet += POLL_S
            changed.clear()
            if quiet >= KEEP_ALIVE_S:
                quiet = 0.0
                yield b": still here\n\n"
    finally:
        service.listeners.remove(wake)


def _after(service: Service, person: Person, cursor: int) -> tuple[list[Any], int]:
    with service.store.read() as connection:
        rows = changes.after(connection, cursor, BATCH)
        seen = [row for row in rows if may_see(connection, person, row)]
        return seen, int(rows[-1].id) if rows else cursor


def _event(name: str, number: int, data: dict[str, Any]) -> bytes:
    return f"id: {number}\nevent: {name}\ndata: {json.dumps(data)}\n\n".encode()
