"""``siloscope track``: many frames in, the content's story out."""

from __future__ import annotations

import os
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

import siloscope
from siloscope.cli import measure as one
from siloscope.cli import options
from siloscope.cli.inputs import opened
from siloscope.cli.outcome import PARTIAL, REFUSED, print_json, writing
from siloscope.cli.progress import say
from siloscope.cli.progress import track as bar
from siloscope.content.units import Units
from siloscope.content.units import unit as units_of
from siloscope.errors import UsageError
from siloscope.io import FrameSource
from siloscope.schema import documents
from siloscope.types.track import Reading, Track
from siloscope.wording import counted, with_std

SHOWN = 40
"""Readings that the table on a terminal has; files have all."""

WIDTH = 160
"""Columns of text that goes into a file or a pipe."""


def track(
    files: Annotated[list[Path], typer.Argument(metavar="FRAMES…", help="Frames, folders or recordings, in order.")],
    calibration: Annotated[Path, typer.Option("--calibration", metavar="FILE", help="What `calibrate` wrote.")],
    camera: options.CameraFile = None,
    sensor: options.Sensor = None,
    depth_unit: options.DepthUnit = None,
    diameter: options.Diameter = None,
    cylinder: options.Cylinder = None,
    cone: options.Cone = None,
    bottom: options.Bottom = None,
    top: options.Top = None,
    vessel: options.VesselFile = None,
    outlet_diameter: one.OutletDiameter = 0.0,
    outlet_length: one.OutletLength = 0.0,
    strapping: one.Strapping = None,
    density: one.DensityNumber = None,
    density_std: one.DensityStd = None,
    product: one.Product = None,
    test_weight: one.TestWeight = None,
    moisture: one.Moisture = None,
    unit: one.Unit = None,
    interval: Annotated[
        str | None, typer.Option(metavar="TIME", help="Between frames that have no time: seconds, or 15min, 1h, 1d.")
    ] = None,
    start: Annotated[
        str | None, typer.Option(metavar="TIME", help="Time of the first of them, such as 2026-03-01T06:00Z.")
    ] = None,
    earlier: Annotated[
        Path | None,
        typer.Option("--continue", metavar="FILE", help="An earlier track.json to go on with."),
    ] = None,
    name: Annotated[str | None, typer.Option(help="The silo's name, for the report.")] = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, max=256, help="Frames at the same time; all cores unless given.")
    ] = None,
    stream: options.Stream = None,
    trust: options.Trust = None,
    axes: options.Axes = None,
    up: options.Up = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Write tables, trend and report here.")] = None,
    parquet: Annotated[bool, typer.Option("--parquet", help="Write a Parquet table too (needs pyarrow).")] = False,
    lines: Annotated[bool, typer.Option("--jsonl", help="Print one JSON line a reading on stdout.")] = False,
    as_json: options.AsJson = False,
) -> int:
    """Follow the content over many frames: flow, refills and withdrawals, daily use, empty-by date.

    [bold]Example:[/bold] siloscope track march/*.png --calibration silo7.json --interval 3600 --out march

    Exit code 4: no frame has an answer; 5: some have none.
    """
    settings, units = one.chosen(locals()), units_of(unit)
    settings["strapping"] = None if strapping is None else siloscope.content.Strapping.read(strapping)
    if parquet and out is None:
        raise UsageError("--parquet writes a file; give --out DIR")
    silo = siloscope.Calibration.load(calibration)
    with opened(files, camera=camera, depth_unit=depth_unit, stream=stream, axes=axes, up=up) as source:
        found = siloscope.track(
            source,
            silo,
            interval=None if interval is None else options.seconds(interval, "--interval"),
            start=_time(start),
            continue_from=earlier,
            jobs=jobs or os.cpu_count() or 1,
            name=name,
            progress=lambda frames: bar(frames, "measuring", _count(source)),
            **settings,
        )
    return _answer(found, out, parquet, (lines, as_json, units))


def _answer(found: Track, out: Path | None, parquet: bool, shown: tuple[bool, bool, Units]) -> int:
    lines, as_json, units = shown
    if out is not None:
        from siloscope.reporting.track_page import write_track

        with writing(out):
            written = write_track(out, found, parquet)
        say(f"wrote {counted(len(written), 'file')} to {out}")
    if as_json:
        print_json(found.to_dict())
    elif lines:
        for reading in found.readings:
            print(documents.text(reading.to_dict()))
    else:
        _print(found, units)
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


def _print(found: Track, units: Units) -> None:
    """The table of readings, the events, and the forecast on stdout."""
    from siloscope.reporting.track_page import moment, when

    console = Console(highlight=False, soft_wrap=True, width=None if sys.stdout.isatty() else WIDTH)
    table = Table(box=None, padding=(0, 2, 0, 0))
    table.add_column("time", style="bold", overflow="fold")
    weighed = any(reading.mass is not None for reading in found.readings)
    (m3, volume_sign), (_, mass_sign) = units
    flow = "t" if weighed else volume_sign
    for name in (f"volume ({volume_sign})", "level (m)", f"mass ({mass_sign})", f"flow ({flow}/h)"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("", overflow="fold")
    for reading in found.readings[-SHOWN:]:
        table.add_row(*map(escape, _row(reading, weighed, units)))
    console.print(table)
    if len(found.readings) > SHOWN:
        say(f"{len(found.readings) - SHOWN} earlier readings not shown; --out, --json and --jsonl have all")
    for event in found.events:
        mass = "" if event.mass is None else f", {_mass(event.mass, units)} {mass_sign}"
        amount = with_std(event.volume, event.volume_std, 1.0 / m3, f" {volume_sign}")
        begin, end = moment(event.start, event.first), moment(event.end, event.last)
        console.print(f"{event.kind} of {amount}{mass}, {begin} to {end}", markup=False)
    if found.use is not None:
        use = found.use
        daily = with_std(use.daily, use.daily_std, 1.0 / m3, f" {volume_sign}")
        until = f"empty by {when(use.empty_by)}, between {when(use.earliest)} and {when(use.latest)}"
        if found.basis == "ullage":
            until = f"as low as ever seen by {when(use.lowest_by)}; the bottom is not known"
        console.print(f"use {daily} a day; {until}", markup=False)


def _mass(kg: float, units: Units) -> str:
    """A mass to about a kilogram."""
    kilograms = units[1][0]
    return f"{kg / kilograms:.{0 if kilograms <= 1.0 else 2}f}"


def _row(reading: Reading, weighed: bool, units: Units) -> tuple[str, ...]:
    from siloscope.reporting.track_page import when

    def number(value: float | None, digits: int) -> str:
        return "" if value is None else f"{value:.{digits}f}"

    m3 = units[0][0]
    volume = "" if reading.volume is None else with_std(reading.volume, reading.volume_std, 1.0 / m3, "")
    mass = "" if reading.mass is None else _mass(reading.mass, units)
    remark = ", ".join(reading.quality) if reading.status == "ok" else f"{reading.status}: {reading.reason}"
    name = "" if reading.name == reading.reason else reading.name  # of a file that can't be opened there is no more
    time = name if reading.time is None else when(reading.time)
    flow = reading.mass_flow if weighed else None if reading.flow is None else reading.flow / m3
    return (time, volume, number(reading.level, 3), mass, number(flow, 3), remark)
