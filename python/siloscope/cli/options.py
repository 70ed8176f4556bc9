"""Options that several commands share, and how their values are read."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Annotated

import typer

from siloscope.errors import InputError, UsageError
from siloscope.io import FrameSource
from siloscope.types.frame import Frame
from siloscope.vessel.vessel import Vessel, given

CameraFile = Annotated[
    Path | None, typer.Option("--camera", help="Intrinsics: JSON, TOML, ROS YAML or rs-enumerate-devices text.")
]
Sensor = Annotated[
    str | None, typer.Option("--sensor", metavar="NAME|FILE", help="Sensor profile: its depth bias and noise.")
]
DepthUnit = Annotated[
    float | None, typer.Option("--depth-unit", metavar="M", help="Metres per raw unit: 0.001 for millimetres.")
]
Diameter = Annotated[
    float | None, typer.Option("--diameter", metavar="M", help="The silo's diameter by tape: fixes the depth's scale.")
]
Gravity = Annotated[
    str | None, typer.Option("--gravity", metavar="X,Y,Z", help="Gravity in the camera frame, from an accelerometer.")
]
Intrinsics = Annotated[
    str | None,
    typer.Option("--intrinsics", metavar="exact|calibrated|nominal", help="How exactly the intrinsics are known."),
]
Trust = Annotated[
    list[str] | None,
    typer.Option(
        "--trust", metavar="WHAT", help="Keep an answer against: range, camera, bias, diameter or gravity; repeatable."
    ),
]
Axes = Annotated[
    str | None,
    typer.Option("--axes", metavar="X,Y,Z", help="A cloud's axes right, down and forward, such as x,-y,-z; or oak."),
]
Up = Annotated[str | None, typer.Option("--up", metavar="AXIS", help="A cloud's axis that points upwards: z, -y, ….")]
Cylinder = Annotated[
    float | None, typer.Option("--cylinder", metavar="M", help="Height of the cylinder by the datasheet.")
]
Cone = Annotated[float | None, typer.Option("--cone", metavar="M", help="Height of the cone by the datasheet.")]
Top = Annotated[
    float | None, typer.Option("--top", metavar="M", help="Upper edge below the camera (negative: above it).")
]
Bottom = Annotated[
    str | None, typer.Option("--bottom", metavar="KIND", help="cone: the cone seen is the bottom; flat; unknown.")
]
VesselFile = Annotated[
    Path | None, typer.Option("--vessel", metavar="TOML", help="The vessel: lengths, bottom, courses, roof, obstacles.")
]
Stream = Annotated[str | None, typer.Option("--stream", help="Which depth stream of a recording.")]
Threads = Annotated[int | None, typer.Option("--threads", min=1, max=256, help="Threads to use; 1 unless given.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document on stdout and nothing else.")]


def vessel_of(file: Path | None, top: float | None, **lengths: float | str | None) -> Vessel | None:
    """A vessel file with single lengths over it; None where nothing of a vessel is given."""
    known = (file, top, *lengths.values())
    return None if all(one is None for one in known) else given(file, top, **lengths)


def numbers(text: str, count: int, option: str) -> tuple[float, ...]:
    """Comma-separated finite numbers of an option."""
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != count or not all(math.isfinite(value) for value in values):
        raise UsageError(f"{option} '{text}': give {count} numbers separated by commas")
    return values


SECONDS = {"": 1.0, "s": 1.0, "min": 60.0, "h": 3600.0, "d": 86_400.0, "w": 604_800.0}
"""Seconds of the units in which a duration may be written."""


def seconds(text: str, option: str) -> float:
    """A duration of an option in seconds: a number, or one with a unit of `SECONDS`."""
    found = re.fullmatch(r"\s*(\d+(?:\.\d*)?(?:e[+-]?\d+)?)\s*([a-z]*)\s*", text.lower())
    if found is None or found[2] not in SECONDS:
        raise UsageError(f"{option} '{text}': give seconds, or a number with {', '.join(filter(None, SECONDS))}: 1h")
    return float(found[1]) * SECONDS[found[2]]


def one_frame(source: FrameSource, number: int) -> Frame:
    """Frame `number` (from 0) of a source."""
    try:
        return source[number]
    except IndexError:
        raise InputError(
            f"{source.name}: there is no frame {number}; `siloscope info` tells how many there are"
        ) from None
