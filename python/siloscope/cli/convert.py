"""``siloscope convert``: frames out of any file, with their camera and provenance."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from siloscope.cli import options
from siloscope.cli.inputs import opened
from siloscope.cli.outcome import PARTIAL, print_json, writing
from siloscope.cli.progress import say, track
from siloscope.io import FrameSource
from siloscope.io.conversion import Sink, open_sink
from siloscope.wording import counted


def convert(
    files: Annotated[list[Path], typer.Argument(metavar="FILE…", help="Recordings, images, arrays, clouds, folders.")],
    out: Annotated[
        Path,
        typer.Option(
            "--out", "-o", metavar="OUT", help="New folder, .zarr (an archive), .npz (a stack) or .ply (a cloud)."
        ),
    ],
    camera: options.CameraFile = None,
    depth_unit: options.DepthUnit = None,
    stream: options.Stream = None,
    ray_length: Annotated[
        bool, typer.Option("--ray-length", help="The depth stored is the ray's length, not z.")
    ] = False,
    raw_unit: Annotated[
        float | None, typer.Option(metavar="M", help="Write floating-point depth as 16-bit PNG of this unit.")
    ] = None,
    as_json: options.AsJson = False,
) -> int:
    """Extract frames with their camera, times, gravity and provenance.

    [bold]Example:[/bold] siloscope convert recording.bag -o frames

    A folder gets one file a frame (raw depth as 16-bit PNG, metres as .npy, points as PLY), camera.json with the unit,
    and frames.json with all else; a name that ends in .zarr makes an archive for many frames, or adds to one the frames
    that it does not have. Every command reads both. Nothing is rounded unless --raw-unit says so.
    Exit code 5 tells that some frames could not be read.
    """
    given = {"camera": camera, "depth_unit": depth_unit, "stream": stream, "ray_length": ray_length}
    with opened(files, **given) as source:
        with writing(out):
            sink = open_sink(out, raw_unit)
        document = _document(source, sink, out)
    for problem in document["problems"]:
        say(f"not read: {problem}")
    if as_json:
        print_json(document)
    else:
        say(f"{counted(document['frames'], 'frame')} written to {out}")
        if document["repeated"]:
            say(f"{counted(document['repeated'], 'frame')} not written again: {out} has them already")
    return PARTIAL if document["problems"] else 0


def _document(source: FrameSource, sink: Sink, out: Path) -> dict[str, Any]:
    """Passes all frames on and tells what was done."""
    count, first = 0, None
    for frame in track(source, "converting"):
        with writing(out):
            sink.add(frame)
        count, first = count + 1, first or frame
    with writing(out):
        sink.finish()
    return {
        "schema": "siloscope.convert/1",
        "out": str(out),
        "frames": count - sink.repeated,
        "repeated": sink.repeated,
        "camera": first.camera.to_dict() if first and first.camera else None,
        "depth_unit": first.depth_unit if first else None,
        "files": [str(path) for path in sink.files],
        "problems": source.problems,
    }
