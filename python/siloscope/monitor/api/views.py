"""From the store's rows to what the API answers."""

from __future__ import annotations

from typing import Any, Literal

from sqlalchemy import Connection

from siloscope.monitor import rules
from siloscope.monitor.api import models, vessels
from siloscope.monitor.clock import SECOND, moment
from siloscope.monitor.store import alerts, frames, places, readings


def at(micros: int | None) -> Any:
    """A time, or none."""
    return None if micros is None else moment(micros)


def level(row: Any) -> models.Level | None:
    """Heights of a reading."""
    if row.level is None:
        return None
    return models.Level(mean=row.level, min=row.level_min, max=row.level_max, at_axis=row.level_axis, std=row.level_std)


def remarks(row: Any) -> list[models.Remark]:
    """A reading's remarks."""
    names = models.Remark.model_fields
    return [models.Remark(**{name: remark.get(name) for name in names}) for remark in row.quality]


def amounts(row: Any) -> dict[str, Any]:
    """What a reading says of the content."""
    relative = row.capacity and row.volume_std is not None
    return {
        "clock": row.clock,
        "status": row.status,
        "volume_m3": row.volume,
        "volume_std_m3": row.volume_std,
        "fill_fraction": row.fill,
        "fill_std": row.volume_std / row.capacity if relative else None,
        "free_m3": None if row.volume is None or row.capacity is None else row.capacity - row.volume,
        "capacity_m3": row.capacity,
        "ullage_m3": row.ullage,
        "ullage_std_m3": row.ullage_std,
        "mass_kg": row.mass,
        "mass_std_kg": row.mass_std,
        "level_m": level(row),
        "height_datum": row.datum,
        "coverage": row.coverage,
        "quality": remarks(row),
    }


def reading(row: Any) -> models.Reading:
    """A reading."""
    return models.Reading(
        id=row.id,
        silo=row.silo,
        time=at(row.time),
        reason=row.reason,
        message=row.message,
        frame=row.frame,
        camera=row.camera,
        calibration=row.calibration,
        run=row.run,
        superseded=row.superseded is not None,
        **amounts(row),
    )


def only_percent(found: Any) -> Any:
    """What the lowest role sees of an answer: how full, when, and how sure that is."""
    hidden = [name for name in type(found).model_fields if name.endswith(("_m3", "_kg", "_m")) or name == "level_m"]
    return found.model_copy(update=dict.fromkeys(hidden))


def camera_state(connection: Connection, camera: Any) -> models.CameraState:
    """What is heard of a camera."""
    last = frames.newest(connection, camera.id)
    proposed = places.proposed(connection, camera.id)
    return models.CameraState(
        id=camera.id,
        last_frame=None if last is None else last.id,
        last_captured=None if last is None else at(last.captured),
        last_received=None if last is None else at(last.received),
        last_state=None if last is None else last.state,
        moved_since=at(camera.moved_since),
        proposed_calibration=None if proposed is None else proposed.id,
    )


def now(connection: Connection, silo: Any, cameras: list[Any], time: int) -> models.Now:
    """A silo's newest answer."""
    last = readings.last(connection, silo.id, answered=True)
    newest = readings.newest(connection, silo.id, 1)
    states = [camera_state(connection, camera) for camera in cameras if camera.silo == silo.id]
    age = None if last is None else max(0.0, (time - last.time) / SECOND)
    stale = age is None or age > silo.stale_after_s
    found: dict[str, Any] = {"silo": silo.id, "stale": stale, "stale_after_s": silo.stale_after_s, "cameras": states}
    if last is not None:
        found |= {"time": at(last.time), "age_s": age, "reading": last.id, "frame": last.frame}
        found |= {"calibration": last.calibration, **amounts(last)}
    if newest and (last is None or newest[0].id != last.id):
        found["last_attempt"] = attempt(newest[0])
    return models.Now(state=state(last, newest, stale, states), **found)


