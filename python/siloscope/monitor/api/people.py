"""Users, grants, tokens and the audit log; for administrators."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Request, Response
from sqlalchemy import Connection

from siloscope.monitor import access
from siloscope.monitor.api import models
from siloscope.monitor.api.context import Count, PersonOf, Reading, ServiceOf, address_of, need, refusals
from siloscope.monitor.api.views import at
from siloscope.monitor.problems import Problem
from siloscope.monitor.store import people, places

router = APIRouter(tags=["people"])

LARGEST = (1 << 62) - 1

Key = Annotated[str, Path(max_length=80)]


def _user(connection: Connection, row: Any) -> models.User:
    grants = [_grant(one) for one in people.grants(connection, row.id)]
    return models.User(id=row.id, name=row.name, created=at(row.created), disabled=at(row.disabled), grants=grants)


def _grant(row: Any) -> models.Grant:
    return models.Grant(id=row.id, user=row.user_name, place=row.place, role=row.role)


def _token(row: Any) -> models.Token:
    told = {"id": row.id, "role": row.role, "camera": row.camera, "name": row.name}
    return models.Token(**told, created=at(row.created), revoked=at(row.revoked))


def _must_be_place(connection: Connection, place: str | None) -> None:
    if place is not None and places.get(connection, "place", place) is None:
        raise Problem("invalid", f"'place': there is no place '{place}'")


@router.get("/users", response_model=models.Page[models.User], responses=refusals("forbidden"))
def get_users(connection: Reading, person: PersonOf) -> models.Page[models.User]:
    """All users."""
    need("admin", person)
    return models.Page(items=[_user(connection, row) for row in people.users(connection)])


@router.post(
    "/users",
    status_code=201,
    response_model=models.Invitation,
    responses=refusals("forbidden", "cross-origin", "conflict"),
)
def post_user(body: models.NewUser, person: PersonOf, service: ServiceOf, request: Request) -> models.Invitation:
    """Makes a user; the answer has the link where the password is set, once."""
    need("admin", person)
    now = service.clock.now()
    with service.store.write() as connection:
        if people.user_named(connection, body.name) is not None:
            raise Problem("conflict", f"there is a user '{body.name}' already")
        _must_be_place(connection, body.place)
        key = people.add_user(connection, body.name, None, now)
        people.add_grant(connection, key, body.place, body.role)
        secret = access.new_secret("link")
        people.add_link(connection, access.hash_of(secret), key, now, now + access.LINK)
        detail = {"role": body.role, "place": body.place}
        people.log(connection, now, person.name, "add user", body.name, detail=detail, address=address_of(request))
        made = _user(connection, people.user_named(connection, body.name))
    return models.Invitation(user=made, link=f"welcome#{secret}")


@router.delete(
    "/users/{user}",
    status_code=204,
    response_class=Response,
    responses=refusals("forbidden", "cross-origin", "not-found", "conflict"),
)
def delete_user(user: Key, person: PersonOf, service: ServiceOf, request: Request) -> Response:
    """Locks a user out and ends their sessions; the name stays in the audit log."""
    need("admin", person)
    now = service.clock.now()
    with service.store.write() as connection:
        row = people.user_named(connection, user)
        if row is None:
            raise Problem("not-found", f"there is no user '{user}'")
        people.disable(connection, row.id, now)
        if not people.has_admin(connection):
            raise Problem("conflict", "nobody would be left to administer the site; make another administrator first")
        people.log(connection, now, person.name, "disable user", user, address=address_of(request))
    return Response(status_code=204)


@router.get("/grants", response_model=models.Page[models.Grant], responses=refusals("forbidden"))
def get_grants(connection: Reading, person: PersonOf) -> models.Page[models.Grant]:
    """Who may do what where."""
    need("admin", person)
    return models.Page(items=[_grant(row) for row in people.grants(connection)])


@router.post(
    "/grants", status_code=201, response_model=models.Grant, responses=refusals("forbidden", "cross-origin", "conflict")
)
def post_grant(body: models.NewGrant, person: PersonOf, service: ServiceOf, request: Request) -> models.Grant:
    """Gives a role on a place; one of before on the same place ends."""
    need("admin", person)
    now = service.clock.now()
    with service.store.write() as connection:
        user = people.user_named(connection, body.user)
        if user is None:
            raise Problem("invalid", f"'user': there is no user '{body.user}'")
        _must_be_place(connection, body.place)
        number = people.add_grant(connection, user.id, body.place, body.role)
        _keep_an_admin(connection)
        people.log(
            connection, now, person.name, "grant", body.user, detail=body.model_dump(), address=address_of(request)
        )
        found = next(row for row in people.grants(connection, user.id) if row.id == number)
    return _grant(found)


def _keep_an_admin(connection: Connection) -> None:
    if people.count_users(connection) and not people.has_admin(connection):
        raise Problem("conflict", "nobody would be left to administer the site; make another administrator first")


@router.delete(
    "/grants/{grant}",
    status_code=204,
    response_class=Response,
    responses=refusals("forbidden", "cross-origin", "not-found", "conflict"),
)
def delete_grant(
    grant: Annotated[int, Path(ge=0, le=LARGEST)], person: PersonOf, service: ServiceOf, request: Request
) -> Response:
    """Takes a role."""
    need("admin", person)
    with service.store.write() as connection:
        if not people.remove_grant(connection, grant):
            raise Problem("not-found", f"there is no grant {grant}")
        _keep_an_admin(connection)
        now = service.clock.now()
        people.log(connection, now, person.name, "remove grant", str(grant), address=address_of(request))
    return Response(status_code=204)


@router.get("/tokens", response_model=models.Page[models.Token], responses=refusals("forbidden"))
def get_tokens(connection: Reading, person: PersonOf) -> models.Page[models.Token]:
    """All tokens, without their secrets."""
    need("admin", person)
    return models.Page(items=[_token(row) for row in people.tokens(connection)])


@router.post(
    "/tokens", status_code=201, response_model=models.TokenTold, responses=refusals("forbidden", "cross-origin")
)
def post_token(body: models.NewToken, person: PersonOf, service: ServiceOf, request: Request) -> models.TokenTold:
    """Makes a token; its secret is told once."""
    need("admin", person)
    if (body.role == "camera") != (body.camera is not None):
        raise Problem("invalid", "'camera': a token of the role camera names one, and no other does")
    now, secret = service.clock.now(), access.new_secret(f"silo_{body.role}")
    with service.store.write() as connection:
        if body.camera is not None and places.get(connection, "camera", body.camera) is None:
            raise Problem("invalid", f"'camera': there is no camera '{body.camera}'")
        key = people.add_token(connection, access.hash_of(secret), body.role, body.camera, body.name, now)
        detail = body.model_dump()
        people.log(connection, now, person.name, "add token", key, detail=detail, address=address_of(request))
        found = next(row for row in people.tokens(connection) if row.id == key)
    return models.TokenTold(token=_token(found), secret=secret)


@router.delete(
    "/tokens/{token}",
    status_code=204,
    response_class=Response,
    responses=refusals("forbidden", "cross-origin", "not-found"),
)
def delete_token(token: Key, person: PersonOf, service: ServiceOf, request: Request) -> Response:
    """Revokes a token."""
    need("admin", person)
    now = service.clock.now()
    with service.store.write() as connection:
        if not people.revoke(connection, token, now):
            raise Problem("not-found", f"there is no token '{token}'")
        people.log(connection, now, person.name, "revoke token", token, address=address_of(request))
    return Response(status_code=204)


@router.get("/audit", response_model=models.Page[models.AuditLine], responses=refusals("forbidden"))
def get_audit(
    connection: Reading,
    person: PersonOf,
    after: Annotated[int | None, Query(ge=0, le=LARGEST)] = None,
    count: Count = 200,
) -> models.Page[models.AuditLine]:
    """Who did what, the newest first."""
    need("admin", person)
    rows = people.audited(connection, after, count + 1)
    names = ("id", "who", "action", "subject", "detail", "address")
    items = [models.AuditLine(**{n: getattr(row, n) for n in names}, time=at(row.time)) for row in rows[:count]]
    return models.Page(items=items, next=str(rows[count - 1].id) if len(rows) > count else None)
