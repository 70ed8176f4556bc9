"""Every method on the same frames in one run: time and error, as a page, a table and a plot.

python benchmarks/peers/run.py [--out docs] [--every N] [--repeats N]
"""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

import numpy as np
from frames import IN_USE, SENSORS, Shown, scenes, shown
from install import PACKAGES
from methods import METHODS, Found, Method
from rich.progress import track
from score import distances

from siloscope import __version__
from siloscope.reproduction.evaluation.tables import Cell, Table, number
from siloscope.reproduction.timing import machine

FAILURE = 0.1
"""Distance from which on an answer is no answer, m; Eq. 11 saturates, so this is farther off than it sounds."""

SLOW = 4
"""Slow methods get only every so many frames."""

KINDS = (*SENSORS, IN_USE)

INTRODUCTION = """
The libraries that a user would reach for instead, on the same frames and in one run. No number on this page is
typed by hand. How each library is set up and why is in `benchmarks/peers/README.md`.

Every method gets the depths of one 640 x 480 frame in memory and gives one axis. "told" is what it knows besides.
Registration is told the silo's geometry, which is what the axis job does not give; it shows what could be had with it.
"""


@dataclass(frozen=True)
class Result:
    """A method on a frame."""

    method: Method
    frame: Shown
    found: list[Found]
    off: list[float]


def measured(every: int, repeats: int) -> Iterator[Result]:
    """Runs everything, method after method on each frame, so that all meet the same state of the machine."""
    present = [method for method in METHODS if method.available()]
    chosen = list(scenes())[::every]
    for count, scene in enumerate(track(chosen, "frames")):
        for frame in shown(*scene):
            for method in present:
                if not method.slow or count % SLOW == 0:
                    yield _result(method, frame, 1 if method.once else repeats)


def _result(method: Method, frame: Shown, repeats: int) -> Result:
    found = method.answers(frame, repeats)
    return Result(method, frame, found, distances(frame, found))


def table(results: Sequence[Result], part: str) -> Table:
    """A row a method: time, and error by kind of frame."""
    head = ("method", "told", "time, ms", "worst, ms", *(f"{kind}, mm" for kind in KINDS), "worst, mm", "failures")
    rows = [_row(method, [r for r in results if r.method is method and r.frame.part == part]) for method in METHODS]
    title = {"whole": "Whole frames", "walls": "Walls alone (feed removed by the true labels)"}[part]
    return Table(f"peers-{part}", title, head, tuple(row for row in rows if row))


def _row(method: Method, results: Sequence[Result]) -> tuple[Cell, ...]:
    if not results:
        return ()
    times = [run.ms for result in results for run in result.found]
    off = np.array([value for result in results for value in result.off])
    failed = int(np.count_nonzero(~(off <= FAILURE)))
    kinds = [_median([value for r in results if r.frame.kind == kind for value in r.off]) for kind in KINDS]
    worst = 1e3 * float(np.nanmax(off)) if np.isfinite(off).any() else None
    rest: tuple[Cell, ...] = (*kinds, worst, f"{failed} of {len(off)}")
    return (method.name, method.told, float(np.median(times)), max(times), *rest)


def _median(off: Sequence[float]) -> float | None:
    """Median distance in mm, an unanswered run counting as the farthest."""
    if not off:
        return None
    middle = float(np.median(np.where(np.isnan(off), np.inf, off)))
    return 1e3 * middle if np.isfinite(middle) else None


def said(results: Sequence[Result]) -> str:
    """How our methods stand beside the nearest and the quickest peer that is told no geometry, by these numbers."""
    lines = []
    for kind in KINDS:
        rivals = {m: _of(results, m, kind) for m in METHODS if not _ours(m) and "radius" not in m.told}
        rivals = {m: value for m, value in rivals.items() if value is not None}
        mine = {m: value for m in METHODS if _ours(m) and (value := _of(results, m, kind)) is not None}
        if rivals and mine:
            best = min(rivals, key=lambda m: rivals[m])
            ours = ", ".join(f"{_named(m)} {number(value)}" for m, value in mine.items())
            lines.append(f"- **{kind}**: {ours} mm; nearest peer: {_named(best)} {number(rivals[best])} mm.")
    told = ["Median PC average distance on whole frames:", "", *lines, "", _nearer(results), "", _times(results)]
    return "\n".join(told)


