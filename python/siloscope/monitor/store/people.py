"""Users, what they may do where, sessions, tokens, one-time links, and the audit log. Secrets are kept as hashes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import Connection, bindparam, delete, func, insert, select, update

from siloscope.monitor.store.engine import new_id
from siloscope.monitor.store.rows import Record
from siloscope.monitor.store.schema_people import audit, grant, link, session, token, user

ROLES = ("percent", "viewer", "operator", "admin")
"""From least to most: how full alone; everything to see; acknowledge, tickets, product; settings and people."""

TOKEN_ROLES = ("camera", "read", "metrics", "edge", "admin")


def count_users(connection: Connection) -> int:
    """Users that can sign in."""
    chosen = [user.c.disabled.is_(None), user.c.password.is_not(None)]
    return connection.execute(select(func.count()).select_from(user).where(*chosen)).scalar_one()


def users(connection: Connection) -> Sequence[Record]:
    """All users, without what their passwords hash to."""
    columns = (user.c.id, user.c.name, user.c.created, user.c.disabled)
    return connection.execute(select(*columns).order_by(user.c.name)).all()


def user_named(connection: Connection, name: str) -> Record | None:
    """A user."""
    return connection.execute(select(user).where(user.c.name == name)).one_or_none()


def add_user(connection: Connection, name: str, password: str | None, now: int) -> str:
    """Adds a user; `password` is its hash."""
    key = new_id()
    connection.execute(insert(user).values(id=key, name=name, password=password, created=now))
    return key


def set_password(connection: Connection, key: str, password: str) -> None:
    """Sets the hash and ends the user's sessions."""
    connection.execute(update(user).where(user.c.id == key).values(password=password))
    connection.execute(delete(session).where(session.c.user == key))


def disable(connection: Connection, key: str, now: int) -> None:
    """Locks a user out."""
    connection.execute(update(user).where(user.c.id == key).values(disabled=now))
    connection.execute(delete(session).where(session.c.user == key))


def grants(connection: Connection, user_id: str | None = None) -> Sequence[Record]:
    """What users may do where; a grant without a place is for the whole site."""
    wanted = select(grant, user.c.name.label("user_name")).join(user, user.c.id == grant.c.user)
    if user_id is not None:
        wanted = wanted.where(grant.c.user == user_id)
    return connection.execute(wanted.order_by(grant.c.id)).all()


def add_grant(connection: Connection, user_id: str, place: str | None, role: str) -> int:
    """Gives a role on a place; one of before on the same place ends."""
    same = [grant.c.user == user_id, grant.c.place.is_(None) if place is None else grant.c.place == place]
    connection.execute(delete(grant).where(*same))
    made = insert(grant).values(user=user_id, place=place, role=role).returning(grant.c.id)
    return int(connection.execute(made).scalar_one())


def remove_grant(connection: Connection, number: int) -> bool:
    """Takes a role; whether there was one."""
    return connection.execute(delete(grant).where(grant.c.id == number)).rowcount == 1


def add_session(connection: Connection, hashed: str, user_id: str, now: int, expires: int) -> None:
    """Signs a user in; sessions that are over go."""
    connection.execute(delete(session).where(session.c.expires < now))
    connection.execute(insert(session).values(hash=hashed, user=user_id, created=now, expires=expires))


def session_user(connection: Connection, hashed: str, now: int) -> Record | None:
    """Who a session is of."""
    chosen = [session.c.hash == hashed, session.c.expires > now, user.c.disabled.is_(None)]
    return connection.execute(select(user).join(session, session.c.user == user.c.id).where(*chosen)).one_or_none()


def end_session(connection: Connection, hashed: str) -> None:
    """Signs out."""
    connection.execute(delete(session).where(session.c.hash == hashed))


def add_link(connection: Connection, hashed: str, user_id: str | None, now: int, expires: int) -> None:
    """A link by which a password is set once; without a user, the first administrator's."""
    connection.execute(insert(link).values(hash=hashed, user=user_id, created=now, expires=expires))


def use_link(connection: Connection, hashed: str, now: int) -> Record | None:
    """Uses a link up; None where it is unknown, old or used."""
    chosen = [link.c.hash == hashed, link.c.used.is_(None), link.c.expires > now]
    found = connection.execute(select(link).where(*chosen)).one_or_none()
    if found is not None:
        connection.execute(update(link).where(link.c.hash == hashed).values(used=now))
    return found


def add_token(connection: Connection, hashed: str, role: str, camera: str | None, name: str | None, now: int) -> str:
    """Adds a token."""
    key = new_id()
    connection.execute(insert(token).values(id=key, hash=hashed, role=role, camera=camera, name=name, created=now))
    return key


OF_HASH = select(token).where(token.c.hash == bindparam("told"), token.c.revoked.is_(None))
"""Every request with a token asks it; made once."""


def token_of(connection: Connection, hashed: str) -> Record | None:
    """The token that hashes to this, unless revoked."""
    return connection.execute(OF_HASH, {"told": hashed}).one_or_none()


def tokens(connection: Connection) -> Sequence[Record]:
    """All tokens, without their hashes."""
    columns = [column for column in token.c if column.name != "hash"]
    return connection.execute(select(*columns).order_by(token.c.created)).all()


def revoke(connection: Connection, key: str, now: int) -> bool:
    """Ends a token; whether there was one."""
    chosen = [token.c.id == key, token.c.revoked.is_(None)]
    return connection.execute(update(token).where(*chosen).values(revoked=now)).rowcount == 1


def log(connection: Connection, now: int, who: str, action: str, subject: str | None = None, **more: Any) -> None:
    """Adds a line to the audit log; `more` is `detail` and `address`."""
    connection.execute(insert(audit).values(time=now, who=who, action=action, subject=subject, **more))


def audited(connection: Connection, before: int | None, count: int) -> Sequence[Record]:
    """Lines of the audit log, the newest first."""
    wanted = select(audit)
    if before is not None:
        wanted = wanted.where(audit.c.id < before)
    return connection.execute(wanted.order_by(audit.c.id.desc()).limit(count)).all()


def has_admin(connection: Connection) -> bool:
    """Whether somebody that can sign in administers the whole site."""
    chosen = [grant.c.role == "admin", grant.c.place.is_(None), user.c.disabled.is_(None), user.c.password.is_not(None)]
    wanted = select(func.count()).select_from(grant.join(user, user.c.id == grant.c.user)).where(*chosen)
    return connection.execute(wanted).scalar_one() > 0


def name_of(connection: Connection, key: str) -> str:
    """A user's name."""
    return str(connection.execute(select(user.c.name).where(user.c.id == key)).scalar_one())


def prune(connection: Connection, before: int) -> int:
    """Forgets lines of the audit log from before a time."""
    return connection.execute(delete(audit).where(audit.c.time < before)).rowcount
