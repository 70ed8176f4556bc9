"""`fleet run` and `fleet worker`: a run's lacking tasks on an engine."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from siloscope.errors import UsageError
from siloscope.fleet import plan as plans
from siloscope.fleet.driver import Engine, drive
from siloscope.fleet.places import open_store
from siloscope.fleet.plan import Plan
from siloscope.fleet.progress import Account, Reporter
from siloscope.fleet.schedule import Schedule
from siloscope.fleet.shard_table import ShardTable
from siloscope.fleet.state import State, state
from siloscope.fleet.store import Store

ENGINES = ("local", "ray")

MOST_WORKERS = 4096


@dataclass(frozen=True)
class Opened:
    """A run with its shards and how far it is."""

    place: Store
    plan: Plan
    table: ShardTable
    state: State

    @classmethod
    def of(cls, run: str) -> Opened:
        """What the user names as ``PLACE`` or ``PLACE@ID``; raises `InputError`."""
        where, identity = plans.split(run)
        place = open_store(where)
        plan = plans.load(place, identity)
        table = plans.load_shards(place, plan)
        return cls(place, plan, table, state(place, plan, table))

    def account(self) -> Account:
        """Where a driver begins to count."""
        done, frames = self.state.measured, self.table.frames
        return Account(self.plan.run, len(self.table), int(done.sum()), int(frames.sum()), int(frames[~done].sum()))


def run(
    name: str,
    *,
    engine: str = "local",
    workers: int = 1,
    address: str | None = None,
    part: tuple[int, int] | None = None,
    again: bool = False,
    say: Callable[[Account], None] = lambda _: None,
    metrics: Path | None = None,
) -> tuple[Opened, Account]:
    """Does what a run lacks; the run as it stands then, and this driver's account.

    Parameters
    ----------
    name : str
        ``PLACE`` or ``PLACE@ID``.
    engine : str
        One of `ENGINES`.
    workers : int
        Tasks at a time, one core each.
    address : str, optional
        Of a running Ray cluster.
    part : (int, int), optional
        Index and number of workers that share the tasks without an engine.
    again : bool
        Whether tasks that were given up are tried again.
    say : callable
        Is given the account from time to time.
    metrics : path, optional
        A Prometheus text file that is kept up to date.
    """
    if engine not in ENGINES:
        raise UsageError(f"unknown engine '{engine}'; known are {', '.join(ENGINES)}")
    if not 1 <= workers <= MOST_WORKERS:
        raise UsageError(f"{workers} workers: give 1 to {MOST_WORKERS}")
    if part is not None and not 0 <= part[0] < part[1]:
        raise UsageError(f"--index {part[0]} --of {part[1]}: the index counts from 0 up to one below --of")
    opened = Opened.of(name)
    plans.check_version(opened.plan)
    schedule = Schedule(opened.plan, opened.table, opened.state, part, again)
    account, reporter = opened.account(), Reporter(opened.place, say, metrics)
    first = schedule.next()
    if first is not None:
        schedule.put_back(first)
        began = _engine(engine, opened, workers, address)
        try:
            drive(began, schedule, opened.place, opened.plan, account, reporter)
        finally:
            began.close()
            reporter.tell(account)
    return Opened.of(f"{opened.place.place}@{opened.plan.run}"), account


def _engine(name: str, opened: Opened, workers: int, address: str | None) -> Engine:
    if name == "ray":
        from siloscope.fleet.engines.ray import RayEngine

        return RayEngine(opened.place.place, opened.plan.run, workers, address)
    from siloscope.fleet.engines.local import LocalEngine

    return LocalEngine(opened.place.place, opened.plan.run, workers)
