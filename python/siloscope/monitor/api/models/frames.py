"""Frames."""

from __future__ import annotations

from datetime import datetime
from typing import Literal

from pydantic import Field

from siloscope.monitor.api.models.base import Clock, Model
from siloscope.monitor.api.models.contents import Reading


class FrameTaken(Model):
    """A frame that is on the disk and in the database."""

    frame: str


class Frame(Model):
    """A frame and what became of it."""

    id: str
    camera: str
    silo: str
    sha256: str
    state: Literal["queued", "measuring", "measured", "gathering", "failed"] = Field(
        description="gathering: waits for its camera's calibration."
    )
    captured: datetime
    received: datetime
    clock: Clock
    format: str
    bytes: int
    kept: bool = Field(description="Whether the bytes are still there.")
    attempts: int
    error: str | None
    reading: Reading | None
