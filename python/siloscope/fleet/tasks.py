"""What a run consists of: tasks, and what each of them has done."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from siloscope.fleet.naming import RunPaths, Series

Kind = Literal["locate", "fold", "measure"]


@dataclass(frozen=True)
class Task:
    """One step for one shard, or for a whole series (`fold`)."""

    kind: Kind
    series: Series
    number: int = -1
    """Of the shard."""

    @property
    def name(self) -> str:
        """The shard's name, or the series'."""
        return self.series.name if self.number < 0 else self.series.shard(self.number)

    def commit(self, paths: RunPaths, ending: str = "") -> str:
        """The object whose presence says that it is done; with an ending, what is remarked of it."""
        folder = "" if self.kind == "measure" else f"{self.kind}/"
        return f"{paths.commits()}{folder}{self.name}{ending}.json"


FAILED = ".failed"
"""Ending of what says that a task was given up after `siloscope.fleet.driver.ATTEMPTS`."""

DAMAGED = ".damaged"
"""Ending of what says that frames of a measured shard can't be read."""


@dataclass(frozen=True)
class Outcome:
    """A task that is committed."""

    task: Task
    counts: dict[str, int] = field(default_factory=dict)
    """Frames by status."""
    bytes_read: int = 0
    cpu_seconds: float = 0.0
    peak_bytes: int = 0
    """Largest resident size of the process so far."""
