"""The hub's side of its link with boxes at the edge. An answer of 200 or 201 means: it is on the hub's disk."""

from __future__ import annotations

from typing import Annotated

from anyio import to_thread
from fastapi import APIRouter, Path, Query, Request, Response
from sqlalchemy import Connection

from siloscope.monitor.access import Person
from siloscope.monitor.api import models
from siloscope.monitor.api.context import PersonOf, Reading, ServiceOf, person_of, refusals, service_of
from siloscope.monitor.api.frames import BODY, SHA256
from siloscope.monitor.clock import AHEAD, CORRECTED, EARLIEST, SUSPECT
from siloscope.monitor.intake import Told
from siloscope.monitor.problems import Problem
from siloscope.monitor.service import Service
from siloscope.monitor.store import changes, frames, hub, places

router = APIRouter(tags=["edge"], prefix="/edge")

Key = Annotated[str, Path(max_length=80)]


def need_edge(person: Person) -> None:
    """Raises `Problem` for anybody but a box and an administrator."""
    if not person.edge and not person.may("admin"):
        raise Problem("forbidden", "this needs a token of the role edge")


@router.post("/readings", response_model=models.EdgeTaken, responses=refusals("forbidden", "not-found"))
def post_readings(body: models.EdgeReadings, person: PersonOf, service: ServiceOf) -> models.EdgeTaken:
    """Takes readings: all of them or none. Sending them again is no harm."""
    need_edge(person)
    now, dirty = service.clock.now(), dict[str, int]()
    with service.store.write() as connection:
        for told in body.readings:
            time, clock = timed(told, body.sent, now)
            try:
                silo = hub.take(
                    service.store, connection, body.box, told.model_dump() | {"time": time, "clock": clock}, now
                )
            except KeyError:
                raise Problem("not-found", f"there is no camera '{told.camera}'; add it at the hub") from None
            if silo is not None:
                dirty.setdefault(silo, 0)
                dirty[silo] += 1
                service.changed(silo, time)
    return models.EdgeTaken(new=sum(dirty.values()))


def timed(told: models.EdgeReading, sent: int, now: int) -> tuple[int, str]:
    """A reading's time by the hub's clock, and how far it can be trusted.

    Where the box's clock is wrong when it sends, what it measured by the same clock is as wrong.
    """
    time, clock = told.time, str(told.clock)
    if told.current and abs(now - sent) > AHEAD:
        time, clock = time + now - sent, CORRECTED
    if time < EARLIEST or time > now + AHEAD:
        return max(0, time), SUSPECT
    return time, CORRECTED if clock == SUSPECT else clock


@router.put(
    "/frames/{camera}/{sha256}",
    response_model=models.FrameTaken,
    responses=refusals(
        "forbidden", "not-found", "hash-differs", "too-large", "unknown-format", "too-many", "storage-full"
    ),
    openapi_extra=BODY,
)
async def put_frame(camera: Key, sha256: Key, request: Request) -> models.FrameTaken:
    """Takes the bytes of a frame whose reading came before."""
    service = service_of(request)
    await to_thread.run_sync(_expected, request, service, camera, sha256)
    taken = await service.intake.take(Told(camera, sha256, archived=True), request.stream())
    return models.FrameTaken(frame=taken.frame)


def _expected(request: Request, service: Service, camera: str, sha256: str) -> None:
    with service.store.read() as connection:
        need_edge(person_of(request, service, connection))
        if not SHA256.fullmatch(sha256) or frames.find(connection, camera, sha256) is None:
            raise Problem("not-found", "there is no reading of such a frame; send that first")


@router.put(
    "/calibrations/{calibration}", response_model=models.EdgeTaken, responses=refusals("forbidden", "not-found")
)
def put_calibration(
    calibration: Annotated[str, Path(max_length=36)],
    body: models.EdgeCalibration,
    person: PersonOf,
    service: ServiceOf,
) -> models.EdgeTaken:
    """Takes a calibration that a box made."""
    need_edge(person)
    told = body.model_dump(exclude={"document"}) | {"id": calibration}
    with service.store.write() as connection:
        _must_be(connection, "camera", body.camera)
        _must_be(connection, "silo", body.silo)
        new = hub.add_calibration(connection, told, body.document, service.clock.now())
    service.announce()
    return models.EdgeTaken(new=int(new))


def _must_be(connection: Connection, kind: str, key: str) -> None:
    if places.get(connection, kind, key) is None:
        raise Problem("not-found", f"there is no {kind} '{key}'; add it at the hub")


@router.post("/acknowledgements", response_model=models.EdgeTaken, responses=refusals("forbidden"))
def post_acknowledgement(
    body: models.EdgeAcknowledgement, person: PersonOf, service: ServiceOf, response: Response
) -> models.EdgeTaken:
    """Notes that somebody at a box has seen an alert; nothing where the alert is over."""
    need_edge(person)
    with service.store.write() as connection:
        done = hub.acknowledge(connection, body.model_dump(), service.clock.now())
    service.announce()
    return models.EdgeTaken(new=int(done))


@router.get("/settings", response_model=models.EdgeSettings, responses=refusals("forbidden"))
def get_settings(
    connection: Reading,
    person: PersonOf,
    camera: Annotated[list[str], Query(max_length=1000, description="The box's cameras.")],
) -> models.EdgeSettings:
    """What a box with these cameras goes by."""
    need_edge(person)
    cursor = changes.newest(connection)
    return models.EdgeSettings(cursor=cursor, settings=hub.settings(connection, camera))
