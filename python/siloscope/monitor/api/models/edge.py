"""What a box at the edge sends to its hub, and gets from it. Times are µs of UTC, as both stores have them."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Base64Bytes, Field

from siloscope.monitor.api.models.base import Model
from siloscope.monitor.api.models.contents import Remark
from siloscope.monitor.api.models.people import Given

Id = Annotated[str, Field(min_length=1, max_length=80)]
Text = Annotated[str | None, Field(max_length=4000)]
Micros = Annotated[int, Field(ge=0, lt=1 << 53)]
Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
Amount = Annotated[float | None, Field(allow_inf_nan=False)]


class EdgeValues(Given):
    """A reading's columns."""

    status: Literal["ok", "refused"]
    reason: Text = None
    message: Text = None
    volume: Amount = None
    volume_std: Amount = None
    own_std: Amount = None
    ullage: Amount = None
    ullage_std: Amount = None
    fill: Amount = None
    capacity: Amount = None
    mass: Amount = None
    mass_std: Amount = None
    density: Amount = None
    level: Amount = None
    level_min: Amount = None
    level_max: Amount = None
    level_axis: Amount = None
    level_std: Amount = None
    datum: Annotated[str | None, Field(max_length=20)] = None
    distance: Amount = None
    distance_min: Amount = None
    distance_max: Amount = None
    coverage: Amount = None
    quality: Annotated[list[Remark], Field(max_length=100)] = Field(default_factory=list)


class EdgeReading(Given):
    """A reading with the frame it is of."""

    camera: Id
    sha256: Sha256
    format: Annotated[str, Field(max_length=20)]
    bytes: Annotated[int, Field(ge=0, lt=1 << 31)]
    time: Micros
    clock: Literal["good", "corrected", "suspect"]
    current: bool = Field(description="Whether its time is by the clock that `sent` is by.")
    run: Annotated[int, Field(ge=0, lt=1 << 53)]
    run_version: Annotated[str, Field(max_length=40)]
    run_config: Annotated[str, Field(max_length=64)]
    calibration: Annotated[str | None, Field(max_length=36)]
    values: EdgeValues
    surface: Annotated[Base64Bytes | None, Field(max_length=100_000)]


class EdgeReadings(Given):
    """What a box has measured."""

    box: Id
    sent: Micros
    readings: Annotated[list[EdgeReading], Field(max_length=500)]


class EdgeTaken(Model):
    """All of it is safe; how much was new."""

    new: int


class EdgeCalibration(Given):
    """A calibration that a box made."""

    silo: Id
    camera: Id
    origin: Annotated[str, Field(max_length=20)]
    state: Literal["confirmed", "proposed", "rejected"]
    frames: Annotated[int, Field(ge=0, lt=1 << 31)]
    valid_from: Micros
    valid_to: Micros | None
    confirmed_by: Text
    document: Annotated[Base64Bytes, Field(max_length=8 << 20)]


class EdgeAcknowledgement(Given):
    """That somebody at a box has seen an alert."""

    silo: Id
    kind: Id
    who: Id
    note: Text = None


class EdgeSettings(Model):
    """What a box goes by, as rows of the store."""

    cursor: int = Field(description="Number of the last change that is in it.")
    settings: dict[str, list[dict[str, Any]]]
