"""Runs jobs in parallel processes."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from typing import Any

from siloscope.reproduction.jobs import Job, key
from siloscope.reproduction.store import Store

Progress = Callable[[Iterable[Any], int], Iterable[Any]]
"""Shows how far an iterable of so many finished jobs has come."""


class Results:
    """What jobs gave, by job."""

    def __init__(self, store: Store) -> None:
        self._store = store

    def __getitem__(self, job: Job) -> dict[str, Any]:
        return self._store[key(job)]


def run(jobs: Sequence[Job], store: Store, *, workers: int = 2, progress: Progress | None = None) -> Results:
    """Runs the jobs whose results are not in the store yet, and puts them there as they come.

    Parameters
    ----------
    jobs : sequence of Job
        Work to do; the same job given twice is done once.
    store : Store
        Where finished jobs are kept.
    workers : int
        Processes; with 1 everything runs in this one.
    progress : callable, optional
        Given the iterable of finished jobs and their number.
    """
    missing = {name: job for job in jobs if (name := key(job)) not in store}
    shared = {name: job for name, job in missing.items() if not job.alone}
    alone = {name: job for name, job in missing.items() if job.alone}
    finished = _finished(shared, alone, workers)
    for name, result in progress(finished, len(missing)) if progress else finished:
        store.put(name, result)
    return Results(store)


def _finished(shared: dict[str, Job], alone: dict[str, Job], workers: int) -> Iterator[tuple[str, dict[str, Any]]]:
    if workers > 1 and len(shared) > 1:
        yield from _in_pool(shared, min(workers, len(shared)))
    else:
        yield from ((name, job.run()) for name, job in shared.items())
    yield from ((name, job.run()) for name, job in alone.items())


def _in_pool(jobs: dict[str, Job], workers: int) -> Iterator[tuple[str, dict[str, Any]]]:
    """Spawned, not forked: a fork copies locks that threads hold. An interrupt stops only this process."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, context, initializer=_ignore_interrupts) as pool:
        names: dict[Future[dict[str, Any]], str] = {pool.submit(job.run): name for name, job in jobs.items()}
        try:
            for future in as_completed(names):
                yield names.pop(future), future.result()
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _ignore_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
