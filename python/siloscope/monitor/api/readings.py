"""Readings over time: page by page, as a trend of equal stretches, or as a table."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query
from fastapi.responses import Response, StreamingResponse

from siloscope.monitor.api import models, views
from siloscope.monitor.api.context import After, Count, Reading, ServiceOf, SiloOf, micros_of, refusals
from siloscope.monitor.api.models.base import Time
from siloscope.monitor.clock import DAY, SECOND, iso
from siloscope.monitor.problems import Problem
from siloscope.monitor.service import Service
from siloscope.monitor.store import readings, runs

router = APIRouter(tags=["readings"])

TREND = 30 * DAY
"""How far a trend goes back unless told."""

MOST_BUCKETS = 5000

COLUMNS = (
    *("time", "clock", "status", "reason", "volume_m3", "volume_std_m3", "fill_fraction", "fill_std", "free_m3"),
    *("capacity_m3", "ullage_m3", "ullage_std_m3", "mass_kg", "mass_std_kg", "level_mean_m", "level_min_m"),
    *("level_max_m", "level_std_m", "coverage", "quality", "camera", "frame", "calibration", "run"),
)
"""Of the tables."""

TABLES: dict[int | str, dict[str, Any]] = {
    200: {
        "content": {
            "application/json": {
                "schema": {
                    "anyOf": [
                        {"$ref": "#/components/schemas/Page_Reading_"},
                        {"$ref": "#/components/schemas/Trend"},
                    ]
                }
            },
            "text/csv": {},
            "application/vnd.apache.parquet": {},
        },
        "description": "A page of readings, a trend where `buckets` is given, or a table of them all.",
    }
}


@router.get(
    "/silos/{silo}/readings",
    response_model=models.Page[models.Reading] | models.Trend,
    responses={**TABLES, **refusals("not-found", "forbidden")},
)
def get_readings(
    silo: SiloOf,
    connection: Reading,
    service: ServiceOf,
    since: Annotated[Time | None, Query(alias="from", description="First time.")] = None,
    until: Annotated[Time | None, Query(alias="to", description="Time behind the last one.")] = None,
    buckets: Annotated[int | None, Query(ge=1, le=MOST_BUCKETS, description="Means over so many stretches.")] = None,
    format: Literal["json", "csv", "parquet"] = "json",
    run: Annotated[int | None, Query(ge=1, le=(1 << 31) - 1, description="Of this run, also what it lost.")] = None,
    after: After = None,
    count: Count = 200,
) -> Any:
    """Readings in the order of their times: those that count, or those of one run."""
    span = readings.Span(micros_of(since, "from"), micros_of(until, "to"), run)
    if buckets is not None:
        return _trend(silo.row.id, connection, service, span, buckets, silo.percent_only)
    if silo.percent_only and format != "json":
        raise Problem("forbidden", "this needs the role viewer")
    if format == "csv":
        return _file(silo.row.id, "csv", "text/csv; charset=utf-8", _csv(service, silo.row.id, span))
    if format == "parquet":
        return _file(
            silo.row.id, "parquet", "application/vnd.apache.parquet", iter([_parquet(service, silo.row.id, span)])
        )
    rows = readings.page(connection, silo.row.id, span, _cursor(after), count + 1)
    items = [views.reading(row) for row in rows[:count]]
    if silo.percent_only:
        items = [views.only_percent(item) for item in items]
    last = rows[count - 1] if len(rows) > count else None
    return models.Page[models.Reading](items=items, next=None if last is None else f"{last.time}-{last.id}")


@router.get("/silos/{silo}/runs", response_model=models.Page[models.Run], responses=refusals("not-found", "forbidden"))
def get_runs(silo: SiloOf, connection: Reading) -> models.Page[models.Run]:
    """What measured the silo's readings, the newest first: program, settings, recomputations, imported runs."""
    if silo.percent_only:
        raise Problem("forbidden", "this needs the role viewer")
    return models.Page(items=[views.run(row) for row in runs.of_silo(connection, silo.row.id)])


def _cursor(after: str | None) -> tuple[int, int] | None:
    if after is None:
        return None
    time, _, number = after.rpartition("-")
    try:
        found = int(time), int(number)
    except ValueError:
        raise Problem("invalid", "'after' is no cursor of readings; begin again without it") from None
    if not all(abs(part) < 1 << 62 for part in found):
        raise Problem("invalid", "'after' is no cursor of readings; begin again without it")
    return found


def _trend(
    silo: str, connection: Reading, service: Service, span: readings.Span, count: int, percent_only: bool
) -> models.Trend:
    until = service.clock.now() if span.until is None else span.until
    since = until - TREND if span.since is None else span.since
    if since >= until:
        raise Problem("invalid", "'from' is not before 'to'")
    width = max(1, -(-(until - since) // count))
    rows = readings.buckets(connection, silo, replace(span, since=since, until=until), width)
    items = [_bucket(row, since, width) for row in rows]
    if percent_only:
        items = [views.only_percent(item) for item in items]
    times = {"since": views.at(since), "until": views.at(until)}
    return models.Trend(silo=silo, **times, bucket_s=width / SECOND, items=items)


def _bucket(row: Any, since: int, width: int) -> models.Bucket:
    begin = since + int(row.bucket) * width
    return models.Bucket(
        time=views.at(begin),
        end=views.at(begin + width),
        count=row.number,
        volume_m3=row.volume,
        volume_std_m3=row.volume_std,
        volume_min_m3=row.volume_min,
        volume_max_m3=row.volume_max,
        fill_fraction=row.fill,
        mass_kg=row.mass,
    )


def _file(silo: str, ending: str, media: str, content: Iterator[bytes]) -> Response:
    headers = {"Content-Disposition": f'attachment; filename="{silo}.{ending}"'}
    return StreamingResponse(content, media_type=media, headers=headers)


def _rows(service: Service, silo: str, span: readings.Span) -> Iterator[dict[str, Any]]:
    """Readings as rows of a table; the connection lives as long as the answer is being sent."""
    with service.store.read() as connection:
        for row in readings.every(connection, silo, span):
            found = views.reading(row).model_dump()
            level = found.pop("level_m") or {}
            found |= {f"level_{name}_m": level.get(name) for name in ("mean", "min", "max", "std")}
            codes = " ".join(remark["code"] for remark in found["quality"])
            yield {name: found.get(name) for name in COLUMNS} | {"time": iso(row.time), "quality": codes}


def _csv(service: Service, silo: str, span: readings.Span) -> Iterator[bytes]:
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS)
    writer.writeheader()
    for row in _rows(service, silo, span):
        writer.writerow(row)
        if text.tell() > 65_536:
            yield text.getvalue().encode()
            text.seek(0)
            text.truncate()
    yield text.getvalue().encode()


def _parquet(service: Service, silo: str, span: readings.Span) -> bytes:
    try:
        pyarrow, parquet = (import_module(name) for name in ("pyarrow", "pyarrow.parquet"))
    except ImportError:
        raise Problem("unavailable", "Parquet needs pyarrow on the server; pip install 'siloscope[parquet]'") from None
    words = ("time", "clock", "status", "reason", "quality", "camera", "frame", "calibration")
    kinds = {name: pyarrow.string() if name in words else pyarrow.float64() for name in COLUMNS} | {
        "run": pyarrow.int64()
    }
    table = pyarrow.Table.from_pylist(list(_rows(service, silo, span)), schema=pyarrow.schema(list(kinds.items())))
    sink = io.BytesIO()
    parquet.write_table(table, sink)
    return sink.getvalue()
