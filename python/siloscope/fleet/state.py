"""How far a run is, by the names of its commits alone: no commit is opened, so a million are known in seconds."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from siloscope.fleet.naming import RunPaths
from siloscope.fleet.plan import Plan
from siloscope.fleet.shard_table import ShardTable
from siloscope.fleet.store import Store
from siloscope.fleet.tasks import DAMAGED, FAILED


@dataclass(frozen=True, eq=False)
class State:
    """What is committed of a plan; arrays go by the plan's rows, and by its series."""

    located: NDArray[np.bool_]
    measured: NDArray[np.bool_]
    folded: NDArray[np.bool_]
    failed: set[str] = field(default_factory=set)
    """Names of tasks' commits that were given up, without their ending, as ``locate/silo7.cam.000003``."""
    damaged: set[str] = field(default_factory=set)
    """Names of measured shards some frames of which can't be read."""


def state(place: Store, plan: Plan, table: ShardTable) -> State:
    """The state of a run."""
    shards, series = len(table), len(table.series)
    found = State(np.zeros(shards, bool), np.zeros(shards, bool), np.zeros(series, bool))
    rows = _Rows(table)
    prefix = len(RunPaths(plan.run).commits())
    for commit in place.names(plan.paths.commits()):
        name = commit[prefix:].removesuffix(".json")
        folder, _, base = name.rpartition("/")
        if base.endswith(FAILED):
            found.failed.add(name.removesuffix(FAILED))
        elif base.endswith(DAMAGED):
            found.damaged.add(base.removesuffix(DAMAGED))
        elif folder == "fold":
            if (number := rows.series.get(base)) is not None:
                found.folded[number] = True
        elif (row := rows.of(base)) is not None:
            (found.located if folder == "locate" else found.measured)[row] = True
    found.failed.difference_update(_done(found, table))
    return found


def _done(found: State, table: ShardTable) -> list[str]:
    """Of the tasks that failed once, those that were done later."""
    rows = _Rows(table)
    by_kind = {"": found.measured, "locate": found.located}
    done = []
    for name in found.failed:
        folder, _, base = name.rpartition("/")
        row = rows.series.get(base) if folder == "fold" else rows.of(base)
        if row is not None and by_kind.get(folder, found.folded)[row]:
            done.append(name)
    return done


class _Rows:
    """The plan's row of a shard's name."""

    def __init__(self, table: ShardTable) -> None:
        self.series = {series.name: number for number, series in enumerate(table.series)}
        self.firsts = [int(rows[0]) for rows in table.rows_by_series]
        self.numbers = [table.numbers[rows] for rows in table.rows_by_series]
        self.dense = [bool(len(n)) and int(n[-1]) == len(n) - 1 for n in self.numbers]

    def of(self, name: str) -> int | None:
        """None for a name that is not in the plan."""
        series_name, _, text = name.rpartition(".")
        series = self.series.get(series_name)
        if series is None or not text.isdecimal():
            return None
        number, known = int(text), self.numbers[series]
        place = number if self.dense[series] else int(np.searchsorted(known, number))
        inside = place < len(known) and int(known[place]) == number
        return self.firsts[series] + place if inside else None
