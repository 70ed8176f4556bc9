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


class PoseStd(Model):
    """Standard deviations of a pose."""

    r_x: float | None
    r_y: float | None
    t_x: float | None
    t_y: float | None


class Pose(Model):
    """How a camera hangs in its silo, by its newest frame alone: numbers of `siloscope.locate`, radians and metres."""

    camera: str
    silo: str
    frame: str | None = Field(default=None, description="null where no frame has come yet.")
    time: datetime | None = None
    status: Literal["ok", "refused"] | None = None
    reason: str | None = None
    message: str | None = None
    r_x: float | None = None
    r_y: float | None = None
    t_x: float | None = None
    t_y: float | None = None
    std: PoseStd | None = None


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
