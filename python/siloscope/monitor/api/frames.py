"""Frames: sent by cameras, looked up by whoever wants to know what became of one."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator
from contextlib import suppress
from functools import partial
from typing import Annotated

from fastapi import APIRouter, Header, Path, Query, Request, Response
from fastapi.responses import FileResponse
from sqlalchemy import Connection
from starlette.requests import ClientDisconnect

from siloscope.monitor import access
from siloscope.monitor.access import Person
from siloscope.monitor.api import models, views
from siloscope.monitor.api.context import (
    After,
    Count,
    PersonOf,
    Reading,
    ServiceOf,
    need,
    person_of,
    refusals,
    service_of,
    unauthorized,
)
from siloscope.monitor.clock import SECOND, micros
from siloscope.monitor.intake import Told
from siloscope.monitor.problems import Problem
from siloscope.monitor.service import Service
from siloscope.monitor.store import frames, places
from siloscope.monitor.store.rows import Record

router = APIRouter(tags=["frames"])

SHA256 = re.compile(r"[0-9a-f]{64}")

OLDEST_S = 400 * 86_400.0
"""Longest age a sender can measure without a clock."""

READ_OUT, READ_OUT_S = 64 << 20, 20.0
"""At most so many bytes and seconds of a refused body are read."""

BODY = {
    "requestBody": {
        "required": True,
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
    }
}


@router.post(
    "/cameras/{camera}/frames",
    status_code=201,
    response_model=models.FrameTaken,
    responses={
        200: {"model": models.FrameTaken, "description": "The frame was taken before."},
        **refusals("forbidden", "not-found", "hash-differs", "too-large", "unknown-format", "too-many", "storage-full"),
    },
    openapi_extra=BODY,
)
async def post_frame(
    camera: Annotated[str, Path(max_length=80)],
    request: Request,
    response: Response,
    content_sha256: Annotated[str | None, Header(description="SHA-256 of the body, hexadecimal.")] = None,
    captured_at: Annotated[str | None, Header(description="When it was taken, RFC 3339.")] = None,
    captured_age: Annotated[
        float | None,
        Header(description="Seconds since it was taken by the sender's monotonic clock, where it has no other."),
    ] = None,
) -> models.FrameTaken:
    """Takes a frame: the body is the file. 201 only when it survives a power cut; sending it again is no harm."""
    service = service_of(request)
    body = request.stream()
    try:
        told = Told(camera, *_told(content_sha256, captured_at, captured_age), _length(request))
        taken = await service.intake.take(told, body, partial(_allowed, request, service, camera))
    except Problem:
        await _read_out(request, body)
        raise
    except ClientDisconnect:
        raise Problem("invalid", "the body ended before its time; send it again") from None
    response.status_code = 201 if taken.new else 200
    if taken.new:
        service.measuring.wake()
    return models.FrameTaken(frame=taken.frame)


async def _read_out(request: Request, body: AsyncIterator[bytes]) -> None:
    """Takes the rest of a refused body: a sender that is still sending would miss the answer on a closed line."""
    if request.headers.get("expect", "").lower() == "100-continue":
        return
    rest = 0
    with suppress(ClientDisconnect, TimeoutError):
        async with asyncio.timeout(READ_OUT_S):
            async for chunk in body:
                rest += len(chunk)
                if rest > READ_OUT:
                    return


def _allowed(request: Request, service: Service, camera: str, connection: Connection) -> None:
    """Raises `Problem` for who may not send a camera's frames."""
    person = person_of(request, service, connection)
    if person.kind == "local":
        raise unauthorized("send the camera's token as 'Authorization: Bearer …'")
    if person.camera is not None and person.camera != camera:
        raise Problem("forbidden", f"the token is for another camera than '{camera}'")
    known = places.get(connection, "camera", camera)
    if known is not None and person.camera is None:
        silo = places.get(connection, "silo", known.silo)
        need("admin", person, access.around(connection, silo))
    elif person.camera is None and person.highest is None:
        raise Problem("forbidden", "this needs a token of the camera")
    if known is None:
        raise Problem("not-found", f"there is no camera '{camera}'; add it to SITE.toml")


def _told(sha256: str | None, captured: str | None, age: float | None) -> tuple[str | None, int | None, int | None]:
    if sha256 is not None and not SHA256.fullmatch(sha256.lower()):
        raise Problem("invalid", "Content-SHA256 must be 64 hexadecimal digits")
    if age is not None and not 0.0 <= age <= OLDEST_S:
        raise Problem("invalid", f"Captured-Age must be between 0 and {OLDEST_S:g} s")
    try:
        time = None if captured is None else micros(captured)
    except (ValueError, OverflowError):
        raise Problem("invalid", "Captured-At must be a time such as 2026-03-01T06:00:00Z") from None
    return None if sha256 is None else sha256.lower(), time, None if age is None else int(age * SECOND)


def _length(request: Request) -> int | None:
    told = request.headers.get("content-length", "")
    return int(told) if told.isdigit() else None


def seen(connection: Reading, person: Person, frame: str) -> Record:
    """A frame that who asks may see; raises `Problem`."""
    row = frames.get(connection, frame)
    if row is not None and person.camera == row.camera:
        return row
    silo = None if row is None else places.get(connection, "silo", row.silo)
    role = None if silo is None else person.role_at(access.around(connection, silo))
    if row is None or role is None or role == "percent":
        raise Problem("not-found", f"there is no frame '{frame}'")
    return row


@router.get("/frames", response_model=models.Page[models.Frame], responses=refusals("forbidden"))
def get_frames(
    connection: Reading,
    person: PersonOf,
    camera: str | None = None,
    state: Annotated[str | None, Query(pattern="^(queued|measuring|measured|gathering|failed)$")] = None,
    after: After = None,
    count: Count = 50,
) -> models.Page[models.Frame]:
    """Frames, the last arrived first."""
    need("viewer", person)
    rows = frames.listed(connection, camera, state, after, count + 1)
    items = [views.frame(connection, row) for row in rows[:count]]
    return models.Page(items=items, next=rows[count - 1].id if len(rows) > count else None)


@router.get("/frames/{frame}", response_model=models.Frame, responses=refusals("not-found"))
def get_frame(frame: str, connection: Reading, person: PersonOf) -> models.Frame:
    """A frame and what became of it."""
    return views.frame(connection, seen(connection, person, frame))


@router.get(
    "/frames/{frame}/content",
    response_class=Response,
    responses={
        200: {"content": {"application/octet-stream": {}}, "description": "The bytes."},
        **refusals("not-found"),
    },
)
def get_content(frame: str, connection: Reading, person: PersonOf, service: ServiceOf) -> Response:
    """The frame's bytes as they were sent."""
    row: object = seen(connection, person, frame)
    sha256 = str(getattr(row, "sha256"))  # noqa: B009
    path = service.blobs.path(sha256)
    if not path.exists():
        raise Problem("not-found", "the bytes of the frame were deleted to make room; its reading is still there")
    headers = {"ETag": f'"{sha256}"', "Cache-Control": "private, max-age=31536000, immutable"}
    return FileResponse(path, media_type="application/octet-stream", headers=headers)
