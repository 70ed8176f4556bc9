"""The base of what the API answers, pages of it, and problems."""

from __future__ import annotations

import re
from datetime import datetime
from typing import Annotated, Generic, Literal, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

Item = TypeVar("Item")


def _written(value: object) -> object:
    """Times are written out: a bare number could be seconds, milliseconds, or a year."""
    if isinstance(value, int | float) or (isinstance(value, str) and not re.match(r"\d{4}-\d\d-\d\d", value)):
        raise ValueError("must be a time such as 2026-03-01T06:00:00Z")
    return value


Time = Annotated[datetime, BeforeValidator(_written)]
"""A time that is sent."""

Clock = Literal["good", "corrected", "suspect"]


class Model(BaseModel):
    """An answer."""

    model_config = ConfigDict(frozen=True)


class Page(Model, Generic[Item]):
    """Some of many."""

    items: list[Item]
    next: str | None = Field(default=None, description="Cursor of what follows; null at the end. Give it as `after`.")


class Problem(Model):
    """RFC 9457 problem details."""

    type: str
    title: str
    status: int
    detail: str
    slug: str
