"""``siloscope locate``: one frame in, the pose out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import siloscope
from siloscope.cli import options
from siloscope.cli.outcome import REFUSED, print_json, writing
from siloscope.cli.progress import say
from siloscope.cli.summary import print_estimate
from siloscope.errors import InputError
from siloscope.estimation import region
from siloscope.estimation.inputs import metres
from siloscope.estimation.region import Mask
from siloscope.types.estimate import Estimate
from siloscope.types.frame import Frame
from siloscope.wording import counted


def locate(
    file: Annotated[Path, typer.Argument(metavar="FRAME", help="Depth image, depth array, point cloud or recording.")],
    camera: options.CameraFile = None,
    sensor: options.Sensor = None,
    depth_unit: options.DepthUnit = None,
    diameter: options.Diameter = None,
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
    number: Annotated[int, typer.Option("--frame", min=0, help="Which frame of several, from 0.")] = 0,
    stream: options.Stream = None,
    threads: options.Threads = None,
    as_json: options.AsJson = False,
) -> int:
    """Find the silo's axis in one frame, and so the camera's pose in the silo.

    [bold]Example:[/bold] siloscope locate frame.png --camera camera.json --sensor orbbec-astra-s --out result

    Exit code 4 tells that the frame was read well but does not show enough wall; the answer then says why.
    """
    with siloscope.open(file, camera=camera, depth_unit=depth_unit, stream=stream) as source:
        frame = options.one_frame(source, number)
        several = source.frame_count != 1
    if several and not as_json:
        say(f"{frame.source}; choose another with --frame")
    box = None if crop is None else options.numbers(crop, 6, "--crop")
    chosen = selection(frame, mask, label)
    settings: dict[str, Any] = {"method": method, "sensor": sensor, "diameter": diameter, "threads": threads}
    settings |= {"grid": grid, "neighbours": neighbours, "intrinsics": intrinsics}
    settings["gravity"] = None if gravity is None else options.numbers(gravity, 3, "--gravity")
    given = {name: value for name, value in settings.items() if value is not None}
    estimate = siloscope.locate(frame, mask=chosen, crop=box, **given)
    if estimate.reason == "no-depth" and frame.depth is not None and not (metres(frame) > 0).any():
        raise InputError(f"{frame.source}: no pixel has a depth; check the stream and the sensor's window")
    if out is not None:
        _write(out, frame, estimate, within(frame, chosen, box))
    if as_json:
        print_json(estimate.to_dict())
    else:
        print_estimate(estimate, frame.source)
    return 0 if estimate.ok else REFUSED


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
