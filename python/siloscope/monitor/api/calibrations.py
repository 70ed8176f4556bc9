"""Calibrations: which there are, a person's word on a proposed one, another one by hand, and measuring anew."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Body, Path, Query, Request

from siloscope.errors import InputError
from siloscope.monitor import access
from siloscope.monitor.api import models, views
from siloscope.monitor.api.context import PersonOf, Reading, ServiceOf, SiloOf, address_of, need, refusals
from siloscope.monitor.problems import Problem
from siloscope.monitor.store import people, places

router = APIRouter(tags=["calibrations"])

Key = Annotated[str, Path(max_length=80)]

CHANGED = refusals("forbidden", "cross-origin", "not-found", "conflict")


def _viewer(silo: Any) -> None:
    if silo.percent_only:
        raise Problem("forbidden", "this needs the role viewer")


@router.get(
    "/silos/{silo}/calibrations",
    response_model=models.Page[models.Calibration],
    responses=refusals("not-found", "forbidden"),
)
def get_calibrations(silo: SiloOf, connection: Reading) -> models.Page[models.Calibration]:
    """All calibrations of a silo's cameras, the newest first."""
    _viewer(silo)
    return models.Page(items=[views.calibration(row) for row in places.calibrations(connection, silo.row.id)])


@router.get("/silos/{silo}/calibration", response_model=dict[str, Any], responses=refusals("not-found", "forbidden"))
def get_calibration(
    silo: SiloOf,
    connection: Reading,
    service: ServiceOf,
    calibration: Annotated[
        str | None, Query(max_length=80, description="Its id; the one in force unless given.")
    ] = None,
) -> dict[str, Any]:
    """The document of a calibration, as `siloscope calibrate` writes it."""
    _viewer(silo)
    row = None
    if calibration is not None:
        row = places.calibration_get(connection, calibration)
    else:
        for camera in places.listed(connection, "camera"):
            if row is None and camera.silo == silo.row.id:
                row = places.calibration_at(connection, camera.id, service.clock.now())
    if row is None or row.silo != silo.row.id:
        raise Problem("not-found", "there is no such calibration of this silo")
    return places.document(row)


@router.put("/silos/{silo}/calibration", response_model=models.Calibration, responses=CHANGED)
def put_calibration(
    silo: SiloOf,
    person: PersonOf,
    service: ServiceOf,
    request: Request,
    body: Annotated[dict[str, Any], Body(description="What `siloscope calibrate` wrote.")],
    camera: Annotated[str | None, Query(max_length=80, description="Which camera, where the silo has several.")] = None,
) -> models.Calibration:
    """Takes a calibration into force from now on."""
    now = service.clock.now()
    document = _usable(body)
    with service.store.write() as connection:
        need("admin", person, access.around(connection, silo.row))
        cameras = [row for row in places.listed(connection, "camera") if row.silo == silo.row.id]
        chosen = [row for row in cameras if camera in (None, row.id)]
        if len(chosen) != 1:
            raise Problem("invalid", f"'camera': name one of {', '.join(row.id for row in cameras) or 'none'}")
        places.close(connection, chosen[0].id, now)
        places.set_moved(connection, chosen[0].id, None, now)
        row = {"origin": "uploaded", "state": places.CONFIRMED, "valid_from": now, "confirmed_by": person.name}
        count = len(document.get("frames", ()))
        key = places.add_calibration(connection, silo.row.id, chosen[0].id, document, now, frames=count, **row)
        people.log(connection, now, person.name, "set calibration", key, address=address_of(request))
        found = places.calibration_get(connection, key)
    service.announce()
    return views.calibration(found)


def _usable(document: dict[str, Any]) -> dict[str, Any]:
    from siloscope.schema import calibration
    from siloscope.schema.validation import validated

    try:
        told = validated(calibration.CalibrationDocument, document, "the calibration", calibration.REMEDY)
    except InputError as error:
        raise Problem("invalid", str(error)) from None
    if told.status != "ok":
        raise Problem("invalid", "the calibration was refused; calibrate with more frames")
    return document


@router.post("/calibrations/{calibration}:confirm", response_model=models.Calibration, responses=CHANGED)
def confirm(calibration: Key, person: PersonOf, service: ServiceOf, request: Request) -> models.Calibration:
    """Takes a proposed calibration into force from its first frame on; the frames since are measured with it."""
    _may_decide(calibration, person, service)
    if not service.calibrating.confirm(calibration, person.name):
        raise Problem("conflict", "the calibration does not wait for a decision")
    return _decided(calibration, "confirm calibration", person.name, service, address_of(request))


@router.post("/calibrations/{calibration}:reject", response_model=models.Calibration, responses=CHANGED)
def reject(calibration: Key, person: PersonOf, service: ServiceOf, request: Request) -> models.Calibration:
    """Turns a proposed calibration down; another is proposed from twice as many frames."""
    _may_decide(calibration, person, service)
    with service.store.write() as connection:
        if not places.reject(connection, calibration, person.name, service.clock.now()):
            raise Problem("conflict", "the calibration does not wait for a decision")
    return _decided(calibration, "reject calibration", person.name, service, address_of(request))


def _may_decide(key: str, person: Any, service: Any) -> None:
    with service.store.read() as connection:
        row = places.calibration_get(connection, key)
        silo = None if row is None else places.get(connection, "silo", row.silo)
        around = access.around(connection, silo)
    if silo is None or not person.may("viewer", around):
        raise Problem("not-found", f"there is no calibration '{key}'")
    need("operator", person, around)


def _decided(key: str, action: str, who: str, service: Any, address: str) -> models.Calibration:
    now = service.clock.now()
    with service.store.write() as connection:
        people.log(connection, now, who, action, key, address=address)
        found = places.calibration_get(connection, key)
    service.announce()
    return views.calibration(found)


@router.post("/silos/{silo}/calibration:recompute", response_model=models.Recomputed, responses=CHANGED)
def recompute(silo: SiloOf, person: PersonOf, service: ServiceOf, request: Request) -> models.Recomputed:
    """Measures the silo's frames that are still there anew, as a new run; the old readings stay."""
    with service.store.read() as connection:
        need("admin", person, access.around(connection, silo.row))
    run, count = service.recompute(silo.row.id, person.name)
    with service.store.write() as connection:
        detail = {"run": run, "frames": count}
        people.log(
            connection,
            service.clock.now(),
            person.name,
            "recompute",
            silo.row.id,
            detail=detail,
            address=address_of(request),
        )
    return models.Recomputed(run=run, frames=count)
