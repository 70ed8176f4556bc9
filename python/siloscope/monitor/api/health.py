"""Whether the service is alive and ready, and what it is."""

from __future__ import annotations

from fastapi import APIRouter
from fastapi.responses import JSONResponse, Response
from sqlalchemy.exc import SQLAlchemyError

from siloscope import _core
from siloscope.monitor.api import models, views
from siloscope.monitor.api.context import PersonOf, Reading, ServiceOf, refusals
from siloscope.monitor.problems import Problem
from siloscope.monitor.publish import metrics
from siloscope.monitor.store import changes, frames, live, people, places

router = APIRouter(tags=["service"])
outside = APIRouter(tags=["service"])


@outside.get("/healthz", response_model=models.Health)
def healthz() -> models.Health:
    """Whether the process answers."""
    return models.Health(status="ok", version=_core.__version__, detail={})


@outside.get("/readyz", response_model=models.Health, responses={503: {"model": models.Health}})
def readyz(service: ServiceOf) -> JSONResponse:
    """Whether frames can be taken: database, disk, queue."""
    free, _ = service.blobs.free()
    try:
        with service.store.read() as connection:
            waiting, driven = frames.waiting(connection), live.states(connection).values()
        detail: dict[str, str | int | float | bool | None] = {"frames_waiting": waiting, "disk_free_bytes": free}
        detail |= {"leads": service.leads, "live_cameras": len(driven)}
        detail["live_failing"] = sum(one["state"] == live.FAILING for one in driven)
        ready = service.has_room() and waiting < service.settings.limits.queue
    except SQLAlchemyError as error:
        detail, ready = {"database": type(error).__name__}, False
    health = models.Health(status="ok" if ready else "not-ready", version=_core.__version__, detail=detail)
    return JSONResponse(health.model_dump(), 200 if ready else 503)


@outside.get(
    "/metrics", response_class=Response, responses={200: {"content": {"text/plain": {}}}, **refusals("forbidden")}
)
def get_metrics(person: PersonOf, service: ServiceOf) -> Response:
    """The state for Prometheus; a token of the role metrics or read opens it."""
    if not person.metrics and not person.may("viewer"):
        raise Problem("forbidden", "this needs a token of the role metrics")
    return Response(metrics.text(service), media_type=metrics.CONTENT_TYPE)


@router.get("/site", response_model=models.Site, responses=refusals())
def get_site(connection: Reading, person: PersonOf, service: ServiceOf) -> models.Site:
    """The installation, and who asks: the page's first question."""
    free, total = service.blobs.free()
    counts = frames.counts(connection)
    return models.Site(
        name=places.fact(connection, "name"),
        zone=places.zone_of(connection, None),
        box=str(places.fact(connection, "box")),
        version=_core.__version__,
        demo=bool(places.fact(connection, "demo")),
        time=views.at(service.clock.now()),
        person=person.name,
        kind=person.kind,
        role=person.highest,
        needs_user=people.count_users(connection) == 0,
        disk_free_bytes=free,
        disk_total_bytes=total,
        disk_short=not service.has_room(),
        frames_queued=counts["queued"] + counts["measuring"],
        frames_failed=counts["failed"],
        last_change=changes.newest(connection),
    )
