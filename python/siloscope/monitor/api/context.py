"""What every route needs: the service, who asks, and a silo that they may see."""

from __future__ import annotations

import ipaddress
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Any
from urllib.parse import urlsplit

from fastapi import Depends, Query, Request
from sqlalchemy import Connection

from siloscope.monitor import access
from siloscope.monitor.access import LOCAL, Person
from siloscope.monitor.clock import SECOND
from siloscope.monitor.problems import PROBLEMS, Problem
from siloscope.monitor.service import Service
from siloscope.monitor.store import people, places

COOKIE = "siloscope_session"

SAFE = ("GET", "HEAD", "OPTIONS")

LOCAL_HOSTS = ("127.0.0.1", "localhost", "[::1]", "::1", "testserver")


def service_of(request: Request) -> Service:
    """The running service."""
    found: Service = request.app.state.service
    return found


ServiceOf = Annotated[Service, Depends(service_of)]


def reading_of(service: ServiceOf) -> Iterator[Connection]:
    """A connection with one view of the data."""
    with service.store.read() as connection:
        yield connection


Reading = Annotated[Connection, Depends(reading_of)]


def person_of(request: Request, service: ServiceOf, connection: Reading) -> Person:
    """Who asks; raises `Problem` where nobody is known."""
    header = request.headers.get("authorization", "")
    if header:
        scheme, _, secret = header.partition(" ")
        person = access.by_token(connection, secret.strip()) if scheme.lower() == "bearer" else None
        if person is None:
            raise unauthorized("the token is not known, or was revoked")
        return person
    cookie = request.cookies.get(COOKIE)
    person = access.by_session(connection, cookie, service.clock.now()) if cookie else None
    if person is None and people.count_users(connection) == 0 and is_local(request):
        person = LOCAL
    if person is not None:
        if request.method not in SAFE:
            check_origin(request)
        return person
    raise unauthorized("send a token as 'Authorization: Bearer …', or sign in")


PersonOf = Annotated[Person, Depends(person_of)]


def check_origin(request: Request) -> None:
    """Raises `Problem` for a write that a page of another site makes in the browser of who is signed in here."""
    site = request.headers.get("sec-fetch-site")
    origin = request.headers.get("origin")
    hosts = (request.headers.get("host"), request.headers.get("x-forwarded-host"))
    other = origin is not None and urlsplit(origin).netloc not in hosts
    if other or site not in (None, "same-origin", "none"):
        raise Problem("cross-origin", "write requests are taken from the service's own page, or with a token")


def address_of(request: Request) -> str:
    """Where a request comes from, for the audit log."""
    return request.client.host if request.client else "unknown"


def unauthorized(detail: str) -> Problem:
    """Nobody that is known."""
    return Problem("unauthorized", detail, {"WWW-Authenticate": "Bearer"})


def is_local(request: Request) -> bool:
    """Whether it comes from this machine and was meant for it: not by a proxy, nor by a name that points here."""
    host = (request.headers.get("host") or "").rsplit(":", 1)[0] if request.headers.get("host") else ""
    if "x-forwarded-for" in request.headers or "forwarded" in request.headers or host not in LOCAL_HOSTS:
        return False
    peer = request.client.host if request.client else ""
    try:
        return ipaddress.ip_address(peer).is_loopback
    except ValueError:
        return peer == "testclient"


@dataclass(frozen=True)
class Seen:
    """A silo that who asks may see."""

    row: Any
    role: str

    @property
    def percent_only(self) -> bool:
        """Whether only how full it is may be seen."""
        return self.role == "percent"


def silo_of(silo: str, person: PersonOf, connection: Reading) -> Seen:
    """A silo by its id; one that may not be seen is not there."""
    row = places.get(connection, "silo", silo)
    role = None if row is None else person.role_at(access.around(connection, row))
    if row is None or role is None:
        raise Problem("not-found", f"there is no silo '{silo}'")
    return Seen(row, role)


SiloOf = Annotated[Seen, Depends(silo_of)]


def need(role: str, person: Person, around: list[str] | None = None) -> None:
    """Raises `Problem` unless the person has the role, there or everywhere."""
    if not person.may(role, around or []):
        raise Problem("forbidden", f"this needs the role {role}")


def micros_of(time: datetime | None, name: str) -> int | None:
    """A time of a query."""
    if time is None:
        return None
    if time.tzinfo is None:
        raise Problem("invalid", f"'{name}' names no zone; give a time such as 2026-03-01T06:00:00Z")
    try:
        return int(time.timestamp() * SECOND)
    except (OverflowError, ValueError):
        raise Problem("invalid", f"'{name}' is no time that can be") from None


After = Annotated[str | None, Query(description="Cursor: `next` of the page before.", max_length=80)]
Count = Annotated[int, Query(ge=1, le=1000, description="Items of a page.")]


def refusals(*slugs: str) -> dict[int | str, dict[str, Any]]:
    """The problems that a route may answer, for OpenAPI."""
    found: dict[int | str, dict[str, Any]] = {}
    for slug in ("unauthorized", "invalid", "unavailable", *slugs):
        status, title = PROBLEMS[slug]
        before = found.get(status, {}).get("description")
        description = title if before is None else f"{before}; or {title}"
        content = {"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}}
        found[status] = {"description": description, "content": content}
    return found
