"""Which task may begin when: a silo's frames are located, then folded to its calibration, then measured."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np

from siloscope.fleet.plan import Plan
from siloscope.fleet.shard_table import ShardTable
from siloscope.fleet.state import State
from siloscope.fleet.tasks import Task


class Schedule:
    """Hands out the tasks that lack, each once, as soon as what they need is done.

    Parameters
    ----------
    plan, table, state
        The run and what is committed of it.
    part : (int, int), optional
        Index and number of the workers without an engine: only this one's tasks. A silo that is folded is one worker's
        alone, so that nobody waits for anybody; shards of the others are dealt out one by one.
    again : bool
        Whether tasks that were given up are tried again.
    """

    def __init__(
        self, plan: Plan, table: ShardTable, state: State, part: tuple[int, int] | None = None, again: bool = False
    ) -> None:
        self._plan, self._table, self._state = plan, table, state
        self._numbers = {series: number for number, series in enumerate(table.series)}
        self._index, self._of = part or (0, 1)
        self._given_up = set() if again else set(state.failed)
        self._waiting_for: dict[int, int] = {}
        """Shards that are still to be located, by series."""
        self._freed: deque[Iterator[Task]] = deque()
        self._fresh = self._first_tasks()
        self.failed: list[str] = []
        """Names of what was given up in this run."""

    def next(self) -> Task | None:
        """A task that may begin; None where there is none at the moment."""
        while self._freed:
            task = next(self._freed[0], None)
            if task is not None:
                return task
            self._freed.popleft()
        return next(self._fresh, None)

    def put_back(self, task: Task) -> None:
        """Gives a task back that was not begun."""
        self._freed.appendleft(iter((task,)))

    def done(self, task: Task) -> None:
        """Takes note of a committed task, which may let others begin."""
        series = self._series(task)
        if task.kind == "locate":
            self._one_located(series)
        elif task.kind == "fold":
            self._freed.append(self._measuring(series))

    def given_up(self, task: Task) -> list[Task]:
        """Takes note of a task that failed for good; the tasks that fail with it."""
        self.failed.append(task.name)
        if task.kind == "locate":
            self._one_located(self._series(task))
            return []
        return list(self._measuring(self._series(task))) if task.kind == "fold" else []

    def _series(self, task: Task) -> int:
        return self._numbers[task.series]

    def _first_tasks(self) -> Iterator[Task]:
        for number, series in enumerate(self._table.series):
            if not self._plan.folds(series) or self._state.folded[number]:
                yield from self._measuring(number)
            elif number % self._of == self._index:
                yield from self._locating(number)

    def _locating(self, series: int) -> Iterator[Task]:
        """The shards of a series that are not located yet, or at once its fold."""
        rows = self._table.rows_by_series[series]
        tasks = [Task("locate", self._table.series[series], int(self._table.numbers[row])) for row in rows]
        lacking = [
            task
            for task, row in zip(tasks, rows, strict=True)
            if not self._state.located[row] and f"locate/{task.name}" not in self._given_up
        ]
        self._waiting_for[series] = len(lacking)
        if lacking:
            yield from lacking
        else:
            yield from self._folding(series)

    def _one_located(self, series: int) -> None:
        self._waiting_for[series] -= 1
        if not self._waiting_for[series]:
            self._freed.append(self._folding(series))

    def _folding(self, series: int) -> Iterator[Task]:
        task = Task("fold", self._table.series[series])
        if f"fold/{task.name}" not in self._given_up:
            yield task

    def _measuring(self, series: int) -> Iterator[Task]:
        """The shards of a series that are not measured yet."""
        rows, own = self._table.rows_by_series[series], self._table.series[series]
        rows = rows if self._plan.folds(own) else rows[rows % self._of == self._index]
        for row in rows[np.flatnonzero(~self._state.measured[rows])]:
            task = Task("measure", own, int(self._table.numbers[row]))
            if task.name not in self._given_up:
                yield task
