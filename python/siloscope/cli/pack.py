"""``siloscope pack``: frames sealed for many machines."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from siloscope.cli import options
from siloscope.cli.outcome import PARTIAL, print_json
from siloscope.cli.progress import say, track
from siloscope.cli.serve import need_monitor
from siloscope.errors import UsageError
from siloscope.fleet.pack import CAMERA, pack_monitor
from siloscope.fleet.pack import pack as packed
from siloscope.io.shard_layout import MOST_FRAMES
from siloscope.wording import counted


def pack(
    out: Annotated[str, typer.Option("--out", "-o", metavar="STORE", help="Folder or object store URL (s3://…).")],
    files: Annotated[
        list[Path] | None, typer.Argument(metavar="FRAMES…", help="Archives, folders, recordings, images.")
    ] = None,
    monitor: Annotated[
        Path | None, typer.Option("--monitor", metavar="DATA", help="In place of FRAMES: a service's --data folder.")
    ] = None,
    database: Annotated[
        str | None, typer.Option("--database", metavar="URL", help="With --monitor: the service's --database.")
    ] = None,
    silo: Annotated[
        str | None, typer.Option("--silo", metavar="ID", help="The frames' silo; each file's own name unless given.")
    ] = None,
    camera_id: Annotated[str, typer.Option("--camera-id", metavar="ID", help="Their camera in the silo.")] = CAMERA,
    calibration: Annotated[
        Path | None, typer.Option("--calibration", metavar="FILE", help="The silo's calibration, kept with the frames.")
    ] = None,
    shard_frames: Annotated[
        int, typer.Option("--shard-frames", min=1, max=MOST_FRAMES, help="Most frames an object.")
    ] = MOST_FRAMES,
    camera: options.CameraFile = None,
    depth_unit: options.DepthUnit = None,
    stream: options.Stream = None,
    as_json: options.AsJson = False,
) -> int:
    """Seal frames in Zarr shards beside a Parquet manifest, for `siloscope fleet` and for any Zarr reader.

    [bold]Example:[/bold] siloscope pack silo7.zarr silo8.zarr -o s3://mill/frames

    Every object holds frames of one silo and month. Frames that are sealed already are passed over, so a packing that
    was cut off is gone on with by the same command. A folder of single images is a silo by the folder's name. The store
    opens like any other source: `siloscope track STORE --stream silo7 …`. Needs the extra 'fleet'.

    With --monitor, the frames that a service still has are sealed, each camera's with its calibration and the silo's
    settings, while the service may run; `siloscope fleet publish RUN --monitor DATA` brings a run of them back.

    Exit code 5 tells that some frames could not be read.
    """
    if (monitor is None) == (not files) or (database is not None and monitor is None):
        raise UsageError("give frames to be sealed, or --monitor with a service's data folder (and its --database)")
    if monitor is not None:
        need_monitor("the frames of a service")
        done = pack_monitor(
            monitor,
            out,
            database=database,
            silo=silo,
            shard_frames=shard_frames,
            progress=lambda frames: track(frames, "sealing"),
        )
    else:
        done = packed(
            files or [],
            out,
            silo=silo,
            camera_id=camera_id,
            shard_frames=shard_frames,
            calibration=calibration,
            progress=lambda source: track(source, "sealing"),
            camera=camera,
            depth_unit=depth_unit,
            stream=stream,
        )
    for problem in done.problems:
        say(f"not read: {problem}")
    if as_json:
        print_json(done.to_dict())
    else:
        before = f", {done.present} were there before" if done.present else ""
        say(f"{counted(done.frames, 'frame')} sealed in {counted(done.shards, 'shard')} of {out}{before}")
    return PARTIAL if done.problems else 0
