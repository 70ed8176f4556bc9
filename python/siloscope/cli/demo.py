"""``siloscope demo``: the newcomer's first run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from siloscope.cli import options
from siloscope.cli.outcome import print_json, writing
from siloscope.cli.progress import say, track
from siloscope.content import Content
from siloscope.reporting.demo import Step, fused, half_empty, locate_all, measured, scenes, write_frame
from siloscope.types.calibration import Calibration


def demo(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where to write the report.")] = Path("demo"),
    steps: Annotated[int, typer.Option(min=1, max=1000, help="Frames of the discharge.")] = 24,
    as_json: options.AsJson = False,
) -> None:
    """Simulate a silo that is emptied, find its axis in every frame, measure its content, and write a report page.

    [bold]Example:[/bold] siloscope demo --out demo

    Also writes the last frame as a user would have it, with its camera file, to try `siloscope locate` on.
    """
    with writing(out):
        out.mkdir(parents=True, exist_ok=True)
    done = list(track(locate_all(scenes(steps)), "locating", total=steps))
    calibration = fused(done)
    contents = list(track(measured(done, calibration), "measuring", total=steps))
    say("drawing the report")
    report = _write(done, calibration, contents, out)
    found = sum(step.estimates["surface"].ok for step in done)
    if as_json:
        print_json(_document(done, calibration, contents, report))
    else:
        typer.echo(f"{found} of {steps} frames answered. The report: {report}")


def _write(done: list[Step], calibration: Calibration, contents: list[Content], out: Path) -> Path:
    from siloscope.reporting.demo.page import page

    finished = page(done, calibration, contents)
    with writing(out):
        write_frame(half_empty(done), out)
        calibration.save(out / "calibration.json")
        return finished.write(out / "report.html")


def _document(done: list[Step], calibration: Calibration, contents: list[Content], report: Path) -> dict[str, Any]:
    return {
        "schema": "siloscope.demo/1",
        "report": str(report),
        "frames": [step.to_dict() for step in done],
        "contents": [content.to_dict() for content in contents],
        "calibration": {key: value for key, value in calibration.to_dict().items() if key != "evidence"},
    }
