"""``siloscope info``: what is inside a file."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import typer

import siloscope
from siloscope.cli import options
from siloscope.cli.inputs import expanded, standard_input
from siloscope.cli.outcome import PARTIAL, print_json
from siloscope.cli.progress import track
from siloscope.io.first_frame import look
from siloscope.io.recordings.contents import NothingToRead
from siloscope.io.source import FrameSource
from siloscope.schema import documents


def info(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="FILE…", help="Recordings, images, arrays, clouds, folders, globs; - for stdin."),
    ],
    camera: options.CameraFile = None,
    depth_unit: options.DepthUnit = None,
    stream: options.Stream = None,
    check: Annotated[bool, typer.Option("--check", help="Also read every frame and tell which are damaged.")] = False,
    as_json: options.AsJson = False,
) -> int:
    """Show what is inside a file: streams, sizes, units, intrinsics, frames, gravity.

    [bold]Example:[/bold] siloscope info recording.bag

    Of several files, --json prints a line each. With --check, exit code 5 tells that some frames are damaged.
    """
    damaged = False
    with standard_input(expanded(files)) as paths:
        for path in paths:
            document = _document(path, check, camera=camera, depth_unit=depth_unit, stream=stream)
            damaged |= check and bool(document["problems"])
            if as_json and len(paths) > 1:
                print(documents.text(document), flush=True)
            elif as_json:
                print_json(document)
            else:
                print_description(document)
    return PARTIAL if damaged else 0


def _document(path: Path, check: bool, **terms: Any) -> dict[str, Any]:
    with _opened(path, **terms) as source:
        read = sum(1 for _ in track(source, "reading")) if check else None
        return _described(source) | ({"read": read} if check else {})


def _opened(file: Path, **options: Any) -> FrameSource:
    """The source; of a recording without depth and points, one that lists what it has."""
    try:
        return siloscope.open(file, **options)
    except NothingToRead as nothing:
        return nothing.source


def _described(source: FrameSource) -> dict[str, Any]:
    """The source's description with its first frame; where none is readable, sizes are only declared, and left out."""
    document, first = source.describe(), look(source)
    if first and "error" in first:
        document["streams"] = [{**stream, "size": None} for stream in document["streams"]]
        document["problems"] = list(dict.fromkeys([*document["problems"], first["error"]]))
    return document | {"first_frame": first}


def print_description(document: dict[str, Any]) -> None:
    """A table on stdout, a line a row however long."""
    from rich.console import Console
    from rich.text import Text

    known = rows(document)
    width = max(len(key) for key, _ in known) + 2
    console = Console(highlight=False, soft_wrap=True)
    for key, text in known:
        console.print(Text.assemble((key.ljust(width), "bold"), text))


def rows(document: dict[str, Any]) -> list[tuple[str, str]]:
    """The description as pairs of a name and a text for people."""
    known = [
        ("file", f"{document['file']} ({document['format']})"),
        ("frames", _frames(document)),
        *((f"stream {'*' if stream.get('chosen') else ' '}", _stream(stream)) for stream in document["streams"]),
        ("first frame", _first_frame(document.get("first_frame"))),
        ("camera", _camera(document)),
        ("depth unit", _unit(document)),
        ("gravity", _gravity(document["gravity"])),
        ("time", _time(document["timestamps"])),
        *((key.replace("_", " "), _short(value)) for key, value in document["provenance"].items() if key not in _SHOWN),
        *((f"topic {'*' if topic['read'] else ' '}", _topic(topic)) for topic in document["topics"]),
        *(("problem", problem) for problem in document["problems"]),
    ]
    return [(key, text) for key, text in known if text]


_SHOWN = ("format", "file", "camera_from", "depth_unit_from")


def _frames(document: dict[str, Any]) -> str:
    count = "known after reading (--check)" if document["frames"] is None else str(document["frames"])
    return count if document.get("read") is None else f"{count}, {document['read']} of them readable"


def _stream(stream: dict[str, Any]) -> str:
    size = " x ".join(map(str, stream.get("size") or ())) or "size unknown"
    what = "points" if stream.get("kind") == "points" else "pixels"
    frames = stream.get("frames")
    count = "" if frames is None else f", {frames} {'frame' if frames == 1 else 'frames'}"
    return f"{stream.get('name')}: {stream.get('kind')}, {size} {what}, {stream.get('dtype') or 'type unknown'}{count}"


def _topic(topic: dict[str, Any]) -> str:
    count = topic["messages"]
    return f"{topic['name']}: {topic['type']}, {count} {'message' if count == 1 else 'messages'}: {topic['note']}"


def _first_frame(numbers: dict[str, Any] | None) -> str:
    if numbers is None or "error" in numbers:
        return "" if numbers is None else "can't be read"
    invalid = f"{100 * numbers['invalid']:.1f} % without measurement"
    if extent := numbers.get("extent"):
        sides = ", ".join(f"{axis} {least:.3f} to {most:.3f}" for axis, (least, most) in extent.items())
        return f"{sides} m, {invalid}"
    depth = numbers.get("depth", {})
    if "median" not in depth:
        return invalid
    unit, digits = ("raw units", 0) if depth["unit"] == "raw" else ("m", 3)
    least, median, most = (f"{depth[key]:.{digits}f}" for key in ("least", "median", "most"))
    return f"depth {least} to {most} {unit}, median {median}, {invalid}"


def _camera(document: dict[str, Any]) -> str:
    camera = document["camera"]
    if camera is None:
        depth = any(stream.get("kind") == "depth" and stream.get("chosen") for stream in document["streams"])
        return "unknown; give --camera" if depth else ""
    names = ("fx", "fy", "cx", "cy")
    numbers = " ".join(f"{name} {camera[name]:.3f}".rstrip("0").rstrip(".") for name in names)
    lens = " ".join([camera["distortion_model"], *(f"{k:.6g}" for k in camera["distortion"])])
    return f"{camera['width']} x {camera['height']}, {numbers}, distortion {lens}{_origin(document['camera_from'])}"


def _unit(document: dict[str, Any]) -> str:
    unit = document["depth_unit"]
    raw = [stream for stream in document["streams"] if stream.get("kind") == "depth" and stream.get("chosen")]
    if unit is not None:
        return f"{unit * 1000:.6g} mm{_origin(document['depth_unit_from'])}"
    if any("float" in str(stream.get("dtype")) for stream in raw):
        return "metres"
    return "unknown; give --depth-unit" if raw else ""


def _gravity(gravity: list[float] | None) -> str:
    if gravity is None:
        return ""
    size = math.sqrt(sum(g * g for g in gravity))
    return f"{' '.join(f'{g:.3f}' for g in gravity)} m/s² ({size:.2f})"


def _time(times: dict[str, float] | None) -> str:
    if times is None:
        return ""
    from datetime import UTC, datetime

    first, last = times["first"], times["last"]
    if not 1e8 < first < 1e11:  # since the recording's start, not since 1970
        return f"{first:.3f} to {last:.3f} s ({last - first:.3f} s)"
    return f"{datetime.fromtimestamp(first, UTC):%Y-%m-%d %H:%M:%S} UTC, {last - first:.3f} s long"


def _origin(source: str | None) -> str:
    return f" ({source})" if source else ""


def _short(value: Any) -> str:
    text = ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)
    return text if len(text) <= 200 else f"{text[:197]}..."
