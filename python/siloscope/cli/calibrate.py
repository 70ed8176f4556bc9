"""``siloscope calibrate``: many frames in, the silo's calibration out."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

import siloscope
from siloscope.cli import options
from siloscope.cli.inputs import opened
from siloscope.cli.outcome import PARTIAL, REFUSED, check_place, print_json, writing
from siloscope.cli.progress import say, track
from siloscope.cli.summary import floor_line, headline, pose_table, silo_line, tilt_line
from siloscope.errors import UsageError
from siloscope.estimation.vessel_checks import vessel_remarks
from siloscope.io import FrameSource
from siloscope.reasons import calibration_remark
from siloscope.types.calibration import Calibration
from siloscope.validation.mapping import Mapping, with_map
from siloscope.vessel.vessel import Vessel


def calibrate(
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FILE", help="Where to write the calibration.")],
    files: Annotated[
        list[Path] | None, typer.Argument(metavar="FRAMES…", help="Frames, folders or recordings, in order.")
    ] = None,
    empty: Annotated[
        list[Path] | None, typer.Option("--empty", metavar="FRAME", help="Frame of the empty vessel (tare).")
    ] = None,
    learn: Annotated[
        bool, typer.Option("--learn-floor", help="Learn the floor from a discharge that a refill confirms.")
    ] = False,
    cylinder: options.Cylinder = None,
    cone: options.Cone = None,
    top: options.Top = None,
    vessel: options.VesselFile = None,
    camera: options.CameraFile = None,
    sensor: options.Sensor = None,
    depth_unit: options.DepthUnit = None,
    diameter: options.Diameter = None,
    gravity: options.Gravity = None,
    bottom: options.Bottom = None,
    intrinsics: options.Intrinsics = None,
    earlier: Annotated[
        Path | None, typer.Option("--continue", metavar="FILE", help="An earlier calibration to go on with.")
    ] = None,
    sensor_map: Annotated[
        bool, typer.Option("--sensor-map", help="Map what the sensor reads wrong over its image, if that lasts.")
    ] = False,
    rule: Annotated[str, typer.Option(help="information, or mean-of-last-10, the paper's.")] = "information",
    jobs: Annotated[
        int | None, typer.Option(min=1, max=256, help="Frames at the same time; all cores unless given.")
    ] = None,
    stream: options.Stream = None,
    trust: options.Trust = None,
    axes: options.Axes = None,
    up: options.Up = None,
    as_json: options.AsJson = False,
) -> int:
    """Fuse many frames of one silo to its calibration: the camera's pose and the silo's geometry.

    [bold]Example:[/bold] siloscope calibrate day1/*.png --camera camera.json --sensor orbbec-astra-s -o silo7.json

    Frames count by what they show; bad ones are left out and named. Where the camera has moved, only the frames since
    are fused. --empty marks frames of the empty vessel: their floor is then known as it is, whatever its shape; with
    --continue and no FRAMES they only add the floor. --sensor-map looks for an error of the sensor that is smooth over
    the image and lasts; it is kept only if it foretells held-out frames, and then corrects the depth wherever this
    calibration is used (measure --calibration FILE, locate --sensor FILE).

    Exit code 4: no frame shows enough wall; 5: some frames can't be read, the rest is written.
    """
    check_place(out)
    down = None if gravity is None else options.numbers(gravity, 3, "--gravity")
    about = options.vessel_of(vessel, top, diameter=diameter, cylinder=cylinder, cone=cone, bottom=bottom)
    paths = [*(files or []), *([] if earlier is not None and not files else empty or [])]
    if not paths and not empty:
        raise UsageError("nothing to calibrate from; give FRAMES, or --empty FRAME")
    reading: dict[str, Any] = {"camera": camera, "depth_unit": depth_unit, "stream": stream, "axes": axes, "up": up}
    learned = _mapping(paths, reading, about, sensor, intrinsics) if sensor_map else None
    if paths:
        with opened(paths, **reading) as source:
            found = siloscope.calibrate(
                source,
                sensor=sensor if learned is None else learned.profile,
                diameter=None if about is None else about.sheet.diameter,
                gravity=down,
                bottom=None if about is None else _bottom(about),
                intrinsics=intrinsics,
                continue_from=earlier,
                rule=rule,
                jobs=jobs or os.cpu_count() or 1,
                trust=trust or (),
                progress=lambda frames: track(frames, "locating", _count(source)),
            )
    else:
        found = Calibration.load(earlier or "")
    found = found if learned is None else with_map(found, learned)
    found = _with_floor(found, empty, files if learn else None, reading, {"sensor": sensor, "vessel": about})
    contradicted = [] if about is None else list(vessel_remarks(found, about))
    for remark in contradicted:
        say(f"{remark.code}: {remark.message}")
    found = replace(found, quality=tuple(dict.fromkeys((*found.quality, *(one.code for one in contradicted)))))
    if _keeps_earlier(found, earlier, out):
        say(f"{out} is left as it was")
    else:
        with writing(out):
            found.save(out)
    if as_json:
        print_json(found.to_dict())
    else:
        _print(found, out)
        _tell_left_out(found)
    if not found.ok:
        return REFUSED
    return PARTIAL if found.counts["unreadable"] else 0


def _mapping(
    files: list[Path], reading: dict[str, Any], about: Vessel | None, sensor: str | None, intrinsics: str | None
) -> Mapping:
    """What the frames say of the sensor's error over its image."""
    with opened(files, **reading) as source:
        learned = siloscope.sensor_map(
            track(source, "mapping the sensor", _count(source)),
            sensor=sensor,
            diameter=None if about is None else about.sheet.diameter,
            intrinsics=intrinsics,
        )
    say(f"sensor {'mapped' if learned.map is not None else 'not mapped'}: {learned.message}")
    return learned


def _bottom(vessel: Vessel) -> str | None:
    """What a vessel's lengths say of its bottom."""
    return "flat" if vessel.sheet.cone == 0.0 else vessel.sheet.bottom


def _with_floor(
    found: Calibration,
    empty: list[Path] | None,
    discharge: list[Path] | None,
    reading: dict[str, Any],
    settings: dict[str, Any],
) -> Calibration:
    """With the floor of the empty vessel's frames, or of a discharge that a refill confirms."""
    if not found.ok:
        return found
    if empty:
        with opened(empty, **reading) as source:
            return siloscope.tare(found, source, **settings)
    if not discharge:
        return found
    with opened(discharge, **reading) as source:
        learned = siloscope.learn_floor(found, track(source, "learning the floor", _count(source)), **settings)
    if learned is found:
        say("no floor was learned: no place was seen before and after a fill that covered it")
    return learned


def _keeps_earlier(found: Calibration, earlier: Path | None, out: Path) -> bool:
    """Whether a refusal would take the place of the calibration that was to be gone on with."""
    return not found.ok and earlier is not None and earlier.resolve() == out.resolve()


def _count(source: FrameSource) -> int | None:
    try:
        return len(source)
    except TypeError:
        return None


def _print(found: Calibration, out: Path) -> None:
    """A short table on stdout, remarks on stderr."""
    console = Console(highlight=False, soft_wrap=True)
    counts = ", ".join(f"{count} {status}" for status, count in found.counts.items() if count)
    if not found.ok:
        console.print(headline(False, f"{found.reason} ({counts})"))
        console.print(found.message or "", markup=False)
        return
    console.print(headline(True, f"{out}: {counts}"))
    console.print(pose_table(found))
    for line in (tilt_line(found), silo_line(found.silo, found.silo_std)):
        console.print(line, markup=False)
    console.print(floor_line(found.floor), markup=False)
    for code in found.quality:
        say(f"{code}: {calibration_remark(code)['message']}{_when(found) if code == 'camera-moved' else ''}")


def _tell_left_out(found: Calibration) -> None:
    """The frames that don't count though they should, on stderr."""
    for record in found.frames:
        if record.status == "unreadable":
            say(f"not read: {record.reason or record.name}")
        elif record.status == "rejected":
            off = "" if record.deviation is None else f", {record.deviation:.0f} deviations off"
            say(f"rejected: {record.name}{off}")


def _when(found: Calibration) -> str:
    """From which frame on, and how far the camera moved."""
    move = found.moved_at
    if move is None:
        return ""
    name = next((record.name for record in found.frames if record.index == move.index), f"frame {move.index}")
    return f"; last before {name}, by {1e3 * move.shift:.1f} mm and {1e3 * move.turn:.2f} mrad"