WHY = """
PCL and CGAL end with the wall's own equation, PCL with least squares over all its points; the six steps end with
curvatures on a grid of five centimetres, of which exact depths leave that much. `surface` is our fit of the wall. A
refusal counts as a failure here, whoever refuses; ours come with a reason.
"""


def _nearer(results: Sequence[Result]) -> str:
    """Where a peer that is told no geometry beats one of ours, and why."""
    rivals = [m for m in METHODS if not _ours(m) and "radius" not in m.told]
    lines = [
        f"`{_named(mine)}` on {kind}: {', '.join(nearer)}"
        for mine in METHODS
        if _ours(mine)
        for kind in KINDS
        if (nearer := [_named(m) for m in rivals if _beats(results, m, mine, kind)])
    ]
    if not lines:
        return "No peer that is told no geometry is nearer than any of ours on any kind of frame."
    return f"Where peers are nearer: {'; '.join(lines)}. {' '.join(WHY.split())}"


def _beats(results: Sequence[Result], rival: Method, mine: Method, kind: str) -> bool:
    """Whether the rival is nearer in the median; one without an answer is infinitely far."""
    theirs, ours = (_of(results, m, kind) for m in (rival, mine))
    return theirs is not None and (ours is None or theirs < ours)


def _times(results: Sequence[Result]) -> str:
    taken = {m: [f.ms for r in results if r.method is m and r.frame.part == "whole" for f in r.found] for m in METHODS}
    middle = {m: float(np.median(times)) for m, times in taken.items() if times}
    ranked = sorted(middle, key=lambda m: middle[m])
    return "By median time: " + ", ".join(f"{_named(m)} {number(middle[m])} ms" for m in ranked) + "."


def _ours(method: Method) -> bool:
    return method.name.startswith("siloscope")


def _named(method: Method) -> str:
    return method.name if method.told == "nothing" else f"{method.name} ({method.told})"


def _of(results: Sequence[Result], method: Method, kind: str) -> float | None:
    own = [r for r in results if r.method is method and r.frame.part == "whole" and r.frame.kind == kind]
    return _median([value for r in own for value in r.off])


def plot(results: Sequence[Result], path: Path) -> None:
    """Median distance over median time, a panel a kind of frame; numbers stand for methods."""
    from siloscope.reporting.plots.style import INK, figure, heading, png

    made = figure(12.0, 11.0)
    panels = made.subplots(2, 2, sharex=True, sharey=True).ravel()
    for axes, kind in zip(panels, KINDS, strict=True):
        _panel(axes, results, kind)
    names = [f"{place}  {_named(method)}" for place, method in enumerate(METHODS, start=1)]
    made.text(0.01, 0.0, "\n".join(names[:7]), fontsize=9, color=INK, va="bottom")
    made.text(0.51, 0.0, "\n".join(names[7:]), fontsize=9, color=INK, va="bottom")
    made.get_layout_engine().set(rect=(0.0, 0.14, 1.0, 0.86))  # type: ignore[call-arg]
    heading(made, "One frame, one axis: nearer is lower, quicker is to the left (ours in blue)")
    path.write_bytes(png(made, 80))


def _panel(axes: Any, results: Sequence[Result], kind: str) -> None:
    from matplotlib.ticker import StrMethodFormatter

    from siloscope.reporting.plots.style import BLUE, INK, MUTED, tidy

    labels: list[tuple[tuple[float, float], list[int]]] = []
    for place, method in enumerate(METHODS, start=1):
        own = [r for r in results if r.method is method and r.frame.part == "whole" and r.frame.kind == kind]
        distance = _median([value for r in own for value in r.off])
        if distance is not None:
            at = (float(np.median([run.ms for r in own for run in r.found])), max(distance, 1e-3))
            axes.loglog(*at, "o", color=BLUE if _ours(method) else MUTED, markersize=6)
            _label(labels, at, place)
    for at, places in labels:
        names = ", ".join(str(place) for place in places)
        axes.annotate(names, at, xytext=(5, 3), textcoords="offset points", fontsize=9, color=INK)
    tidy(axes, kind, "processor time (ms)", "median PC average distance (mm)")
    for scale in (axes.xaxis, axes.yaxis):
        scale.set_major_formatter(StrMethodFormatter("{x:g}"))


