"""Signing in and out, and the one-time link where a password is set."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request, Response

from siloscope.monitor import access
from siloscope.monitor.access import Person
from siloscope.monitor.api import models
from siloscope.monitor.api.context import COOKIE, PersonOf, ServiceOf, address_of, check_origin, refusals
from siloscope.monitor.clock import SECOND
from siloscope.monitor.problems import Problem
from siloscope.monitor.service import Service
from siloscope.monitor.store import people

router = APIRouter(tags=["session"])


def _session(person: Person) -> models.Session:
    role: Any = person.highest
    grants: list[Any] = [{"place": place, "role": one} for place, one in person.grants]
    return models.Session(person=person.name, kind=person.kind, role=role, grants=grants)


@router.get("/session", response_model=models.Session, responses=refusals())
def get_session(person: PersonOf) -> models.Session:
    """Who asks."""
    return _session(person)


@router.post("/session", response_model=models.Session, responses=refusals("cross-origin", "too-many"))
def post_session(body: models.SignIn, request: Request, response: Response, service: ServiceOf) -> models.Session:
    """Signs in: the session is in a cookie that scripts can't read."""
    check_origin(request)
    now, address = service.clock.now(), address_of(request)
    keys = (f"name {body.name.lower()}", f"address {address}")
    wait = request.app.state.throttle.wait(keys, now)
    if wait:
        headers = {"Retry-After": str(-(-wait // SECOND))}
        raise Problem("too-many", f"too many failures; wait {-(-wait // SECOND)} s", headers)
    with service.store.read() as connection:
        row = people.user_named(connection, body.name)
    good = access.matches(body.password, None if row is None or row.disabled is not None else row.password)
    if row is None or not good:
        request.app.state.throttle.failed(keys, now)
        with service.store.write() as connection:
            people.log(connection, now, body.name, "failed to sign in", address=address)
        raise Problem("unauthorized", "name or password is wrong")
    request.app.state.throttle.succeeded(keys)
    return _signed_in(request, response, service, row.id, body.name)


def _signed_in(request: Request, response: Response, service: Service, user: str, name: str) -> models.Session:
    secret, now = access.new_secret("session"), service.clock.now()
    with service.store.write() as connection:
        people.add_session(connection, access.hash_of(secret), user, now, now + access.SESSION)
        people.log(connection, now, name, "sign in", address=address_of(request))
        person = access.by_session(connection, secret, now)
    https = request.headers.get("x-forwarded-proto", request.url.scheme) == "https"
    age = access.SESSION // SECOND
    response.set_cookie(COOKIE, secret, max_age=age, httponly=True, samesite="strict", secure=https)
    if person is None:
        raise Problem("unavailable", "the session was not kept; sign in again")
    return _session(person)


@router.delete("/session", status_code=204, response_class=Response, responses=refusals("cross-origin"))
def delete_session(person: PersonOf, service: ServiceOf, request: Request) -> Response:
    """Signs out."""
    response = Response(status_code=204)
    response.delete_cookie(COOKIE)
    if person.session is not None:
        with service.store.write() as connection:
            people.end_session(connection, person.session)
            people.log(connection, service.clock.now(), person.name, "sign out", address=address_of(request))
    return response


@router.post("/session:welcome", response_model=models.Session, responses=refusals("cross-origin", "too-many"))
def welcome(body: models.Welcome, request: Request, response: Response, service: ServiceOf) -> models.Session:
    """Sets a password by a one-time link, and signs in; without a user there, it makes the first administrator."""
    check_origin(request)
    now, keys = service.clock.now(), (f"address {address_of(request)}",)
    if request.app.state.throttle.wait(keys, now):
        raise Problem("too-many", "too many failures; wait a quarter of an hour", {"Retry-After": "900"})
    hashed = access.hashed_password(body.password)
    with service.store.write() as connection:
        link = people.use_link(connection, access.hash_of(body.link), now)
        first = link is not None and link.user is None
        if link is None or (first and people.count_users(connection)):
            request.app.state.throttle.failed(keys, now)
            raise Problem(
                "unauthorized", "the link is used up, too old, or none; `siloscope monitor user` makes another"
            )
        if first:
            if body.name is None or people.user_named(connection, body.name) is not None:
                raise Problem("invalid", "'name': give a name that nobody has yet")
            user, name = people.add_user(connection, body.name, hashed, now), body.name
            people.add_grant(connection, user, None, "admin")
        else:
            user = link.user
            people.set_password(connection, user, hashed)
            name = people.name_of(connection, user)
        people.log(connection, now, name, "set password", address=address_of(request))
    return _signed_in(request, response, service, user, name)
