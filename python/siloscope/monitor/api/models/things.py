"""Places, silos, cameras, products, calibrations, the installation."""

from __future__ import annotations

from datetime import datetime
from typing import Literal

from pydantic import Field

from siloscope.monitor.api.models.base import Model
from siloscope.monitor.api.models.contents import CameraState, Forecast, Now, Vessel


class Place(Model):
    """A mill, customer, farm, barn."""

    id: str
    parent: str | None
    kind: str
    name: str
    zone: str | None
    version: int


class Live(Model):
    """A camera that the service drives itself."""

    source: str = Field(description="realsense, orbbec, folder, inbox, command.")
    state: Literal["starting", "ok", "failing"]
    problem: str | None = Field(description="Why it gives no frames, in English.")
    since: datetime


class Camera(Model):
    """A camera and what is known of it."""

    id: str
    silo: str
    sensor: str | None
    depth_unit: float | None
    expected_s: int | None
    has_intrinsics: bool
    version: int
    state: CameraState
    live: Live | None = Field(description="Null where the camera sends its frames.")


class Product(Model):
    """What a silo may hold."""

    id: str
    name: str
    density_kg_m3: float
    density_std_kg_m3: float
    version: int


class UsualProduct(Model):
    """A product of the built-in table, to begin from."""

    name: str
    density_kg_m3: float
    density_std_kg_m3: float


class Silo(Model):
    """A silo with what a card shows."""

    id: str
    name: str
    place: str | None
    product: str | None
    banner: str | None
    vessel: dict[str, str | float | None] = Field(description="Lengths as they were told.")
    drawn: Vessel | None = Field(description="What the silo is drawn from; null for who sees percent only.")
    stale_after_s: int
    modbus_unit: int | None
    serial: int | None
    zone: str
    version: int
    role: str = Field(description="What who asks may do here: percent, viewer, operator or admin.")
    now: Now
    forecast: Forecast
    alerts_firing: int
    alerts_unacknowledged: int


class Calibration(Model):
    """A calibration of a camera in its silo."""

    id: str
    silo: str
    camera: str
    sha256: str
    origin: Literal["site", "uploaded", "gathered", "moved"]
    state: Literal["confirmed", "proposed", "rejected"]
    frames: int
    created: datetime
    valid_from: datetime
    valid_to: datetime | None
    confirmed_by: str | None


class Run(Model):
    """What measured readings of a silo; the readings of an older run stay beside those that replaced them."""

    id: int
    version: str = Field(description="Of siloscope.")
    config: str = Field(description="Hash of the settings; of an imported run its id.")
    origin: str = Field(description="measured, recomputed, fleet (imported), edge, simulated.")
    created: datetime
    note: str | None
    current: int = Field(description="Readings that count.")
    replaced: int = Field(description="Readings that a later run replaced.")
    first: datetime
    last: datetime


class Site(Model):
    """The whole installation, and who asks."""

    name: str | None
    zone: str
    box: str
    version: str
    demo: bool
    time: datetime = Field(description="The server's time.")
    person: str
    kind: Literal["user", "token", "local"]
    role: str | None
    needs_user: bool = Field(description="Whether no user exists yet.")
    disk_free_bytes: int
    disk_total_bytes: int
    disk_short: bool = Field(description="Whether no frames are taken for want of room.")
    frames_queued: int
    frames_failed: int
    last_change: int = Field(description="Number of the last change; where the stream of events begins.")


class Health(Model):
    """Whether the service is alive, or ready."""

    status: Literal["ok", "not-ready"]
    version: str
    detail: dict[str, str | int | float | bool | None]


class Change(Model):
    """One line of the log of changes; the stream of events carries the same."""

    id: int
    kind: str
    subject: str
    silo: str | None
    time: datetime
