"""Ray Core: tasks of one core each in a sliding window; no frames go through Ray's object store."""

from __future__ import annotations

import os
from typing import Any

from siloscope.errors import InputError
from siloscope.fleet.engines.local import ONE_CORE, one_core, reason
from siloscope.fleet.stages import perform
from siloscope.fleet.tasks import Outcome, Task
from siloscope.io.extras import need

OBJECT_STORE = 80 << 20
"""Bytes of Ray's object store, about the least that it takes: only tasks and outcomes go through it."""

WINDOW = 2
"""Tasks that are handed to Ray for every core, so that none waits for the driver."""


class RayEngine:
    """A Ray of this machine with so many cores, or a running cluster; see `siloscope.fleet.driver.Engine`."""

    def __init__(self, place: str, run: str, workers: int, address: str | None) -> None:
        self._ray = need("ray", "ray", "the engine 'ray'")
        quiet = {"include_dashboard": False, "object_store_memory": OBJECT_STORE}
        how: dict[str, Any] = {"num_cpus": workers, **quiet} if address is None else {}
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # it would send figures to Ray's makers
        try:
            with one_core():
                self._ray.init(address or "local", log_to_driver=False, logging_level="error", **how)
        except (ConnectionError, RuntimeError, ValueError) as error:
            raise InputError(f"Ray can't be reached ({' '.join(str(error).split())[:200]}); check --address") from None
        alone = {} if address is None else {"runtime_env": {"env_vars": dict.fromkeys(ONE_CORE, "1")}}
        self._perform = self._ray.remote(num_cpus=1, max_retries=0, **alone)(perform)
        ended = ("WorkerCrashedError", "OutOfMemoryError", "NodeDiedError", "TaskUnschedulableError")
        self._of_a_task = tuple(getattr(self._ray.exceptions, name) for name in ended)
        """Errors of one task or one node of a cluster; any other means that there is no Ray any more."""
        self._given = place, run
        self._window = WINDOW * workers
        self._working: dict[Any, Task] = {}

    def free(self) -> bool:
        """Whether the window has room."""
        return len(self._working) < self._window

    def begin(self, task: Task) -> None:
        """Hands a task to Ray."""
        self._working[self._perform.remote(*self._given, task)] = task

    def ended(self, patience: float) -> list[tuple[Task, Outcome | str]]:
        """The tasks that Ray has ended."""
        ready, _ = self._ray.wait(list(self._working), num_returns=1, timeout=patience)
        return [(self._working.pop(handle), self._result(handle)) for handle in ready]

    def close(self) -> None:
        """Leaves the cluster, or ends the Ray of this machine."""
        self._ray.shutdown()

    def _result(self, handle: Any) -> Outcome | str:
        try:
            found: Outcome = self._ray.get(handle)
        except self._ray.exceptions.RayTaskError as error:
            return reason(error.cause)
        except self._of_a_task as error:
            return f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
        except self._ray.exceptions.RayError as error:
            raise InputError(
                f"Ray has ended ({type(error).__name__}); start the run again, what is committed is not done again"
            ) from None
        return found
