"""The web application: routes, problems, headers, the page."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any
from urllib.parse import quote

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import FileResponse, JSONResponse
from sqlalchemy.exc import OperationalError
from starlette.exceptions import HTTPException
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from siloscope import _core
from siloscope.monitor.api import (
    alerts,
    calibrations,
    deliveries,
    edge,
    frames,
    health,
    looking,
    models,
    people,
    readings,
    rules,
    session,
    settings,
    silos,
    stream,
    tickets,
)
from siloscope.monitor.intake import full, is_full
from siloscope.monitor.problems import Problem
from siloscope.monitor.service import Service
from siloscope.monitor.throttle import Throttle

PREFIX = "/api/v1"

PAGES = "/{path:path}"

PAGE = Path(__file__).parents[1] / "page"

ROUTERS = (
    *(frames.router, silos.router, readings.router, looking.router, alerts.router, rules.router, calibrations.router),
    *(tickets.router, settings.router, session.router, people.router, deliveries.router, edge.router),
    *(stream.router, health.router),
)

HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self'; font-src 'self'; manifest-src 'self'; worker-src 'self'; base-uri 'none'; form-action 'self'; "
    "frame-ancestors 'self'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
}

SENT = [(name.lower().encode(), value.encode()) for name, value in {**HEADERS, "Cache-Control": "no-store"}.items()]
"""The same as they go over the line; the last one is of the interface alone."""

STATUS_SLUGS = {401: "unauthorized", 403: "forbidden", 404: "not-found", 405: "method-not-allowed", 413: "too-large"}


def create_app(service: Service) -> FastAPI:
    """The application of a service, which is started and stopped with it."""

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        app.state.stopping = asyncio.Event()
        service.start()
        yield
        await asyncio.to_thread(service.stop)

    app = FastAPI(
        title="siloscope",
        version=_core.__version__,
        description="What is in every silo: readings, surfaces, events, forecasts, alerts. SI units, times in UTC.",
        openapi_url=f"{PREFIX}/openapi.json",
        docs_url=None,
        redoc_url=None,
        lifespan=lifespan,
    )
    app.state.service = service
    app.state.throttle = Throttle()
    for router in ROUTERS:
        app.include_router(router, prefix=PREFIX)
    app.include_router(health.outside)
    _refuse_plainly(app)
    app.add_middleware(_WithHeaders)
    _serve_page(app)
    app.openapi = lambda: _described(app)  # type: ignore[method-assign]
    return app


def _described(app: FastAPI) -> dict[str, Any]:
    """The OpenAPI document, with the one shape that every problem has."""
    if app.openapi_schema is None:
        found = FastAPI.openapi(app)
        schemas = found.setdefault("components", {}).setdefault("schemas", {})
        schemas["Problem"] = models.Problem.model_json_schema()
        for name in ("HTTPValidationError", "ValidationError"):
            schemas.pop(name, None)
        app.openapi_schema = found
    return app.openapi_schema


def problem(found: Problem) -> JSONResponse:
    """A refused request's answer."""
    return JSONResponse(found.to_dict(), found.status, found.headers, "application/problem+json")


def _refuse_plainly(app: FastAPI) -> None:
    @app.exception_handler(Problem)
    async def told(_request: Request, error: Problem) -> JSONResponse:
        return problem(error)

    @app.exception_handler(RequestValidationError)
    async def invalid(_request: Request, error: RequestValidationError) -> JSONResponse:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"][1:]) or "the body"
        return problem(Problem("invalid", f"'{place}': {first['msg']}"))

    @app.exception_handler(HTTPException)
    async def http(request: Request, error: HTTPException) -> JSONResponse:
        slug, headers = STATUS_SLUGS.get(error.status_code, "invalid"), dict(error.headers or {})
        if slug == "method-not-allowed":
            headers["Allow"] = ", ".join(sorted(_methods(request.url.path)))
        return problem(Problem(slug, str(error.detail), headers))

    @app.exception_handler(OperationalError)
    async def database(request: Request, error: OperationalError) -> JSONResponse:
        if is_full(error):
            return problem(full(request.app.state.service.blobs))
        return problem(Problem("unavailable", "the database can't be reached or is busy", {"Retry-After": "5"}))


def _methods(path: str) -> set[str]:
    """The methods of an address, from all routes but the page's, which takes every address."""
    found: set[str] = set()
    for prefix, router in (*((PREFIX, one) for one in ROUTERS), ("", health.outside)):
        for route in router.routes:
            if isinstance(route, Route) and path.startswith(prefix) and route.path_regex.match(path[len(prefix) :]):
                found |= route.methods or set()
    return found or {"GET"}


class _WithHeaders:
    """Adds the headers that every answer has; bodies pass it untouched, so that a frame's bytes take no detour."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One request."""

        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                there = {name.lower() for name, _ in message["headers"]}
                usual = SENT if scope["path"].startswith(PREFIX) else SENT[:-1]
                message["headers"] = [*message["headers"], *(one for one in usual if one[0] not in there)]
            await send(message)

        await self._app(scope, receive, with_headers if scope["type"] == "http" else send)


def _serve_page(app: FastAPI) -> None:
    """The built page: files by name, and its index for every address that is no file."""

    @app.get("/install/{camera}", include_in_schema=False)
    def install(camera: str) -> Response:
        """The installer's view; the address is relative, so that it holds below any path."""
        return Response(status_code=307, headers={"Location": f"../#/install/{quote(camera, safe='')}"})

    @app.get(PAGES, include_in_schema=False)
    def page(path: str) -> Response:
        if path.startswith(("api/", "metrics", "healthz", "readyz")):
            raise Problem("not-found", f"there is nothing at '/{path[:100]}'")
        file = (PAGE / path).resolve()
        if not file.is_relative_to(PAGE) or not file.is_file():
            file = PAGE / "index.html"
        if not file.is_file():
            raise Problem("not-found", f"the page is not built; the interface is at {PREFIX}/openapi.json")
        hashed = "assets" in file.parts
        return FileResponse(
            file, headers={"Cache-Control": "public, max-age=31536000, immutable" if hashed else "no-cache"}
        )
