"""Who asks, and what they may do: tokens, sessions, and nobody on this machine until there is a user."""

from __future__ import annotations

import hashlib
import hmac
import os
import secrets
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from sqlalchemy import Connection

from siloscope.errors import UsageError
from siloscope.monitor.clock import DAY
from siloscope.monitor.store import people, places

if TYPE_CHECKING:
    from siloscope.monitor.service import Service

SESSION = 30 * DAY
LINK = DAY

RANK = {role: rank for rank, role in enumerate(people.ROLES)}

N, R, P = 1 << 15, 8, 3
"""Cost of scrypt: about a quarter of a second."""

SHORTEST_PASSWORD = 10

EVERYWHERE = None
"""The place of a grant for the whole site."""


@dataclass(frozen=True)
class Person:
    """Who asks."""

    name: str
    kind: Literal["user", "token", "local"]
    """"user", "token", or "local": somebody on this machine while there is no user."""
    grants: tuple[tuple[str | None, str], ...] = ()
    """Places and roles on them."""
    camera: str | None = None
    """The camera whose frames a token may send."""
    metrics: bool = False
    """Whether it may read the metrics."""
    edge: bool = False
    """Whether it is another installation that sends what it measured."""
    session: str | None = field(default=None, repr=False)

    @property
    def highest(self) -> str | None:
        """The highest role anywhere."""
        return max((role for _, role in self.grants), key=lambda role: RANK[role], default=None)

    def role_at(self, around: Sequence[str]) -> str | None:
        """The highest role on a place, given with the places it lies in."""
        roles = [role for place, role in self.grants if place is EVERYWHERE or place in around]
        return max(roles, key=lambda role: RANK[role], default=None)

    def may(self, role: str, around: Sequence[str] = ()) -> bool:
        """Whether it has a role or a higher one there."""
        own = self.role_at(around)
        return own is not None and RANK[own] >= RANK[role]


LOCAL = Person("this machine", "local", ((EVERYWHERE, "operator"),))
"""Before the first user there is nobody to tell apart; only this machine can ask, and it may not make users."""


def hash_of(secret: str) -> str:
    """What is kept of a secret of 256 random bits."""
    return hashlib.sha256(secret.encode()).hexdigest()


def new_secret(prefix: str) -> str:
    """A secret of 256 random bits; the prefix tells what it is for."""
    return f"{prefix}_{secrets.token_urlsafe(32)}"


def hashed_password(password: str) -> str:
    """What is kept of a password."""
    if len(password) < SHORTEST_PASSWORD:
        raise UsageError(f"a password has at least {SHORTEST_PASSWORD} characters; take a longer one")
    salt = os.urandom(16)
    return f"scrypt${N}${R}${P}${salt.hex()}${_scrypt(password, salt, N, R, P).hex()}"


def matches(password: str, kept: str | None) -> bool:
    """Whether a password is the one; takes as long where there is none."""
    _, n, r, p, salt, digest = (kept or f"scrypt${N}${R}${P}${'00' * 16}${'00' * 32}").split("$")
    found = _scrypt(password, bytes.fromhex(salt), int(n), int(r), int(p))
    return hmac.compare_digest(found, bytes.fromhex(digest)) and kept is not None


def _scrypt(password: str, salt: bytes, n: int, r: int, p: int) -> bytes:
    return hashlib.scrypt(password.encode(), salt=salt, n=n, r=r, p=p, maxmem=256 * n * r, dklen=32)


def by_token(connection: Connection, secret: str) -> Person | None:
    """Who sends a token."""
    row = people.token_of(connection, hash_of(secret))
    if row is None:
        return None
    name = f"token {row.name or row.id}"
    match row.role:
        case "camera":
            return Person(name, "token", camera=row.camera)
        case "metrics":
            return Person(name, "token", metrics=True)
        case "edge":
            return Person(name, "token", ((EVERYWHERE, "viewer"),), edge=True)
        case "admin":
            return Person(name, "token", ((EVERYWHERE, "admin"),), metrics=True)
        case _:
            return Person(name, "token", ((EVERYWHERE, "viewer"),), metrics=True)


def by_session(connection: Connection, secret: str, now: int) -> Person | None:
    """Who is signed in."""
    hashed = hash_of(secret)
    row = people.session_user(connection, hashed, now)
    if row is None:
        return None
    grants = tuple((grant.place, grant.role) for grant in people.grants(connection, row.id))
    return Person(row.name, "user", grants, session=hashed)


def around(connection: Connection, silo: object) -> list[str]:
    """The places a silo lies in."""
    return places.above(connection, getattr(silo, "place", None))


def first_link(service: Service) -> str | None:
    """The address of the page where the first user is made; None where there is one. Earlier links stay good."""
    now = service.clock.now()
    with service.store.write() as connection:
        if people.count_users(connection):
            return None
        secret = new_secret("link")
        people.add_link(connection, hash_of(secret), None, now, now + LINK)
    return f"welcome#{secret}"
