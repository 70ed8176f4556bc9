"""People, tokens, grants, the audit log; and signing in."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from siloscope.monitor.api.models.base import Model

Role = Literal["percent", "viewer", "operator", "admin"]
TokenRole = Literal["camera", "read", "metrics", "edge", "admin"]


class Given(BaseModel):
    """What is sent; entries that are not known are a mistake."""

    model_config = ConfigDict(extra="forbid")

    @model_validator(mode="before")
    @classmethod
    def _no_truth_for_a_number(cls, sent: Any) -> Any:
        for name, value in sent.items() if isinstance(sent, dict) else ():
            field = cls.model_fields.get(name)
            if isinstance(value, bool) and field is not None and "bool" not in str(field.annotation):
                raise ValueError(f"'{name}' must not be true or false")
        return sent


class SignIn(Given):
    """A user's name and password."""

    name: str = Field(min_length=1, max_length=80)
    password: str = Field(min_length=1, max_length=1000)


class Welcome(Given):
    """A one-time link's secret and what it is used for."""

    link: str = Field(min_length=1, max_length=200)
    name: str | None = Field(default=None, min_length=1, max_length=80, description="Of the first user.")
    password: str = Field(min_length=10, max_length=1000)


class Grant(Model):
    """A role on a place and all that lies in it; null is everywhere."""

    id: int
    user: str
    place: str | None
    role: Role


class RoleAt(Model):
    """A role on a place; null is everywhere."""

    place: str | None
    role: Role


class Session(Model):
    """Who is signed in."""

    person: str
    kind: Literal["user", "token", "local"]
    role: Role | None
    grants: list[RoleAt]


class User(Model):
    """A user."""

    id: str
    name: str
    created: datetime
    disabled: datetime | None
    grants: list[Grant]


class NewUser(Given):
    """A user to be made, with a first role."""

    name: str = Field(min_length=1, max_length=80, pattern=r"^[^\x00-\x1f\x7f]+$")
    role: Role = "viewer"
    place: str | None = Field(default=None, max_length=80)


class Invitation(Model):
    """A user and the link where the password is set, told once."""

    user: User
    link: str


class NewGrant(Given):
    """A role to be given; it takes the place of one on the same place."""

    user: str = Field(max_length=80)
    place: str | None = Field(default=None, max_length=80)
    role: Role


class Token(Model):
    """A token without its secret."""

    id: str
    role: TokenRole
    camera: str | None
    name: str | None
    created: datetime
    revoked: datetime | None


class NewToken(Given):
    """A token to be made."""

    role: TokenRole
    camera: str | None = Field(default=None, max_length=80)
    name: str | None = Field(default=None, max_length=200)


class TokenTold(Model):
    """A token with its secret, told once."""

    token: Token
    secret: str


class AuditLine(Model):
    """Who did what."""

    id: int
    time: datetime
    who: str
    action: str
    subject: str | None
    detail: dict[str, Any] | None
    address: str | None
