"""The time of `calibrate` on stored frames, the decoding of the same files beside it, and what its short way changes.

    python benchmarks/calibrate.py [--frames N] [--repeat N] [--scenario NAME]

A silo is emptied from 60 % down before an Astra S; its frames are stored as 16-bit PNG. The runs take turns; all times
are the least of the repeats, as other work on the machine only adds to them. Processor time is that of all threads
together.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image
from rich.console import Console
from rich.table import Table

import siloscope
from siloscope import Estimate, sensors
from siloscope.fusion.schedule import FULL_SEARCH_PERIOD
from siloscope.io import writers
from siloscope.io.images import png
from siloscope.simulation import ASTRA_S, discharge
from siloscope.simulation.scenarios import scenario

SENSOR, UNIT = "orbbec-astra-s", 0.001
HIGHEST = 0.6


class Times(NamedTuple):
    """Milliseconds a frame."""

    clock: float
    processor: float


def main() -> None:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=400)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--scenario", default="silo1")
    options = parser.parse_args()
    console = Console(width=110)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        files = stored(folder, options.scenario, options.frames)
        console.print(times(folder, files, options.repeat))
        console.print(short_way(folder))


def stored(folder: Path, name: str, count: int) -> list[Path]:
    """Writes the frames and their camera."""
    scene = replace(scenario(name), sensor=replace(ASTRA_S, unit=UNIT))
    files = [folder / f"{number:06}.png" for number in range(count)]
    for file, one in zip(files, discharge(scene, count, HIGHEST, 0.0), strict=True):
        writers.write_png(file, one.render(threads=2).raw(UNIT))
    writers.write_camera(scene.camera, folder / "camera.json", UNIT)
    return files


def times(folder: Path, files: Sequence[Path], repeat: int) -> Table:
    """Decoding and calibrating."""
    threads, processes = ThreadPoolExecutor(2), ProcessPoolExecutor(2)
    works: dict[str, Callable[[], object]] = {
        "Pillow decodes, 2 threads": lambda: on_two(threads, decoded, files),
        "Pillow decodes, 2 processes": lambda: on_two(processes, decoded, files),
        "our reader decodes, 2 threads": lambda: on_two(threads, png.read, files),
        "calibrate, 1 job": lambda: siloscope.calibrate(folder, sensor=SENSOR, jobs=1),
        "calibrate, 2 jobs": lambda: siloscope.calibrate(folder, sensor=SENSOR, jobs=2),
        "calibrate, 2 jobs, sensor unknown": lambda: siloscope.calibrate(folder, jobs=2),
    }
    runs: dict[str, list[Times]] = {name: [] for name in works}
    for _ in range(repeat):
        for name, work in works.items():
            runs[name].append(timed(work, len(files)))
    best = {name: Times(*map(min, zip(*taken, strict=True))) for name, taken in runs.items()}
    processes.shutdown()
    pillow = next(iter(best.values()))
    table = Table(title=f"{len(files)} frames, ms a frame", title_justify="left")
    for head in ("", "clock", "processor", "processor, of Pillow's"):
        table.add_column(head, justify="right" if head else "left")
    for name, taken in best.items():
        here = "processes" not in name  # the clock of this process does not see the others'
        shown = (f"{taken.processor:.2f}", f"{taken.processor / pillow.processor:.2f}") if here else ("", "")
        table.add_row(name, f"{taken.clock:.2f}", *shown)
    return table


def decoded(file: Path) -> int:
    """How many pixels there are, so that processes don't send them."""
    return np.asarray(Image.open(file)).size


def on_two(pool: Executor, work: Callable[[Path], object], files: Sequence[Path]) -> None:
    """All files, two at a time."""
    for _ in pool.map(work, files, chunksize=10):
        pass


def timed(work: Callable[[], object], frames: int) -> Times:
    """One run."""
    clock, processor = time.perf_counter(), time.process_time()
    work()
    taken = time.perf_counter() - clock, time.process_time() - processor
    return Times(*(1e3 * value / frames for value in taken))


def short_way(folder: Path) -> Table:
    """Each frame from nothing and from the wall that an earlier frame has shown, as `calibrate` does it."""
    profile = sensors.load(SENSOR)
    alone, led = [], []
    start = None
    with siloscope.open(folder) as source:
        for number, frame in enumerate(source):
            alone.append(siloscope.locate(frame, sensor=profile))
            led.append(siloscope.locate(frame, sensor=profile, start=start, ratios=False))
            if number % FULL_SEARCH_PERIOD == 0 and alone[-1].ok:
                start = alone[-1]
    table = Table(title="from nothing, and from a wall seen before", title_justify="left")
    table.add_column("")
    for head in ("from nothing", "the short way"):
        table.add_column(head, justify="right")
    short = [one for one, other in zip(led, alone, strict=True) if one.ok and one.pose != other.pose]
    searched = [one for one in alone if one.ok]
    for stage in ("patches", "coarse_fit", "known_wall", "pixels", "covariance"):
        cells = [f"{np.median([one.timing_ms.get(stage, 0.0) for one in group]):.2f}" for group in (searched, short)]
        table.add_row(f"{stage}, ms (median)", *cells)
    table.add_row("frames", f"{len(searched)} of {len(alone)}", f"{len(short)} of {len(alone)}")
    same = sum(one.reason == other.reason for one, other in zip(alone, led, strict=True))
    table.add_row("the same reason, or none", "", f"{same} of {len(alone)}")
    gaps = [gap(one, other) for one, other in zip(alone, led, strict=True) if one.ok and other.ok]
    table.add_row("pose differs by, std", "", f"{np.median(gaps):.3f} (median), {max(gaps):.3f} (worst)")
    return table


def gap(one: Estimate, other: Estimate) -> float:
    """Largest difference of two poses in the standard deviations of the first."""
    assert one.covariance is not None
    names = ("r_x", "r_y", "t_x", "t_y")
    steps = np.array([getattr(one.pose, name) - getattr(other.pose, name) for name in names])
    return float(np.max(np.abs(steps) / np.sqrt(np.diag(one.covariance))))


if __name__ == "__main__":
    main()
