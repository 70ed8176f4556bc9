"""What is in a silo: readings, trends, surfaces, events, forecasts."""

from __future__ import annotations

from datetime import datetime
from typing import Literal

from pydantic import Field

from siloscope.monitor.api.models.base import Clock, Model


class Remark(Model):
    """A remark on a reading, from the table in docs/reasons.md."""

    code: str
    message: str
    severity: Literal["note", "warning", "refusal"]
    advice: str | None = None


class Level(Model):
    """Heights of the surface over the datum, m."""

    mean: float | None
    min: float | None
    max: float | None
    at_axis: float | None
    std: float | None = Field(description="Standard deviation of the mean.")


class Reading(Model):
    """What one frame says about a silo's content. A number that is not known is null, never made up."""

    id: int
    silo: str
    time: datetime = Field(description="When the frame was taken.")
    clock: Clock = Field(description="How far `time` can be trusted; suspect times are kept out of trends.")
    status: Literal["ok", "refused"]
    reason: str | None = None
    message: str | None = None
    volume_m3: float | None = None
    volume_std_m3: float | None = None
    fill_fraction: float | None = None
    fill_std: float | None = None
    free_m3: float | None = None
    capacity_m3: float | None = None
    ullage_m3: float | None = None
    ullage_std_m3: float | None = None
    mass_kg: float | None = None
    mass_std_kg: float | None = None
    level_m: Level | None = None
    height_datum: str | None = Field(
        default=None, description="Where heights are 0: cone-vertex, floor or lowest-seen."
    )
    coverage: float | None = Field(default=None, description="Fraction of the surface that is really seen.")
    quality: list[Remark] = Field(default_factory=list)
    frame: str | None = None
    camera: str | None = None
    calibration: str | None = None
    run: int | None = None
    superseded: bool = False


class Attempt(Model):
    """The newest frame's outcome, where it differs from the newest answer."""

    time: datetime
    status: Literal["ok", "refused"]
    reason: str | None
    message: str | None
    frame: str | None
    quality: list[Remark]


class CameraState(Model):
    """A camera as it is heard of."""

    id: str
    last_frame: str | None
    last_captured: datetime | None
    last_received: datetime | None
    last_state: str | None
    moved_since: datetime | None = Field(description="Since when its view contradicts its calibration.")
    proposed_calibration: str | None = Field(description="A calibration that waits to be confirmed.")


State = Literal["ok", "refused", "stale", "no-data", "no-calibration"]


class Now(Model):
    """A silo's newest answer with its age. Stale numbers are given, and said to be stale."""

    silo: str
    state: State = Field(
        description="ok; refused: the newest frame has no answer; stale: older than `stale_after_s`; no-data: never a "
        "reading; no-calibration: frames wait for one."
    )
    time: datetime | None = None
    age_s: float | None = None
    stale: bool
    stale_after_s: int
    clock: Clock | None = None
    status: Literal["ok", "refused"] | None = None
    volume_m3: float | None = None
    volume_std_m3: float | None = None
    fill_fraction: float | None = None
    fill_std: float | None = None
    free_m3: float | None = None
    capacity_m3: float | None = None
    ullage_m3: float | None = None
    ullage_std_m3: float | None = None
    mass_kg: float | None = None
    mass_std_kg: float | None = None
    level_m: Level | None = None
    height_datum: str | None = None
    coverage: float | None = None
    quality: list[Remark] = Field(default_factory=list)
    reading: int | None = None
    frame: str | None = None
    calibration: str | None = None
    last_attempt: Attempt | None = None
    cameras: list[CameraState] = Field(default_factory=list)


class Forecast(Model):
    """Daily use over the last four weeks, and when the silo will be empty if it goes on so."""

    silo: str
    known: bool = Field(description="False where there is no day of history yet, or nothing was withdrawn.")
    computed: datetime | None = None
    daily_m3: float | None = None
    daily_std_m3: float | None = None
    day_to_day_std_m3: float | None = None
    daily_kg: float | None = None
    empty_by: datetime | None = None
    earliest: datetime | None = Field(default=None, description="Beginning of the 95 % band; the conservative date.")
    latest: datetime | None = None


class Bucket(Model):
    """Readings of a stretch of time."""

    time: datetime = Field(description="Beginning of the stretch.")
    end: datetime
    count: int
    volume_m3: float | None
    volume_std_m3: float | None
    volume_min_m3: float | None
    volume_max_m3: float | None
    fill_fraction: float | None
    mass_kg: float | None


class Trend(Model):
    """Means over equal stretches; a stretch without a reading is left out and is a gap."""

    silo: str
    since: datetime
    until: datetime
    bucket_s: float
    items: list[Bucket]


class Vessel(Model):
    """What the vessel is drawn from; null where not known. z is down from the camera's height."""

    radius_m: float | None
    top_z_m: float | None
    cylinder_bottom_z_m: float | None
    bottom_z_m: float | None
    bottom: str | None
    datum_z_m: float | None = Field(description="z of height 0.")


class Surface(Model):
    """A surface over the cross-section. Rows run along y, columns along x of the silo frame, from minus to plus."""

    silo: str
    time: datetime
    reading: int
    side: int = Field(description="Cells along a side.")
    half_width_m: float
    radius_m: float | None
    height_datum: str | None
    heights_m: list[list[float | None]] = Field(description="Heights over the datum; null outside the silo.")
    std_m: list[list[float | None]]
    seen: list[list[bool]] = Field(description="Cells that were really seen.")
    vessel: Vessel


class Event(Model):
    """A refill or a withdrawal."""

    id: str
    silo: str
    kind: Literal["refill", "withdrawal"]
    start: datetime
    end: datetime
    volume_m3: float
    volume_std_m3: float
    mass_kg: float | None
