"""`fleet status`: how far a run is, what failed and why, and what it has cost."""

from __future__ import annotations

import json
from typing import Any

from siloscope.fleet.progress import costs
from siloscope.fleet.running import Opened
from siloscope.fleet.tasks import DAMAGED, FAILED

SCHEMA = "siloscope.fleet-status/1"


def status(run: Opened) -> dict[str, Any]:
    """The document of ``siloscope fleet status --json``.

    ``failed`` names shards that were given up (and silos, by ``silo.camera``, that could not be folded), ``damaged``
    those that were measured but for some frames.
    """
    done, frames = run.state.measured, run.table.frames
    folding = [run.plan.folds(series) for series in run.table.series]
    failed = [_failure(run, name) for name in sorted(run.state.failed)]
    left = int((~done).sum())
    return {
        "schema": SCHEMA,
        "run": run.plan.run,
        "version": run.plan.version,
        "store": run.plan.store,
        "place": run.place.place,
        "complete": left == 0,
        "shards": {"total": len(run.table), "done": int(done.sum()), "left": left},
        "frames": {"total": int(frames.sum()), "done": int(frames[done].sum()), "left": int(frames[~done].sum())},
        "silos": {
            "total": len(run.table.series),
            "given": len(folding) - sum(folding),
            "to_fold": sum(folding),
            "folded": int(run.state.folded.sum()),
        },
        "failed": failed,
        "damaged": [_damage(run, name) for name in sorted(run.state.damaged)],
        **costs(run.place, run.plan.run),
    }


def _failure(run: Opened, name: str) -> dict[str, Any]:
    told = json.loads(run.place.get(f"{run.plan.paths.commits()}{name}{FAILED}.json"))
    return {"shard": told["name"], "stage": told["task"], "reason": told["reason"]}


def _damage(run: Opened, name: str) -> dict[str, Any]:
    told = json.loads(run.place.get(f"{run.plan.paths.commits()}{name}{DAMAGED}.json"))
    return {"shard": told["shard"], "frames": told["frames"]}


def is_flawed(document: dict[str, Any]) -> bool:
    """Whether a run has failed shards or frames that can't be read: exit code 5."""
    return bool(document["failed"] or document["damaged"])
