"""What is told of a silo to other systems: one picture of it, from which each publisher takes what it can say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from sqlalchemy import Connection

from siloscope.monitor.clock import DAY, SECOND, SUSPECT
from siloscope.monitor.store import alerts, frames, places, readings

Status = Literal["ok", "refused", "stale", "silent", "no-calibration"]

STATUSES: tuple[Status, ...] = ("ok", "refused", "stale", "silent", "no-calibration")
"""In the order of their numbers in Modbus: the newest frame has an answer; it has none, but a fresh one before; the
newest answer is too old though frames come; no frame comes; frames come, but there is no calibration."""


@dataclass(frozen=True)
class Image:
    """A silo at a moment. Times in µs."""

    silo: Any
    place: str | None
    """Name of its place."""
    status: Status
    last: Any
    """The newest answer, however old; None where there is none."""
    age: int | None
    empty_by: int | None
    days_left: float | None
    alerts: tuple[str, ...]
    """Kinds of the alerts that are on."""

    @property
    def fresh(self) -> bool:
        """Whether the newest answer may be shown as what is in the silo."""
        return self.status in ("ok", "refused")

    @property
    def codes(self) -> tuple[str, ...]:
        """Remarks of the newest answer."""
        return () if self.last is None else tuple(remark["code"] for remark in self.last.quality)


def images(connection: Connection, now: int) -> list[Image]:
    """All silos."""
    cameras = places.listed(connection, "camera")
    on: dict[str, list[str]] = {}
    for row in alerts.firing(connection):
        on.setdefault(row.silo, []).append(row.kind)
    return [
        _image(connection, silo, [camera for camera in cameras if camera.silo == silo.id], on.get(silo.id, []), now)
        for silo in places.listed(connection, "silo")
    ]


def _image(connection: Connection, silo: Any, cameras: Sequence[Any], on: Sequence[str], now: int) -> Image:
    last = readings.last(connection, silo.id, answered=True)
    forecast = readings.forecast_of(connection, silo.id)
    place = None if silo.place is None else places.get(connection, "place", silo.place)
    status = _status(connection, silo, cameras, last, now)
    empty_by = None if forecast is None or status not in ("ok", "refused") else forecast.empty_by
    return Image(
        silo,
        None if place is None else place.name,
        status,
        last,
        None if last is None else max(0, now - last.time),
        empty_by,
        None if empty_by is None else max(0.0, (empty_by - now) / DAY),
        tuple(sorted(on)),
    )


def _status(connection: Connection, silo: Any, cameras: Sequence[Any], last: Any, now: int) -> Status:
    limit = now - silo.stale_after_s * SECOND
    newest = readings.newest(connection, silo.id, 1)
    if last is not None and last.time >= limit:
        return "ok" if newest[0].status == "ok" else "refused"
    came = [row for camera in cameras if (row := frames.newest(connection, camera.id)) is not None]
    recent = [row for row in came if row.captured >= limit and row.clock != SUSPECT]
    if not recent and not (newest and newest[0].time >= limit):
        return "silent"
    return "no-calibration" if any(row.state == frames.GATHERING for row in recent) else "stale"
