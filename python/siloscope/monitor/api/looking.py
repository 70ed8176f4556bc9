"""What a frame looks like, and the pose that a camera's newest one shows: for the page and for installers."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Response

from siloscope.monitor import access, worker
from siloscope.monitor.api import models, views
from siloscope.monitor.api.context import PersonOf, ServiceOf, refusals
from siloscope.monitor.api.frames import seen
from siloscope.monitor.problems import Problem
from siloscope.monitor.service import Service
from siloscope.monitor.store import frames, places
from siloscope.monitor.store.rows import Record
from siloscope.monitor.workers import Lost, camera_of

router = APIRouter(tags=["frames"])

PNG: dict[int | str, dict[str, Any]] = {200: {"content": {"image/png": {}}, "description": "The picture."}}


@router.get(
    "/frames/{frame}/picture",
    response_class=Response,
    responses={**PNG, **refusals("not-found")},
)
def get_picture(frame: str, person: PersonOf, service: ServiceOf) -> Response:
    """A frame's depth as a picture: near is light, far is dark, no measurement is grey."""
    with service.store.read() as connection:
        row = seen(connection, person, frame)
    found = _looked(service, row)
    if isinstance(found, worker.Unusable) or found.picture is None:
        raise Problem("not-found", f"there is no picture of the frame '{frame}'")
    return Response(found.picture, media_type="image/png", headers={"Cache-Control": "private, max-age=86400"})


@router.get("/cameras/{camera}/pose", response_model=models.Pose, responses=refusals("not-found"))
def get_pose(camera: str, person: PersonOf, service: ServiceOf) -> models.Pose:
    """The pose that the camera's newest frame shows alone, without a calibration: what an installer turns it by."""
    with service.store.read() as connection:
        known = places.get(connection, "camera", camera)
        silo = None if known is None else places.get(connection, "silo", known.silo)
        if known is None or silo is None or not person.may("viewer", access.around(connection, silo)):
            raise Problem("not-found", f"there is no camera '{camera}'")
        newest = frames.newest(connection, camera)
        row = None if newest is None else frames.get(connection, newest.id)
    service.aiming.look(camera)
    told = {"camera": camera, "silo": known.silo}
    if row is None:
        return models.Pose(**told)
    told |= {"frame": row.id, "time": views.at(row.captured)}
    found = _looked(service, row)
    if isinstance(found, worker.Unusable):
        return models.Pose(**told, status="refused", reason="unreadable", message=found.message)
    return models.Pose(**told, **found.pose)


def _looked(service: Service, row: Record) -> worker.Looked | worker.Unusable:
    """What a frame shows; raises `Problem` where its bytes are gone or it can't be looked at."""
    path = service.blobs.path(row.sha256)
    if not row.kept or not path.is_file():
        raise Problem("not-found", f"the bytes of the frame '{row.id}' are not kept any more")
    with service.store.read() as connection:
        camera = places.get(connection, "camera", row.camera)
    settings = worker.CameraSettings() if camera is None else camera_of(camera)
    try:
        return service.looking.at(row.id, path, settings)
    except Lost as lost:
        raise Problem("unavailable", str(lost), {"Retry-After": "5"}) from None
