"""Alerts."""

from __future__ import annotations

from datetime import datetime
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from siloscope.monitor.api.models.base import Model


class Alert(Model):
    """Something a person should know."""

    id: str
    rule: str
    kind: str
    meaning: str
    silo: str
    state: Literal["firing", "resolved"]
    since: datetime = Field(description="When the value went beyond the level.")
    fired: datetime
    resolved: datetime | None
    value: float | None
    threshold: float | None
    unit: str
    acknowledged: datetime | None
    acknowledged_by: str | None
    note: str | None
    version: int


class Acknowledgement(BaseModel):
    """Who acknowledges an alert is known; a note is not needed."""

    model_config = ConfigDict(extra="forbid")
    note: str | None = Field(None, max_length=2000)


class Delivery(Model):
    """An alert on its way to a channel."""

    id: int
    channel: str
    key: str = Field(description="The same for every attempt.")
    alert: str | None
    state: Literal["pending", "failed", "delivered"]
    created: datetime
    attempts: int
    next: datetime | None = Field(description="When it is tried again.")
    delivered: datetime | None
    error: str | None = Field(description="Of the last attempt.")
