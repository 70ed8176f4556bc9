"""Proves a fleet's run on 2,000 frames of 20 archives: equal bytes, kills, Ray's overhead, frames a second, memory.

    python benchmarks/fleet_proof.py --folder /tmp/proof

Times are CPU times of all processes of a run, so other work on the machine counts little. Frames a second are those
that two cores would do: 2 / (CPU seconds a frame).
"""

from __future__ import annotations

import argparse
import hashlib
import os
import random
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

TICK = os.sysconf("SC_CLK_TCK")


@dataclass
class Done:
    """What a run's processes have used."""

    seconds: float
    cpu: float
    largest: dict[str, int]
    """Largest proportional set size by kind of process, bytes."""


def tree(process: int) -> list[int]:
    """A process and all below it."""
    try:
        below = (Path("/proc") / str(process) / "task" / str(process) / "children").read_text().split()
    except OSError:
        return []
    return [process, *(found for child in below for found in tree(int(child)))]


def follow(command: list[str], kill: str | None = None, after: int = 0, run: Path | None = None) -> Done:
    """Runs a command and watches its processes; kills the first of a kind once so many commits are there."""
    start = time.perf_counter()
    started = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True)
    cpu: dict[int, float] = {}
    largest: dict[str, int] = {}
    known: set[int] = set()
    while started.poll() is None:
        for number in tree(started.pid):
            known.add(number)
            note(number, cpu, largest)
        if kill is not None and run is not None and len(list(run.glob("commits/*/*.json"))) >= after:
            victim = [n for n in tree(started.pid) if kind(n) == kill]
            if victim:
                os.kill(random.choice(victim), signal.SIGKILL)
                kill = None
        time.sleep(0.1)
    for number in known:  # what a killed driver has left behind
        try:
            os.kill(number, signal.SIGKILL)
        except OSError:
            continue
    return Done(time.perf_counter() - start, sum(cpu.values()), largest)


def note(number: int, cpu: dict[int, float], largest: dict[str, int]) -> None:
    """Takes a process' CPU time and size down."""
    try:
        fields = (Path("/proc") / str(number) / "stat").read_text().rpartition(")")[2].split()
        cpu[number] = (int(fields[11]) + int(fields[12])) / TICK
        for line in (Path("/proc") / str(number) / "smaps_rollup").read_text().splitlines():
            if line.startswith("Pss:"):
                name = kind(number)
                largest[name] = max(largest.get(name, 0), 1024 * int(line.split()[1]))
    except (OSError, IndexError):
        return


def kind(number: int) -> str:
    """What a process is."""
    try:
        line = (Path("/proc") / str(number) / "cmdline").read_text().replace("\0", " ")
    except OSError:
        return "gone"
    if "spawn_main" in line or line.startswith("ray::"):
        return "worker"
    if "/raylet/raylet " in line:
        return "raylet"
    return "driver" if "siloscope fleet" in line else "other"


def answers(run: Path) -> str:
    """One hash over every byte that has to be the same."""
    digest = hashlib.sha256()
    for name in ("results", "events", "calibrations", "evidence", "commits"):
        for path in sorted((run / name).rglob("*")):
            if path.is_file() and not path.name.startswith("."):
                digest.update(str(path.relative_to(run)).encode() + path.read_bytes())
    return digest.hexdigest()


