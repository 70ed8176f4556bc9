"""What people set: places, silos, cameras, products, rules, tickets."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from siloscope.monitor.api.models.base import Model, Time
from siloscope.monitor.api.models.people import Given
from siloscope.monitor.clock import zone
from siloscope.monitor.rules import KINDS

Length = Field(default=None, ge=-200.0, le=200.0)
Id = Field(default=None, min_length=1, max_length=80)
Name = Field(default=None, min_length=1, max_length=200)
Zone = Annotated[str, AfterValidator(zone)]


class PlaceChange(Given):
    """What is to change of a place; what is left out stays."""

    parent: str | None = Id
    kind: Literal["mill", "customer", "farm", "barn", "site"] | None = None
    name: str | None = Name
    zone: Zone | None = Field(default=None, max_length=64)


class VesselChange(Given):
    """Inner lengths of a silo, m."""

    diameter: float | None = Field(default=None, ge=0.01, le=200.0)
    cylinder: float | None = Field(default=None, ge=0.0, le=200.0)
    cone: float | None = Field(default=None, ge=0.0, le=200.0)
    bottom: Literal["cone", "flat", "unknown"] | None = None
    top: float | None = Length
    outlet_diameter: float | None = Field(default=None, ge=0.0, le=20.0)
    outlet_length: float | None = Field(default=None, ge=0.0, le=20.0)


class SiloChange(Given):
    """What is to change of a silo; what is left out stays."""

    name: str | None = Name
    place: str | None = Id
    product: str | None = Id
    banner: str | None = Field(
        default=None, max_length=500, description="A notice on the silo, such as out of service."
    )
    vessel: VesselChange | None = None
    stale_after_s: int | None = Field(default=None, ge=1, le=31_536_000)
    modbus_unit: int | None = Field(default=None, ge=1, le=247)
    serial: int | None = Field(default=None, ge=0, le=4_294_967_295)


class CameraChange(Given):
    """What is to change of a camera; what is left out stays."""

    silo: str | None = Id
    intrinsics: str | None = Field(default=None, max_length=1 << 20, description="Text of a camera file.")
    sensor: str | None = Field(default=None, max_length=80, description="Name of a sensor profile.")
    depth_unit: float | None = Field(default=None, gt=0.0, le=1.0)
    expected_s: int | None = Field(default=None, ge=1, le=31_536_000)


class ProductChange(Given):
    """What is to change of a product."""

    name: str | None = Name
    density_kg_m3: float | None = Field(default=None, ge=10.0, le=10_000.0)
    density_std_kg_m3: float | None = Field(default=None, ge=0.0, le=10_000.0)


class Rule(Model):
    """When an alert fires, and for which silos: the one that names a silo wins over a place's, and that over all."""

    id: str
    kind: str
    meaning: str
    unit: str
    silo: str | None
    place: str | None
    level: float | None = Field(description="Beyond it the rule is active; null for no-data is the silo's own limit.")
    clear: float | None = Field(description="Back beyond it the alert ends.")
    delay_s: int
    channels: list[str]
    enabled: bool
    version: int


class RuleChange(Given):
    """What is to change of a rule."""

    kind: Literal[KINDS] | None = None  # type: ignore[valid-type]
    silo: str | None = Id
    place: str | None = Id
    level: float | None = Field(default=None, ge=-1e9, le=1e9)
    clear: float | None = Field(default=None, ge=-1e9, le=1e9)
    delay_s: int | None = Field(default=None, ge=0, le=31_536_000)
    channels: list[str] | None = Field(default=None, max_length=20)
    enabled: bool | None = None


class Ticket(Model):
    """A weighbridge ticket: what was delivered (positive) or taken away (negative)."""

    id: str
    silo: str
    time: datetime
    mass_kg: float
    number: str | None
    note: str | None
    created: datetime
    created_by: str


class NewTicket(Given):
    """A ticket to be noted."""

    time: Time
    mass_kg: float = Field(ge=-1e7, le=1e7)
    number: str | None = Field(default=None, max_length=80)
    note: str | None = Field(default=None, max_length=2000)


class Recomputed(Model):
    """A new run over frames that are still there; their old readings stay."""

    run: int
    frames: int
