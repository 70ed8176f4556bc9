"""A plan of a million shards: time and memory to make it, and to take it up again with half of it committed.

    python benchmarks/fleet_plan.py --shards 1000000 --frames 4

The manifest is simulated: so many shards of 500 silos, so many rows each. The commits are empty files in a folder.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

SILOS = 500


def simulate(store: Path, shards: int, frames: int) -> None:
    """Writes a manifest of so many shards with so many frames each."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    from siloscope.fleet.manifest import COLUMNS, SCHEMA
    from siloscope.fleet.tables import ROW_GROUP, WRITER, schema_of

    store.mkdir(parents=True)
    schema = schema_of(COLUMNS, {"siloscope.schema": SCHEMA})
    draw = np.random.default_rng(0)
    step = ROW_GROUP // frames * frames
    with pq.ParquetWriter(store / "manifest.parquet", schema, **WRITER) as writer:
        for start in range(0, shards * frames, step):
            rows = np.arange(start, min(start + step, shards * frames))
            shard = rows // frames
            silo, number = shard * SILOS // shards, shard % (shards // SILOS)
            text = draw.bytes(32 * len(rows)).hex()
            columns = {
                "silo": [f"silo{s:03d}" for s in silo],
                "camera": ["cam"] * len(rows),
                "captured": pa.array(1_700_000_000_000_000 + rows * 600_000_000, pa.timestamp("us", tz="UTC")),
                "seconds": 1.7e9 + rows * 600.0,
                "sha256": [text[64 * k : 64 * k + 64] for k in range(len(rows))],
                "object": [f"silo=silo{s:03d}/camera=cam/depth/c.{n}.0.0" for s, n in zip(silo, number, strict=True)],
                "offset": rows % frames * 320_000,
                "length": np.full(len(rows), 320_000),
                "calibration": pa.nulls(len(rows), pa.string()),
            }
            writer.write_table(pa.table(columns, schema=schema), row_group_size=ROW_GROUP)


def make(store: Path, run: Path) -> None:
    """Makes the plan."""
    from siloscope.fleet import plan
    from siloscope.fleet.settings import settings

    _, shards = plan.make(store, run, None, settings(None))
    print(f"planned {shards} shards")


def commit(run: Path) -> None:
    """Commits the first half of the locating with empty files."""
    from siloscope.fleet import plan
    from siloscope.fleet.places import open_store

    place = open_store(run)
    made = plan.load(place)
    table = plan.load_shards(place, made)
    folder = run / "commits" / made.run / "locate"
    folder.mkdir(parents=True)
    for row in range(len(table) // 2):
        (folder / f"{table.name(row)}.json").touch()


def resume(run: Path) -> None:
    """Takes the run up again: everything until the first task could begin."""
    from siloscope.fleet.running import Opened
    from siloscope.fleet.schedule import Schedule

    opened = Opened.of(str(run))
    task = Schedule(opened.plan, opened.table, opened.state).next()
    print(f"{int(opened.state.located.sum())} of {len(opened.table)} located; next {task}")


def measured(step: str, *arguments: Path) -> None:
    """Runs one step in a process of its own and prints its times and its largest size."""
    start = time.perf_counter()
    subprocess.run([sys.executable, __file__, "--step", step, *map(str, arguments)], check=True)
    print(f"{step}: {time.perf_counter() - start:.1f} s from start to end", flush=True)


def say_usage() -> None:
    """Prints what this process has used."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    print(f"{used.ru_utime + used.ru_stime:.1f} s of CPU, at most {used.ru_maxrss / 1024:.0f} MB")


def main() -> None:
    """Simulates a manifest, makes the plan, commits half, resumes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--shards", type=int, default=1_000_000)
    parser.add_argument("--frames", type=int, default=4, help="frames a shard")
    parser.add_argument("--step", choices=("make", "resume"))
    parser.add_argument("places", nargs="*", type=Path)
    given = parser.parse_args()
    if given.step:
        if given.step == "make":
            make(*given.places)
        else:
            resume(*given.places)
        say_usage()
        return
    with tempfile.TemporaryDirectory() as folder:
        store, run = Path(folder) / "store", Path(folder) / "run"
        simulate(store, given.shards, given.frames)
        print(f"manifest of {(store / 'manifest.parquet').stat().st_size / 1e6:.0f} MB")
        measured("make", store, run)
        commit(run)
        measured("resume", run)


if __name__ == "__main__":
    main()
