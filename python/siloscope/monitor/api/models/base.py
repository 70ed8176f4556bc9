"""The base of what the API answers, pages of it, and problems."""

from __future__ import annotations

from typing import Generic, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field

Item = TypeVar("Item")

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
