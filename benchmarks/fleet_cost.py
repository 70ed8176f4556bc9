"""What a run of the fleet costs: CPU time a frame, beyond the start of the processes, and core-hours for many frames.

    python benchmarks/fleet_cost.py

CPU times of all processes, so other work on the machine counts little. 640 x 480, silos given a calibration, and silos
that are calibrated from their own frames (at most 64 of a shard are located for that).
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

MANY = 100_000_000


def siloscope(*words: str | Path) -> float:
    """CPU seconds of a command and its children."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "siloscope", *map(str, words)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """Prints a table."""
    from fleet import population

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, nargs=2, default=(100, 500), metavar=("FEW", "MORE"))
    few, more = parser.parse_args().frames
    with tempfile.TemporaryDirectory(prefix="siloscope-cost-") as name:
        place = Path(name)
        (archive,) = population.make(place, 1, more, 640)
        siloscope("calibrate", archive, "--sensor", population.SENSOR, "-o", place / "silo00.json")
        spent: dict[tuple[str, int], float] = {}
        for count in (few, more):
            population.make(place / f"{count}", 1, count, 640)
            store = place / f"{count}.store"
            spent["pack", count] = siloscope("pack", place / f"{count}" / archive.name, "-o", store)
            for kind, words in (("given", ("--calibrations", place)), ("folded", ())):
                run = place / f"{count}.{kind}"
                siloscope("fleet", "plan", store, "--out", run, "--sensor", population.SENSOR, *words)
                spent[kind, count] = siloscope("fleet", "run", run, "--workers", "1")
        size = sum(path.stat().st_size for path in (place / f"{more}.store").rglob("c.*")) / more
        print(f"{os.cpu_count()} cores; {more - few} frames beyond the first {few}; {size / 1e3:.0f} kB a packed frame")
        for kind in ("pack", "given", "folded"):
            each = (spent[kind, more] - spent[kind, few]) / (more - few)
            start = spent[kind, few] - few * each
            hours = MANY * each / 3600.0
            cost = f"{1e3 * each:6.2f} ms CPU a frame, {1.0 / each:4.0f} frames/s a core, start {start:4.1f} s"
            print(f"{kind:7} {cost}; 10^8 frames: {hours:,.0f} core-hours")


if __name__ == "__main__":
    main()
