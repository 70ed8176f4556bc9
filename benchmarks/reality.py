"""Every real recording at hand, answered, beside what is known of it: a page with pictures.

python -m benchmarks.reality [FOLDER…] --out build/reality

Without a folder, the recordings by others of `reality.toml` in SILOSCOPE_REALDATA or ../shared/realdata. A folder of
your own may have a `reference.toml` with the same entries; its other files are answered without a reference.
"""

from __future__ import annotations

import argparse
import io
import math
import os
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track

import siloscope
from siloscope import Estimate, SiloscopeError
from siloscope.estimation.region import box_mask, label_mask
from siloscope.reporting import report
from siloscope.reporting.results import pictures
from siloscope.types.frame import Frame

HERE = Path(__file__).parent
GENUINE = Path(os.environ.get("SILOSCOPE_REALDATA", HERE.parents[1] / "shared" / "realdata"))
BESIDE = (".md", ".txt", ".toml", ".json", ".yaml", ".yml")
"""Files beside recordings that are none."""
SHOWN = ("overview", "profile", "clouds", "depth")
"""Pictures in the order of preference; the first that a frame allows is shown."""


@dataclass(frozen=True)
class Recording:
    """A file and what is known of it."""

    path: Path
    title: str
    label: int | None = None
    crop: tuple[float, ...] | None = None
    grid: float | None = None
    camera: str | None = None
    sensor: str | None = None
    depth_unit: float | None = None
    axis: tuple[float, float, float] | None = None
    point: tuple[float, float, float] | None = None
    radius: float | None = None
    refused: bool = False
    source: str = ""


@dataclass(frozen=True)
class Answer:
    """What the program says of a recording."""

    recording: Recording
    estimate: Estimate | None
    problem: str = ""
    picture: bytes | None = None

    @property
    def degrees(self) -> float | None:
        """Angle between the axes."""
        if self.recording.axis is None or self.estimate is None or self.estimate.pose is None:
            return None
        known = np.array(self.recording.axis) / np.linalg.norm(self.recording.axis)
        return math.degrees(
            math.asin(min(1.0, float(np.linalg.norm(np.cross(known, self.estimate.pose.axis_direction)))))
        )

    @property
    def beside(self) -> float | None:
        """Distance of the known point from the axis, m."""
        if self.recording.point is None or self.estimate is None or self.estimate.pose is None:
            return None
        off = np.subtract(self.recording.point, self.estimate.pose.axis_point)
        return float(np.linalg.norm(np.cross(off, self.estimate.pose.axis_direction)))

    @property
    def said(self) -> str:
        """Answered, or why not."""
        if self.estimate is None:
            return f"not read: {self.problem}"
        return "answered" if self.estimate.ok else f"refused: {self.estimate.reason}"

    @property
    def as_known(self) -> bool | None:
        """Whether a recording that should be refused is, and one with a reference is answered; None without either."""
        if not self.recording.refused and self.recording.axis is None and self.recording.radius is None:
            return None
        return (self.estimate is None or not self.estimate.ok) == self.recording.refused


def recordings(folder: Path, known: Path) -> Iterator[Recording]:
    """What a file of references says of a folder."""
    for entry in tomllib.loads(known.read_text("utf-8"))["recording"]:
        told: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list) else value for name, value in entry.items()
        }
        path = folder / told.pop("file")
        if path.exists():
            yield Recording(path=path, **told)


def of_folder(folder: Path) -> Iterator[Recording]:
    """A user's folder: the recordings of its own reference.toml, then its other files."""
    known = folder / "reference.toml"
    told = list(recordings(folder, known)) if known.exists() else []
    yield from told
    named = {recording.path for recording in told}
    for path in sorted(folder.rglob("*")):
        if (
            path.is_file()
            and path not in named
            and path.suffix.lower() not in {".md", ".txt", ".toml", ".json", ".yaml"}
        ):
            yield Recording(path=path, title=path.name)


