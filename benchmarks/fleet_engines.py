"""What Ray costs beside the work: CPU time to start, for a second of waiting, and for a task that does nothing.

    python -m benchmarks.fleet_engines

CPU times of this process and all below it, so that other work on the machine counts little. Two runs, one by each
engine, differ by more than Ray's cost where a machine is busy; this is all of Ray's cost, as if a pool had none.
"""

from __future__ import annotations

import argparse
import os
import time
from typing import Any
from unittest.mock import patch

from benchmarks.fleet_proof import Done, note, tree

SHARD_S = 1.4
"""CPU time of a measured shard of 100 frames; `fleet_cost.py` measures it."""


def nothing(_place: str, _run: str, task: Any) -> Any:
    """A task without work."""
    from siloscope.fleet.tasks import Outcome

    return Outcome(task)


SETTLE_S = 10.0
"""After the first tasks Ray still starts processes."""


class Meter:
    """CPU seconds of all processes below this one, ended ones as they were seen last."""

    def __init__(self) -> None:
        self._cpu: dict[int, float] = {}
        self._done = Done(0.0, 0.0, {})

    def now(self) -> float:
        """So far."""
        for number in tree(os.getpid()):
            note(number, self._cpu, self._done.largest)
        return sum(self._cpu.values())


def tasks(engine: Any, count: int) -> None:
    """Has so many tasks done."""
    from siloscope.fleet.naming import Series
    from siloscope.fleet.tasks import Task

    left, working = [Task("measure", Series("silo", "camera"), number) for number in range(count)], 0
    while left or working:
        while left and engine.free():
            engine.begin(left.pop())
            working += 1
        working -= len(engine.ended(1.0))


def main() -> None:
    """Prints Ray's costs, and from how many shards on they are a twentieth of the work."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tasks", type=int, default=500)
    parser.add_argument("--idle", type=float, default=20.0, metavar="S")
    given = parser.parse_args()
    from siloscope.fleet.engines.ray import RayEngine

    meter = Meter()
    before = meter.now()
    with patch("siloscope.fleet.engines.ray.perform", nothing):
        engine = RayEngine("", "", 2, None)
    tasks(engine, 4)
    time.sleep(SETTLE_S)
    ready = meter.now()
    time.sleep(given.idle)
    waited = meter.now()
    tasks(engine, given.tasks)
    done = meter.now()
    engine.close()
    start, idle, task = ready - before, (waited - ready) / given.idle, (done - waited) / given.tasks
    print(f"start {start:.1f} s, waiting {1e3 * idle:.0f} ms a second, a task {1e3 * task:.2f} ms of CPU")
    a_shard = task + idle * SHARD_S / 2.0
    shards = start / (0.05 * SHARD_S - a_shard)
    print(
        f"a shard of 100 frames at {SHARD_S} s, 2 at a time: {100 * a_shard / SHARD_S:.1f} % more; "
        f"with the start a twentieth from {shards:.0f} shards on"
    )


if __name__ == "__main__":
    main()