def main() -> None:
    """Makes the population, then every run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--archives", type=int, default=20)
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--kills", type=int, default=3, help="of each kind of process")
    given = parser.parse_args()
    prove(Proof(given.folder, given.archives, given.frames), given.kills)


@dataclass
class Proof:
    """A population, sealed, with the silos' calibrations."""

    folder: Path
    archives: int
    frames: int

    def __post_init__(self) -> None:
        import siloscope
        from fleet import population
        from siloscope.fleet.pack import pack

        paths = population.make(self.folder / "archives", self.archives, self.frames, 640)
        pack(paths, self.folder / "store", shard_frames=100)
        (self.folder / "calibrations").mkdir(exist_ok=True)
        for path in paths:
            target = self.folder / "calibrations" / f"{path.stem}.json"
            if not target.exists():
                siloscope.calibrate(path, sensor=population.SENSOR, jobs=2).save(target)

    def planned(self, name: str, fold: bool = False) -> Path:
        """A new run in a folder of a name."""
        import shutil

        from fleet import population
        from siloscope.fleet import plan
        from siloscope.fleet.settings import settings

        run = self.folder / name
        shutil.rmtree(run, ignore_errors=True)
        known = None if fold else self.folder / "calibrations"
        told = settings(None, sensor=population.SENSOR, bottom="cone", product="wheat")
        plan.make(self.folder / "store", run, known, told)
        return run

    def run(self, run: Path, *options: str, kill: str | None = None, after: int = 0) -> Done:
        """Does a run in a process of its own."""
        verb = "worker" if "--index" in options else "run"
        command = [sys.executable, "-m", "siloscope", "fleet", verb, str(run), *options]
        return follow(command, kill, after, run)


LOCAL = ("--engine", "local", "--workers")
RAY = ("--engine", "ray", "--workers", "2")


def prove(proof: Proof, kills: int) -> None:
    """Prints what each run used, and stops at the first bytes that differ."""
    count = proof.archives * proof.frames
    one = proof.planned("local1")
    told("local, 1 worker", proof.run(one, *LOCAL, "1"), count)
    expected = answers(one)
    for name, options in (("local2", (*LOCAL, "2")), ("ray", RAY), ("local2b", (*LOCAL, "2")), ("rayb", RAY)):
        run = proof.planned(name)
        told(name, proof.run(run, *options), count)
        same(name, run, expected)
    run = proof.planned("indexed")
    for index in ("1", "0"):
        told(f"indexed worker {index} of 2", proof.run(run, "--index", index, "--of", "2"), count // 2)
    same("indexed", run, expected)
    for number in range(kills):
        for engine, kind in ((LOCAL, "worker"), (LOCAL, "driver"), (RAY, "worker"), (RAY, "raylet"), (RAY, "driver")):
            killed(proof, engine, kind, number, expected)
    fold = proof.planned("folded", fold=True)
    told("local, 2 workers, every silo calibrated from its frames", proof.run(fold, *LOCAL, "2"), count)


def killed(proof: Proof, engine: tuple[str, ...], kind: str, number: int, expected: str) -> None:
    """Kills a process of a kind at a random moment and goes on."""
    run = proof.planned("killed")
    options = engine if engine[-1] == "2" else (*engine, "2")
    proof.run(run, *options, kill=kind, after=random.randrange(1, proof.archives))
    before = {path: path.stat().st_mtime_ns for path in run.glob("results/*/*/*.parquet") if committed(run, path)}
    proof.run(run, *LOCAL, "2")
    again = [path for path, stamp in before.items() if path.stat().st_mtime_ns != stamp]
    name = f"{engine[1]}, {kind} killed, time {number + 1}: {len(before)} of {proof.archives} shards were committed"
    print(f"{name}, {len(again)} of them done again")
    same(name, run, expected)


def committed(run: Path, result: Path) -> bool:
    """Whether a result's shard is committed."""
    return bool(list(run.glob(f"commits/*/{result.stem}.json")))


def told(name: str, done: Done, frames: int) -> None:
    """Prints what a run used."""
    ms = 1e3 * done.cpu / frames
    sizes = ", ".join(f"{kind} {size / 1e6:.0f} MB" for kind, size in sorted(done.largest.items()) if kind != "other")
    print(
        f"{name}: {done.seconds:.1f} s, {done.cpu:.1f} s of CPU, {ms:.2f} ms a frame, {2e3 / ms:.0f} frames/s; {sizes}"
    )


def same(name: str, run: Path, expected: str) -> None:
    """Stops where a run's bytes differ."""
    if answers(run) != expected:
        sys.exit(f"{name}: its bytes differ from those of one local worker")


if __name__ == "__main__":
    main()
