"""``siloscope track``: many frames in, the content's story out."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

import siloscope
from siloscope.cli import measure as one
from siloscope.cli import options
from siloscope.cli.outcome import PARTIAL, REFUSED, print_json, writing
from siloscope.cli.progress import say
from siloscope.cli.progress import track as bar
from siloscope.errors import UsageError
from siloscope.frames import FrameSource
from siloscope.track import Reading, Track

SHOWN = 40
"""Readings that the table on a terminal has; files have all."""


def track(
    files: Annotated[list[Path], typer.Argument(metavar="FRAMES…", help="Frames, folders or recordings, in order.")],
    calibration: Annotated[Path, typer.Option("--calibration", metavar="FILE", help="What `calibrate` wrote.")],
    camera: options.CameraFile = None,
    sensor: options.Sensor = None,
    depth_unit: options.DepthUnit = None,
    diameter: options.Diameter = None,
    cylinder: one.Cylinder = None,
    cone: one.Cone = None,
    top: one.Top = None,
    outlet_diameter: one.OutletDiameter = 0.0,
    outlet_length: one.OutletLength = 0.0,
    strapping: one.Strapping = None,
    density: one.DensityNumber = None,
    density_std: one.DensityStd = None,
    product: one.Product = None,
    interval: Annotated[
        float | None, typer.Option(metavar="S", help="Seconds between frames that have no time of their own.")
    ] = None,
    start: Annotated[
        str | None, typer.Option(metavar="TIME", help="Time of the first of them, such as 2026-03-01T06:00Z.")
    ] = None,
    stream: options.Stream = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Write tables, trend and report here.")] = None,
    parquet: Annotated[bool, typer.Option("--parquet", help="Write a Parquet table too (needs pyarrow).")] = False,
    lines: Annotated[bool, typer.Option("--jsonl", help="Print one JSON line a reading on stdout.")] = False,
    as_json: options.AsJson = False,
) -> int:
    """Follow the content over many frames: flow, refills and withdrawals, daily use, empty-by date.

    [bold]Example:[/bold] siloscope track march/*.png --calibration silo7.json --interval 3600 --out march

    Exit code 4: no frame has an answer; 5: some have none.
    """
    settings: dict[str, Any] = {
        "sensor": sensor,
        "diameter": diameter,
        "cylinder": cylinder,
        "cone": cone,
        "top": top,
        "outlet_diameter": outlet_diameter,
        "outlet_length": outlet_length,
        "strapping": None if strapping is None else siloscope.content.Strapping.read(strapping),
        "density": density,
        "density_std": density_std,
        "product": product,
    }
    if parquet and out is None:
        raise UsageError("--parquet writes a file; give --out DIR")
    silo = siloscope.Calibration.load(calibration)
    with siloscope.frames.open(files, camera=camera, depth_unit=depth_unit, stream=stream) as source:
        found = siloscope.track(
            source,
            silo,
            interval=interval,
            start=_time(start),
            progress=lambda frames: bar(frames, "measuring", _count(source)),
            **settings,
        )
    return _answer(found, out, parquet, lines, as_json)


def _answer(found: Track, out: Path | None, parquet: bool, lines: bool, as_json: bool) -> int:
    if out is not None:
        from siloscope.track_files import write_track

        with writing(out):
            written = write_track(out, found, parquet)
        say(f"wrote {len(written)} files to {out}")
    if as_json:
        print_json(found.to_dict())
    elif lines:
        for reading in found.readings:
            print(json.dumps(reading.to_dict(), allow_nan=False))
    else:
        _print(found)
    counts = found.counts
    if not counts["ok"]:
        return REFUSED
    return PARTIAL if counts["refused"] or counts["unreadable"] else 0


def _count(source: FrameSource) -> int | None:
    try:
        return len(source)
    except TypeError:
        return None


def _time(text: str | None) -> float | None:
    """Seconds since 1970 of an ISO 8601 time; UTC where it names no zone."""
    if text is None:
        return None
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        raise UsageError(f"--start '{text}': give a time such as 2026-03-01T06:00Z") from None
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def _print(found: Track) -> None:
    """The table of readings, the events, and the forecast on stdout."""
    from siloscope.track_files import when

    console = Console(highlight=False, soft_wrap=True)
    table = Table(box=None, padding=(0, 2, 0, 0))
    for name, side in (("time", "left"), ("volume (m³)", "right"), ("level (m)", "right"), ("mass (kg)", "right"),
                       ("flow (m³/h)", "right"), ("", "left")):  # fmt: skip
        table.add_column(name, justify=side, style="bold" if name == "time" else None)  # type: ignore[arg-type]
    for reading in found.readings[-SHOWN:]:
        table.add_row(*_row(reading))
    console.print(table)
    if len(found.readings) > SHOWN:
        say(f"{len(found.readings) - SHOWN} earlier readings not shown; --out, --json and --jsonl have all")
    for event in found.events:
        mass = "" if event.mass is None else f", {event.mass:.0f} kg"
        begin = when(event.start) if event.start is not None else f"reading {event.first}"
        console.print(
            f"{event.kind} of {event.volume:.3f} ± {event.volume_std:.3f} m³{mass} from {begin}", markup=False
        )
    if found.use is not None:
        use = found.use
        band = f"between {when(use.earliest)} and {when(use.latest)}"
        console.print(f"use {use.daily:.3f} ± {use.daily_std:.3f} m³ a day; empty by {when(use.empty_by)}, {band}",
                      markup=False)  # fmt: skip


def _row(reading: Reading) -> tuple[str, ...]:
    from siloscope.track_files import when

    def number(value: float | None, digits: int) -> str:
        return "" if value is None else f"{value:.{digits}f}"

    volume = "" if reading.volume is None else f"{reading.volume:.3f} ± {reading.volume_std:.3f}"
    remark = ", ".join(reading.quality) if reading.status == "ok" else f"{reading.status}: {reading.reason}"
    time = reading.name if reading.time is None else when(reading.time)
    return (time, volume, number(reading.level, 3), number(reading.mass, 0), number(reading.flow, 3), remark)
