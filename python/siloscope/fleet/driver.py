"""Drives a run: hands tasks to an engine, tries failed ones again, commits what is given up, and keeps the account."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Protocol

from siloscope.fleet.plan import Plan, document_bytes
from siloscope.fleet.progress import Account
from siloscope.fleet.schedule import Schedule
from siloscope.fleet.store import Store
from siloscope.fleet.tasks import FAILED, Outcome, Task

ATTEMPTS = 3
"""Times that a task is begun before it is given up."""

PATIENCE = 1.0
"""Seconds after which the account is looked at although no task has ended."""


class Engine(Protocol):
    """Does tasks somewhere, several at a time."""

    def free(self) -> bool:
        """Whether it takes another task."""

    def begin(self, task: Task) -> None:
        """Begins a task."""

    def ended(self, patience: float) -> list[tuple[Task, Outcome | str]]:
        """The tasks that have ended since, each with what it did or why it failed; waits so many seconds for one."""

    def close(self) -> None:
        """Ends every process that it began."""


def drive(
    engine: Engine, schedule: Schedule, place: Store, plan: Plan, account: Account, told: Callable[[Account], None]
) -> None:
    """Does every task of a schedule; `told` is given the account from time to time.

    A task counts when it is committed, whoever does it; so a driver that ends in between loses the tasks in work alone.
    """
    attempts: Counter[Task] = Counter()
    again: list[Task] = []
    working = 0
    while True:
        while engine.free() and (task := again.pop() if again else schedule.next()) is not None:
            attempts[task] += 1
            engine.begin(task)
            working += 1
        if not working:
            break
        for task, result in engine.ended(PATIENCE):
            working -= 1
            if isinstance(result, Outcome):
                account.add(result)
                schedule.done(task)
                del attempts[task]
            elif attempts[task] < ATTEMPTS:
                again.append(task)
            else:
                _give_up(schedule, place, plan, account, task, result)
        told(account)


def _give_up(schedule: Schedule, place: Store, plan: Plan, account: Account, task: Task, why: str) -> None:
    """Commits a task as failed, and the tasks that can't be done without it."""
    for lost in (task, *schedule.given_up(task)):
        reason = why if lost == task else f"{task.name} failed"
        document = {"task": lost.kind, "name": lost.name, "attempts": ATTEMPTS, "reason": reason}
        place.create(lost.commit(plan.paths, FAILED), document_bytes(document))
        account.failed[lost.name] = reason
