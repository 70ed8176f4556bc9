"""`fleet publish`: moves ``current`` to a run, so that readers see all of it or all of the one before."""

from __future__ import annotations

import json
from typing import Any

from siloscope.errors import InputError, UsageError
from siloscope.fleet.places import open_store
from siloscope.fleet.plan import document_bytes
from siloscope.fleet.running import Opened
from siloscope.fleet.store import Store

SCHEMA = "siloscope.current/1"

CURRENT = "current.json"

ATTEMPTS = 20
"""Times that it is moved anew because another publication was quicker."""


def publish(run: Opened, to: str | None = None, partial: bool = False) -> dict[str, Any]:
    """Makes a run the current one of a place, its own unless `to` names another; the document that is there now.

    Raises
    ------
    UsageError
        For a run that is not complete, unless `partial` allows it.
    InputError
        Where the place can't be written, or others keep moving it.
    """
    check_complete(run, partial)
    place = run.place if to is None else open_store(to)
    for _ in range(ATTEMPTS):
        version = place.version(CURRENT)
        document = _document(run, None if version is None else current(place))
        if place.exchange(CURRENT, version, document_bytes(document)):
            return document
    raise InputError(f"{place.place}/{CURRENT}: others keep moving it; publish again")


def check_complete(run: Opened, partial: bool) -> None:
    """Raises `UsageError` for a run that is not complete, unless `partial` allows it."""
    left = int((~run.state.measured).sum())
    if left and not partial:
        raise UsageError(
            f"{left} of {len(run.table)} shards of run {run.plan.run} lack; do them with `siloscope fleet run`, or "
            "publish what there is with --partial"
        )


def current(place: Store) -> dict[str, Any]:
    """What is published at a place; raises `InputError` where nothing is."""
    return dict(json.loads(place.get(CURRENT)))


def _document(run: Opened, before: dict[str, Any] | None) -> dict[str, Any]:
    previous = None if before is None else before["run"]
    if before is not None and previous == run.plan.run:
        previous = before["previous"]
    return {
        "schema": SCHEMA,
        "run": run.plan.run,
        "version": run.plan.version,
        "results": f"{run.place.place}/results/run={run.plan.run}",
        "events": f"{run.place.place}/events/run={run.plan.run}",
        "shards": int(run.state.measured.sum()),
        "previous": previous,
    }