def answered(recording: Recording) -> Answer:
    """The recording's first frame, located and drawn."""
    try:
        with siloscope.open(recording.path, camera=recording.camera, depth_unit=recording.depth_unit) as source:
            frame = next(iter(source))
        mask = _mask(frame, recording)
        estimate = siloscope.locate(frame, mask=mask, grid=recording.grid, sensor=recording.sensor)
    except (SiloscopeError, StopIteration) as error:
        return Answer(recording, None, str(error) or "no frame in it")
    return Answer(recording, estimate, picture=_picture(frame, estimate, mask))


def _mask(frame: Frame, recording: Recording) -> np.ndarray | None:
    if recording.label is not None:
        return label_mask(frame, recording.label)
    return None if recording.crop is None else box_mask(frame, recording.crop)


def _picture(frame: Frame, estimate: Estimate, mask: np.ndarray | None) -> bytes | None:
    made = pictures(frame, estimate, mask)
    chosen = next((made[name] for name in SHOWN if name in made), None)
    if chosen is None:
        return None
    png = io.BytesIO()
    chosen.savefig(png, dpi=90)
    return png.getvalue()


def row(answer: Answer) -> list[str]:
    """The table's line of a recording."""
    estimate, known = answer.estimate, answer.recording
    angle, std = "", ""
    if estimate is not None and estimate.covariance is not None:
        std = f" ± {math.degrees(math.sqrt(float(np.trace(estimate.covariance[:2, :2])))):.2f}"
    if answer.degrees is not None:
        angle = f"{answer.degrees:.2f}{std}"
    beside = "" if answer.beside is None else f"{1e3 * answer.beside:.1f}"
    radius = ""
    if estimate is not None and estimate.silo.radius is not None:
        radius = f"{1e3 * estimate.silo.radius:.1f} ± {1e3 * (estimate.silo_std.radius or 0.0):.1f}"
    reference = "" if known.radius is None else f"{1e3 * known.radius:.1f}"
    return [known.title, answer.said, angle, beside, radius, reference]


HEAD = ("recording", "answer", "axis off, °", "point off, mm", "radius, mm", "known radius, mm")


def page(answers: list[Answer]) -> report.Report:
    """The page."""
    judged = [answer.as_known for answer in answers if answer.as_known is not None]
    located = [answer for answer in answers if answer.degrees is not None]
    made = report.Report(
        "Real recordings",
        "What siloscope says of recordings that no one here made, beside what is known of them. No depth frame from "
        "inside a real silo is public: these are smaller or other surfaces of revolution, and scenes without one.",
        "python -m benchmarks.reality",
    )
    cards = [(f"{sum(judged)} of {len(judged)}", "are answered or refused as they should be")]
    if located:
        cards.append((f"{max(a.degrees or 0.0 for a in located):.1f}°", "largest angle to a reference axis"))
    made.cards(cards).section("Answers", report.table(HEAD, [row(answer) for answer in answers]))
    for answer in answers:
        says = [f"{answer.said.capitalize()}.", *([f"Known: {known}."] if (known := answer.recording.source) else [])]
        if answer.estimate is not None and answer.estimate.message:
            says.append(answer.estimate.message)
        shown = [] if answer.picture is None else [report.picture(answer.picture, answer.recording.title)]
        made.section(answer.recording.title, report.text(*says), *shown)
    return made


def main() -> None:
    """Writes the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--out", type=Path, default=Path("build/reality"))
    arguments = parser.parse_args()
    found = [one for folder in arguments.folders for one in of_folder(folder)]
    if not arguments.folders:
        found = list(recordings(GENUINE, HERE / "reality.toml"))
    if not found:
        parser.error(f"no recording in {', '.join(map(str, arguments.folders)) or GENUINE}")
    console = Console(stderr=True)
    answers = [answered(recording) for recording in track(found, "locating", console=console)]
    arguments.out.mkdir(parents=True, exist_ok=True)
    console.print(f"wrote {page(answers).write(arguments.out / 'index.html')}")
    for answer in answers:
        print("\t".join(row(answer)))


if __name__ == "__main__":
    main()
