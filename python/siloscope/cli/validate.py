"""``siloscope validate``: is what a calibration from these frames states true?"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from siloscope.cli import options
from siloscope.cli.inputs import Frames, opened
from siloscope.cli.outcome import PARTIAL, REFUSED, print_json, writing
from siloscope.cli.progress import say, track
from siloscope.cli.summary import headline
from siloscope.validation.validate import RESAMPLES, Validation, validate


def validate_command(
    files: Frames,
    camera: options.CameraFile = None,
    sensor: options.Sensor = None,
    depth_unit: options.DepthUnit = None,
    diameter: options.Diameter = None,
    intrinsics: options.Intrinsics = None,
    stream: options.Stream = None,
    axes: options.Axes = None,
    up: options.Up = None,
    resamples: Annotated[
        int, typer.Option(metavar="N", help="How often the solve is repeated with other noise; 0 for not at all.")
    ] = RESAMPLES,
    seed: Annotated[int, typer.Option(help="Of that noise.")] = 0,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write report.html and validation.json there.")
    ] = None,
    as_json: options.AsJson = False,
) -> int:
    """Check on your own frames whether what a calibration from them states is true.

    [bold]Example:[/bold] siloscope validate day1/*.png --camera camera.json --sensor orbbec-astra-s --out check

    Looks for patterns that a warped sensor, wrong intrinsics, light that goes round or a bent wall leave on the wall;
    calibrates halves of the frames and compares them; predicts the frames of each level by those of the others; solves
    again with other noise. An error of the intrinsics within their stated deviations is none: --intrinsics exact tests
    them as told.

    Exit code 4: the frames can't tell; 5: some can't be read, the rest is judged.
    """
    reading = {"camera": camera, "depth_unit": depth_unit, "stream": stream, "axes": axes, "up": up}
    with opened(files, **reading) as source:
        found = validate(
            source,
            sensor=sensor,
            diameter=diameter,
            intrinsics=intrinsics,
            resamples=resamples,
            seed=seed,
            progress=lambda items, label: track(items, label),
        )
        lost = source.problems
    if out is not None:
        from siloscope.reporting.validation_page import write_validation

        with writing(out):
            for path in write_validation(out, found):
                say(f"wrote {path}")
    if as_json:
        print_json(found.to_dict())
    else:
        _show(found)
    for problem in lost:
        say(f"not read: {problem}")
    return REFUSED if not found.ok else PARTIAL if lost else 0


def _show(found: Validation) -> None:
    console = Console(highlight=False, soft_wrap=True)
    if not found.ok:
        console.print(headline(False, str(found.reason)))
        console.print(found.message or "", markup=False)
        return
    console.print(f"[bold]{found.verdict}[/bold]")
    console.print(found.summary, markup=False)
    for one in found.findings[1:]:
        console.print(f"- {one.message}", markup=False)
    for one in found.findings:
        say(f"{one.code}: {one.remedy}")
