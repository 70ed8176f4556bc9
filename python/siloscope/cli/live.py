"""``siloscope live``: a camera's frames located as they come, for whoever mounts and turns it."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.text import Text

import siloscope
from siloscope.cli import options
from siloscope.cli.outcome import PARTIAL
from siloscope.cli.progress import say
from siloscope.cli.summary import pose_table, ratios_line, silo_line, tilt_line
from siloscope.errors import InputError
from siloscope.io import camera_files
from siloscope.schema import documents
from siloscope.sensors.live import SensorProcess, sensor, turn_for_more_wall
from siloscope.types.estimate import Estimate
from siloscope.types.frame import Frame


def live(
    source: Annotated[
        str, typer.Argument(metavar="realsense|orbbec|FILE", help="The camera, or a recording to replay.")
    ],
    camera: options.CameraFile = None,
    sensor_profile: options.Sensor = None,
    depth_unit: options.DepthUnit = None,
    diameter: options.Diameter = None,
    gravity: options.Gravity = None,
    intrinsics: options.Intrinsics = None,
    stream: options.Stream = None,
    trust: options.Trust = None,
    count: Annotated[int | None, typer.Option("--frames", min=1, help="Stop after so many frames.")] = None,
    threads: options.Threads = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON document a line and frame on stdout.")
    ] = False,
) -> int:
    """Locate continuously at the camera's rate while it is being mounted; Ctrl-C ends it.

    [bold]Example:[/bold] siloscope live realsense --sensor realsense-d455

    Shows pose, uncertainty and what is seen, and which way to turn the camera to see more wall.
    """
    settings: dict[str, Any] = {"sensor": sensor_profile, "diameter": diameter, "threads": threads, "trust": trust}
    settings["intrinsics"] = intrinsics
    settings["gravity"] = None if gravity is None else options.numbers(gravity, 3, "--gravity")
    given = {name: value for name, value in settings.items() if value is not None}
    shown, problems = 0, list[str]()
    with (
        contextlib.suppress(KeyboardInterrupt),
        _frames(source, camera, depth_unit, stream) as frames,
        _screen(as_json) as show,
    ):
        for frame in islice(frames, count):
            started = time.perf_counter()
            estimate = siloscope.locate(frame, **given)
            show(frame, estimate, turn_for_more_wall(estimate, frame), time.perf_counter() - started)
            shown += 1
        problems = getattr(frames, "problems", [])
    for problem in problems:
        say(f"not read: {problem}")
    if not shown:
        raise InputError(f"{source}: no frame came")
    return PARTIAL if problems else 0


@contextmanager
def _frames(
    source: str, camera: Path | None, depth_unit: float | None, stream: str | None
) -> Iterator[Iterable[Frame]]:
    """Frames of a live camera, which tells its unit itself, or of a recording."""
    if source not in ("realsense", "orbbec"):
        with siloscope.open(source, camera=camera, depth_unit=depth_unit, stream=stream) as recording:
            yield recording
        return
    with SensorProcess(sensor(source)) as process:
        yield _with_camera(iter(process), camera)


def _with_camera(frames: Iterator[Frame], camera: Path | None) -> Iterator[Frame]:
    """Frames with the user's intrinsics where given; they win over the camera's own."""
    for frame in frames:
        if camera is None or frame.depth is None:
            yield frame
            continue
        height, width = frame.depth.shape
        yield replace(frame, camera=camera_files.load(camera, (width, height)))


class _Lines:
    """One JSON document a frame on stdout."""

    def __call__(self, frame: Frame, estimate: Estimate, turn: str | None, seconds: float) -> None:
        document = {**estimate.to_dict(), "schema": "siloscope.live/1", "frame": frame.source}
        document |= {"timestamp": frame.timestamp, "turn": turn, "seconds": seconds}
        print(documents.text(document), flush=True)


class _Panel:
    """A table on stderr that stays in its place."""

    def __init__(self, view: Live) -> None:
        self._view = view
        self._rate = math.nan
        self._last = time.perf_counter()

    def __call__(self, frame: Frame, estimate: Estimate, turn: str | None, seconds: float) -> None:
        now = time.perf_counter()
        rate = 1.0 / max(1e-6, now - self._last)
        self._rate = rate if math.isnan(self._rate) else 0.8 * self._rate + 0.2 * rate
        self._last = now
        self._view.update(panel(frame, estimate, turn, self._rate, seconds), refresh=True)


def panel(frame: Frame, estimate: Estimate, turn: str | None, rate: float, seconds: float) -> RenderableType:
    """What is shown of one frame."""
    speed = f"{rate:.1f} frames/s, {seconds * 1000:.0f} ms to locate"
    lines: list[RenderableType] = [Text(f"{frame.source}: {speed}", style="dim")]
    if estimate.ok:
        lines += [Text("ok", style="bold green"), pose_table(estimate)]
        texts = (tilt_line(estimate), silo_line(estimate.silo, estimate.silo_std), ratios_line(estimate.pixel_ratios))
        lines += [Text(text) for text in texts if text]
    else:
        lines += [Text(f"refused: {estimate.reason}", style="bold yellow"), Text(estimate.message or "")]
    lines.append(Text(hint(turn), style="bold" if turn else "dim"))
    return Group(*lines)


def hint(turn: str | None) -> str:
    """The advice in words."""
    if turn is None:
        return "No side of the picture shows clearly more wall than the other."
    return f"Turn the camera {turn} (as in its picture) to see more wall."


@contextmanager
def _screen(as_json: bool) -> Iterator[_Lines | _Panel]:
    if as_json:
        yield _Lines()
        return
    console = Console(stderr=True, highlight=False)
    with Live(console=console, auto_refresh=False) as view:
        yield _Panel(view)