NEAR = (0.12, 0.16)
"""Points within these parts of a decade share a label, or their numbers would lie over each other."""


def _label(labels: list[tuple[tuple[float, float], list[int]]], at: tuple[float, float], place: int) -> None:
    """Adds a method's number to the label of its point or of one next to it."""
    for other, places in labels:
        if all(abs(np.log10(a / b)) < near for a, b, near in zip(at, other, NEAR, strict=True)):
            places.append(place)
            return
    labels.append((at, [place]))


def page(results: Sequence[Result], every: int, repeats: int) -> str:
    """The page."""
    absent = [method for method in METHODS if not method.available()]
    parts = [
        "# Beside other libraries",
        INTRODUCTION.strip(),
        _made(every, repeats),
        f"Not installed, so not in the tables: {', '.join(sorted({m.name for m in absent}))}." if absent else "",
        said(results),
        "![Error over time of every method.](peers/peers.png)",
        table(results, "whole").markdown(),
        table(results, "walls").markdown(),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _made(every: int, repeats: int) -> str:
    frames = len(list(scenes())[::every])
    return "\n".join(
        [
            f"- Made by `{shlex.join(['python', *sys.argv])}` after `benchmarks/peers/install.py`; "
            "`make peers` does both.",
            f"- Frames: {frames} scenes, each as a whole and with its walls alone; {repeats} runs a method, each with "
            "a seed of its own.",
            "- Columns in mm are medians of the PC average distance (Eq. 11) on the whole frame by kind of frame; a "
            f"failure is no answer or more than {1e3 * FAILURE:g} mm. {_exceptions()}",
            "- Times are processor time on one core, from depths in memory to the axis; what is known beforehand "
            "(a registration's target) is not counted.",
            f"- Machine: {machine()}. Versions: siloscope {__version__}, {', '.join(_versions())}.",
        ]
    )


def _exceptions() -> str:
    """Which methods get less."""
    once = sorted({method.name for method in METHODS if method.once})
    slow = sorted({method.name for method in METHODS if method.slow})
    return f"Once a frame, as they take long: {', '.join(once)}; and only every {SLOW}th scene: {', '.join(slow)}."


def _versions() -> list[str]:
    wanted = ("open3d", "pyransac3d", "small_gicp", "numpy")
    found = {d.name.lower().replace("-", "_"): d.version for d in distributions(path=[str(PACKAGES), *sys.path])}
    return [f"{name} {found[name]}" for name in wanted if name in found] + [*_headers()]


def _headers() -> Iterator[str]:
    """Versions of the C++ libraries, from their own headers."""
    for name, pattern, key in (
        ("PCL", "usr/include/pcl-*/pcl/pcl_config.h", "PCL_VERSION_PRETTY"),
        ("CGAL", "usr/include/CGAL/version.h", "CGAL_VERSION "),
    ):
        for path in sorted(Path("/").glob(pattern))[:1]:
            line = next((text for text in path.read_text().splitlines() if f"#define {key}" in text), "")
            yield f"{name} {line.split(key)[-1].strip().strip(chr(34))}"


def main() -> int:
    """Measures and writes."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("docs"), help="where to write peers.md")
    options.add_argument("--every", type=int, default=1, help="take only every so many scenes")
    options.add_argument("--repeats", type=int, default=3, help="runs of each method on each frame")
    asked = options.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    results = list(measured(asked.every, asked.repeats))
    folder = asked.out / "peers"
    folder.mkdir(parents=True, exist_ok=True)
    for part in ("whole", "walls"):
        (folder / f"{part}.csv").write_text(table(results, part).csv())
    plot(results, folder / "peers.png")
    (asked.out / "peers.md").write_text(page(results, asked.every, asked.repeats))
    print(f"read {asked.out / 'peers.md'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
