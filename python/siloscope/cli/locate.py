"""``siloscope locate``: frames in, the camera's pose out."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import siloscope
from siloscope.cli import options
from siloscope.cli.inputs import Frames, is_many, opened
from siloscope.cli.outcome import REFUSED, print_json, writing
from siloscope.cli.progress import say
from siloscope.cli.several import Answers, each
from siloscope.cli.summary import print_estimate
from siloscope.errors import InputError
from siloscope.estimation import region
from siloscope.estimation.inputs import metres
from siloscope.estimation.region import Mask
from siloscope.io import FrameSource
from siloscope.io.orientation import optical
from siloscope.types.estimate import Estimate
from siloscope.types.frame import Frame
from siloscope.wording import counted, with_std

COLUMNS = ("r_x (°)", "r_y (°)", "t_x (mm)", "t_y (mm)", "radius (mm)", "")
"""Columns of the table for many frames, after the frame's name."""


def locate(
    files: Frames,
    camera: options.CameraFile = None,
    sensor: options.Sensor = None,
    depth_unit: options.DepthUnit = None,
    diameter: options.Diameter = None,
    cylinder: options.Cylinder = None,
    cone: options.Cone = None,
    bottom: options.Bottom = None,
    top: options.Top = None,
    vessel: options.VesselFile = None,
    method: Annotated[str | None, typer.Option(help="surface (default) or shape-tensor, the paper's.")] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write the adjusted cloud, the JSON and pictures here.")
    ] = None,
    mask: Annotated[Path | None, typer.Option(help="Image or .npy, not 0 where the silo is.")] = None,
    label: Annotated[int | None, typer.Option(help="Use only points with this label of the file.")] = None,
    crop: Annotated[
        str | None, typer.Option(metavar="XMIN,XMAX,…,ZMAX", help="Use only points in this box of the camera frame, m.")
    ] = None,
    grid: Annotated[
        float | None, typer.Option(metavar="M", help="Edge of the voxel grid's cells; 0.05 m unless given.")
    ] = None,
    neighbours: Annotated[
        int | None, typer.Option(help="Neighbours for normals and shape tensors; 30 unless given.")
    ] = None,
    gravity: options.Gravity = None,
    intrinsics: options.Intrinsics = None,
    trust: options.Trust = None,
    axes: options.Axes = None,
    up: options.Up = None,
    number: Annotated[int | None, typer.Option("--frame", min=0, help="Which frame of several, from 0.")] = None,
    every: Annotated[bool, typer.Option("--all", help="Every frame of a recording, not its first.")] = False,
    stream: options.Stream = None,
    threads: options.Threads = None,
    as_json: options.AsJson = False,
) -> int:
    """Find the silo's axis in each frame, and so the camera's pose in the silo.

    [bold]Example:[/bold] siloscope locate frame.png --camera camera.json --sensor orbbec-astra-s --out result

    Several files and folders give a table, or with --json a line each; of a recording its first frame counts, or the
    one of --frame, or --all.

    Exit code 4 tells that no frame shows enough wall; the answers then say why. 5: some have none.
    """
    box = None if crop is None else options.numbers(crop, 6, "--crop")
    settings: dict[str, Any] = {"method": method, "sensor": sensor, "diameter": diameter, "threads": threads}
    settings |= {"grid": grid, "neighbours": neighbours, "intrinsics": intrinsics, "trust": trust}
    settings["vessel"] = options.vessel_of(vessel, top, cylinder=cylinder, cone=cone, bottom=bottom)
    settings["gravity"] = None if gravity is None else options.numbers(gravity, 3, "--gravity")
    given = {name: value for name, value in settings.items() if value is not None}

    def one(frame: Frame) -> tuple[Frame, Estimate, Mask | None]:
        frame = optical(frame)
        chosen = selection(frame, mask, label)
        return frame, _located(frame, mask=chosen, crop=box, **given), within(frame, chosen, box)

    with opened(files, camera=camera, depth_unit=depth_unit, stream=stream, axes=axes, up=up) as source:
        if number is None and (every or is_many(files, source)):
            return _each(source, one, out, as_json)
        frame, estimate, shown = one(options.one_frame(source, number or 0))
        if source.frame_count != 1 and not as_json:
            say(f"{frame.source}; choose another with --frame, or --all")
    if out is not None:
        _write(out, frame, estimate, shown)
    if as_json:
        print_json(estimate.to_dict())
    else:
        print_estimate(estimate, frame.source)
    return 0 if estimate.ok else REFUSED


def _located(frame: Frame, **settings: Any) -> Estimate:
    estimate = siloscope.locate(frame, **settings)
    if estimate.reason == "no-depth" and frame.depth is not None and not (metres(frame) > 0).any():
        raise InputError(f"{frame.source}: no pixel has a depth; check the stream and the sensor's window")
    return estimate


One = Callable[[Frame], tuple[Frame, Estimate, Mask | None]]


def _each(source: FrameSource, one: One, out: Path | None, as_json: bool) -> int:
    """The answer of every frame, with --out in a folder each."""
    answers = Answers(COLUMNS, as_json)
    for number, (frame, (_, estimate, shown)) in enumerate(each(source, one, "locating")):
        answers.add(frame, estimate, row(estimate))
        if out is not None:
            _write(out / f"{number:04d}", frame, estimate, shown)
    return answers.finish(source.problems)


def row(estimate: Estimate) -> tuple[str, ...]:
    """An estimate's row in the table for many frames; a refused one has its reason."""
    remarks = ", ".join(remark.code for remark in estimate.quality)
    if estimate.pose is None or estimate.covariance is None:
        return "", "", "", "", "", f"refused: {estimate.reason}"
    std = [math.sqrt(variance) for variance in np.diag(estimate.covariance)]
    factors = (math.degrees(1.0), math.degrees(1.0), 1e3, 1e3)
    values = (estimate.r_x, estimate.r_y, estimate.t_x, estimate.t_y)
    pose = [with_std(v, s, f, "") for v, s, f in zip(values, std, factors, strict=True)]
    return *pose, with_std(estimate.silo.radius, estimate.silo_std.radius, 1e3, ""), remarks


def selection(frame: Frame, mask: Path | None, label: int | None) -> Mask | None:
    """What --mask and --label leave of a frame; None where neither is given."""
    shape = (frame.points[..., 0] if frame.points is not None else np.asarray(frame.depth)).shape
    parts = [
        None if mask is None else region.read_mask(mask, shape),
        None if label is None else region.label_mask(frame, label),
    ]
    given = [part for part in parts if part is not None]
    return np.logical_and.reduce(given) if given else None


def within(frame: Frame, chosen: Mask | None, box: tuple[float, ...] | None) -> Mask | None:
    """The chosen part of a frame that lies in the box."""
    if box is None:
        return chosen
    inside = region.box_mask(frame, box)
    return inside if chosen is None else inside & chosen


def _write(out: Path, frame: Frame, estimate: Estimate, shown: Mask | None) -> None:
    from siloscope.reporting.results import write_results

    with writing(out):
        written = write_results(out, frame, estimate, shown)
    say(f"wrote {counted(len(written), 'file')} to {out}")
