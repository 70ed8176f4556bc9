"""Running time on the last frame of a discharge (section 3.5)."""

from __future__ import annotations

import os
import platform
import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

from siloscope.reproduction.solvers import ALL, SOLVERS
from siloscope.sensors import SensorProfile
from siloscope.simulation import Scene

REPEATS = 7
"""Runs of which the median is taken, after one that does not count."""


@dataclass(frozen=True)
class Timing:
    """How long each method takes on a scene's frame, on one thread."""

    scene: Scene
    profile: SensorProfile
    repeats: int = REPEATS
    alone = True

    def settings(self) -> dict[str, Any]:
        """Everything the result depends on; the machine is part of it."""
        return {
            "scene": self.scene.to_dict(),
            "profile": asdict(self.profile),
            "machine": machine(),
            "repeats": self.repeats,
        }

    def run(self) -> dict[str, Any]:
        """Median seconds of each method."""
        frame = self.scene.render()
        return {name: self._seconds(partial(SOLVERS[name], frame, self.profile)) for name in ALL}

    def _seconds(self, work: Callable[[], object]) -> float:
        work()
        return statistics.median(_timed(work) for _ in range(self.repeats))


def _timed(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def machine() -> str:
    """Processor and number of cores, as far as the system tells."""
    return f"{_processor()}, {os.cpu_count()} cores, {platform.system()}"


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            names = [line.split(":", 1)[1].strip() for line in file if line.startswith("model name")]
    except OSError:
        names = []
    return names[0] if names else platform.machine()