def attempt(row: Any) -> models.Attempt:
    """The outcome of a frame."""
    told = {"status": row.status, "reason": row.reason, "message": row.message, "frame": row.frame}
    return models.Attempt(time=at(row.time), quality=remarks(row), **told)


def state(last: Any, newest: Any, stale: bool, cameras: list[models.CameraState]) -> models.State:
    """A silo's state in one word."""
    if last is None:
        if any(camera.last_state == frames.GATHERING for camera in cameras):
            return "no-calibration"
        return "refused" if newest else "no-data"
    if stale:
        return "stale"
    return "ok" if newest[0].status == "ok" else "refused"


def forecast(connection: Connection, silo: str, density: float | None) -> models.Forecast:
    """A silo's use and its end."""
    row = readings.forecast_of(connection, silo)
    if row is None:
        return models.Forecast(silo=silo, known=False)
    return models.Forecast(
        silo=silo,
        known=True,
        computed=at(row.time),
        daily_m3=row.daily,
        daily_std_m3=row.daily_std,
        day_to_day_std_m3=row.day_to_day,
        daily_kg=None if density is None else row.daily * density,
        empty_by=at(row.empty_by),
        earliest=at(row.earliest),
        latest=at(row.latest),
    )


def event(row: Any) -> models.Event:
    """A refill or withdrawal."""
    told = {"id": row.id, "silo": row.silo, "kind": row.kind, "start": at(row.start), "end": at(row.end)}
    return models.Event(**told, volume_m3=row.volume, volume_std_m3=row.volume_std, mass_kg=row.mass)


def frame(connection: Connection, row: Any) -> models.Frame:
    """A frame."""
    found = frames.reading_of(connection, row.id)
    names = ("id", "camera", "silo", "sha256", "state", "clock", "format", "bytes", "kept", "attempts", "error")
    told = {name: getattr(row, name) for name in names}
    times = {"captured": at(row.captured), "received": at(row.received)}
    return models.Frame(**told, **times, reading=None if found is None else reading(found))


def alert(row: Any) -> models.Alert:
    """An alert."""
    kind = rules.DEFAULTS[row.kind]
    names = ("id", "rule", "kind", "silo", "value", "threshold", "acknowledged_by", "note", "version")
    times = {name: at(getattr(row, name)) for name in ("since", "fired", "resolved", "acknowledged")}
    told = {name: getattr(row, name) for name in names}
    state_: Literal["firing", "resolved"] = "firing" if row.resolved is None else "resolved"
    return models.Alert(**told, **times, state=state_, meaning=kind.meaning, unit=kind.unit)


def calibration(row: Any) -> models.Calibration:
    """A calibration without its document."""
    names = ("id", "silo", "camera", "sha256", "origin", "state", "frames", "confirmed_by")
    times = {name: at(getattr(row, name)) for name in ("created", "valid_from", "valid_to")}
    return models.Calibration(**{name: getattr(row, name) for name in names}, **times)


def run(row: dict[str, Any]) -> models.Run:
    """A run with its readings of a silo."""
    times = {name: at(row[name]) for name in ("created", "first", "last")}
    names = ("id", "version", "config", "origin", "note", "current", "replaced")
    return models.Run(**{name: row[name] for name in names}, **times)


def silo(connection: Connection, row: Any, cameras: list[Any], role: str, time: int) -> models.Silo:
    """A silo with what a card shows."""
    firing = alerts.listed(connection, silo=row.id, firing=True, before=None, count=100)
    told = readings.last(connection, row.id, answered=True)
    names = ("id", "name", "place", "product", "banner", "stale_after_s", "modbus_unit", "serial", "version")
    return models.Silo(
        **{name: getattr(row, name) for name in names},
        vessel=row.vessel,
        drawn=vessels.vessel(connection, row.vessel, told),
        zone=places.zone_of(connection, row.place),
        role=role,
        now=now(connection, row, cameras, time),
        forecast=forecast(connection, row.id, None if told is None else told.density),
        alerts_firing=len(firing),
        alerts_unacknowledged=sum(one.acknowledged is None for one in firing),
    )
