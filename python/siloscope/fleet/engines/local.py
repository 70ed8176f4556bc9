"""Worker processes of this machine, one core each.

Each has a pipe of its own, so when one ends, by a fault or a kill, it is known which task it had; a pool of
`concurrent.futures` would be broken as a whole.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import connection, get_context
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess

from siloscope.errors import SiloscopeError
from siloscope.fleet.tasks import Outcome, Task

ONE_CORE = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS", "BLOSC_NTHREADS")
"""What keeps a worker's libraries to one thread; sums in threads would also be other bits."""


@dataclass
class _Worker:
    process: SpawnProcess
    pipe: Connection
    task: Task | None = None


class LocalEngine:
    """So many worker processes; see `siloscope.fleet.driver.Engine`."""

    def __init__(self, place: str, run: str, workers: int) -> None:
        self._given = place, run
        self._workers = [self._started() for _ in range(workers)]

    def free(self) -> bool:
        """Whether a worker has no task."""
        return any(worker.task is None for worker in self._workers)

    def begin(self, task: Task) -> None:
        """Gives the task to a free worker, or to a new one in the place of one that has ended."""
        for number, worker in enumerate(self._workers):
            if worker.task is not None:
                continue
            try:
                worker.pipe.send(task)
            except OSError:
                worker.pipe.close()
                worker = self._workers[number] = self._started()
                worker.pipe.send(task)
            worker.task = task
            return

    def ended(self, patience: float) -> list[tuple[Task, Outcome | str]]:
        """What the workers have sent; a worker that has ended instead is replaced."""
        found: list[tuple[Task, Outcome | str]] = []
        by_pipe = {worker.pipe: number for number, worker in enumerate(self._workers) if worker.task is not None}
        for pipe in connection.wait(list(by_pipe), patience):
            number = by_pipe[pipe]  # type: ignore[index]
            worker = self._workers[number]
            task, worker.task = worker.task, None
            if task is None:
                continue
            try:
                found.append((task, worker.pipe.recv()))
            except (EOFError, OSError):
                worker.process.join()
                found.append((task, f"its worker process ended with code {worker.process.exitcode}"))
                worker.pipe.close()
                self._workers[number] = self._started()
        return found

    def close(self) -> None:
        """Ends the workers; those with a task are not waited for."""
        for worker in self._workers:
            worker.pipe.close()
            if worker.task is not None:
                worker.process.terminate()
        for worker in self._workers:
            worker.process.join()

    def _started(self) -> _Worker:
        context = get_context("spawn")
        mine, its = context.Pipe()
        process = context.Process(target=work, args=(its, *self._given), daemon=True)
        with one_core():
            process.start()
        its.close()
        return _Worker(process, mine)


def work(pipe: Connection, place: str, run: str) -> None:
    """A worker's life: tasks come in, outcomes or reasons go out, until the driver is gone."""
    from siloscope.fleet.stages import perform

    while True:
        try:
            task = pipe.recv()
        except (EOFError, OSError, KeyboardInterrupt):
            return
        result: Outcome | str
        try:
            result = perform(place, run, task)
        except KeyboardInterrupt:
            return
        except Exception as error:
            result = reason(error)
        try:
            pipe.send(result)
        except OSError:
            return


def reason(error: BaseException) -> str:
    """Why a task failed, in one line."""
    if isinstance(error, SiloscopeError):
        return str(error)
    if isinstance(error, MemoryError):
        return "not enough memory for it"
    return f"unexpected {type(error).__name__}: {' '.join(str(error).split())[:300]}; this is a fault of siloscope"


@contextmanager
def one_core() -> Iterator[None]:
    """Lets processes that are begun in it have one thread a library."""
    before = {name: os.environ.get(name) for name in ONE_CORE}
    os.environ.update(dict.fromkeys(ONE_CORE, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
