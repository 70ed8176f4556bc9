"""The three stages as functions of a run and a task: locate a shard's frames, fold a silo, measure a shard.

Nothing else goes in, no clock, no place of this machine, no other task in work: so the bytes that come out are the same
wherever and however often a task is done.
"""

from __future__ import annotations

import hashlib
import resource
import sys
import tempfile
import time
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.calibrate import calibrate
from siloscope.errors import InputError
from siloscope.fleet import plan as plans
from siloscope.fleet.columns import event_row, events_bytes, reading_row, readings_bytes
from siloscope.fleet.measuring import Measured, measured, measurer, refused
from siloscope.fleet.places import open_store
from siloscope.fleet.plan import Plan, calibration_bytes, document_bytes
from siloscope.fleet.reading import SealedShard
from siloscope.fleet.settings import with_files
from siloscope.fleet.store import Missing, Store
from siloscope.fleet.tasks import DAMAGED, Outcome, Task
from siloscope.types.calibration import Calibration, Evidence

COMMIT = "siloscope.commit/1"

_LOCATE = ("sensor", "diameter")
"""Settings that locating takes too."""


class Run:
    """A run as a worker sees it."""

    def __init__(self, place: Store, plan: Plan) -> None:
        self.place, self.plan, self.paths = place, plan, plan.paths
        self.store = open_store(plan.store)

    def calibration(self, task: Task) -> tuple[Calibration, str]:
        """The calibration of a task's series and the SHA-256 of its document."""
        name = (
            self.paths.calibration(task.series)
            if self.plan.folds(task.series)
            else self.paths.given_calibration(task.series)
        )
        return _calibration(self.place, name)


@lru_cache(maxsize=4)
def opened(place: str, run: str) -> Run:
    """The run of a place and id; a worker process keeps it from task to task."""
    store = open_store(place)
    plan = plans.load(store, run)
    plans.check_version(plan)
    return Run(store, plan)


def perform(place: str, run: str, task: Task) -> Outcome:
    """Does a task and commits it; raises `InputError` where it can't be done.

    Its objects are written first and the commit after them, by create-only put: who comes second changes nothing.
    """
    start = time.process_time()
    stage = {"locate": _locate, "fold": _fold, "measure": _measure}[task.kind]
    outcome = stage(opened(place, run), task)
    return replace(outcome, cpu_seconds=time.process_time() - start, peak_bytes=_peak_bytes())


def _peak_bytes() -> int:
    """Largest resident size of this process so far; Linux's `ru_maxrss` would include the process that started it."""
    try:
        status = Path("/proc/self/status").read_text(encoding="ascii")
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    return next(int(line.split()[1]) * 1024 for line in status.splitlines() if line.startswith("VmHWM:"))


def _locate(run: Run, task: Task) -> Outcome:
    """The evidence of a shard: what its frames, evenly spread, say about pose and silo."""
    shard = SealedShard(run.store, task.series, task.number)
    with with_files(run.plan.settings.of(task.series.silo)) as settings:
        told = {name: settings[name] for name in _LOCATE if name in settings}
        frames = [stored.frame for stored in shard.frames(_spread(len(shard), run.plan.settings.located_frames))]
        found = calibrate([frame for frame in frames if frame is not None], **told)
    evidence = calibration_bytes(found)
    _commit(run, task, {run.paths.evidence(task.series, task.number): evidence}, found.counts)
    return Outcome(task, found.counts, shard.bytes_read)


def _spread(count: int, most: int) -> NDArray[np.int64]:
    """At most so many of `count` frames, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))


def _fold(run: Run, task: Task) -> Outcome:
    """The calibration of a series from the evidence of its shards, in their order; those that failed are left out."""
    settings = run.plan.settings.of(task.series.silo)
    found: Calibration | None = None
    for number in _located(run, task):
        shard, _ = _calibration(run.place, run.paths.evidence(task.series, number))
        found = shard if found is None else _fused(_joined(found, shard), settings)
    if found is None:
        raise InputError(f"{task.name}: none of its shards could be located; see the failed ones")
    found = _fused(found, settings)
    name = run.paths.calibration(task.series)
    _commit(run, task, {name: calibration_bytes(found)}, found.counts)
    return Outcome(task)


def _located(run: Run, task: Task) -> list[int]:
    """Numbers of the shards whose evidence is committed."""
    prefix = f"{task.series.name}."
    names = run.place.below(f"{run.paths.commits()}locate/")
    own = (name.removeprefix(prefix).removesuffix(".json") for name in names if name.startswith(prefix))
    return sorted(int(number) for number in own if number.isdecimal())


def _joined(before: Calibration, after: Calibration) -> Calibration:
    """The frames of two calibrations one after the other, not fused yet."""
    first = max((record.index for record in before.frames), default=-1) + 1
    records = (replace(record, index=record.index + first) for record in after.frames)
    factors = ((number + first, factor) for number, factor in after.evidence.frames)
    evidence = Evidence((*before.evidence.frames, *factors), before.evidence.earlier)
    moves = tuple(replace(move, index=move.index + first) for move in after.moves)
    return replace(before, frames=(*before.frames, *records), evidence=evidence, moves=(*before.moves, *moves))


def _fused(found: Calibration, settings: dict[str, Any]) -> Calibration:
    return calibrate((), continue_from=found, bottom=settings.get("bottom"))


def _measure(run: Run, task: Task) -> Outcome:
    """The readings and events of a shard."""
    shard = SealedShard(run.store, task.series, task.number)
    calibration, digest = run.calibration(task)
    if calibration.ok:
        with measurer(calibration, run.plan.settings.of(task.series.silo)) as one:
            found = measured(shard.frames(), one)
    else:
        found = refused(shard.frames(), calibration)
    said = {"siloscope.version": run.plan.version, "siloscope.run": run.plan.run, "siloscope.silo": task.series.silo}
    said["siloscope.calibration"] = digest
    counts = _counts(found)
    if len(found.readings) == counts["unreadable"]:
        raise InputError(f"{task.name}: none of its frames can be read; the first: {found.readings[0].reason}")
    objects = {
        run.paths.result(task.series, task.number): readings_bytes(_rows(task, found), said),
        run.paths.events(task.series, task.number): events_bytes(
            [event_row(task.series, task.number, event) for event in found.events], said
        ),
    }
    if counts["unreadable"]:
        frames = [reading.reason for reading in found.readings if reading.status == "unreadable"]
        run.place.put(task.commit(run.paths, DAMAGED), document_bytes({"shard": task.name, "frames": frames}))
    _commit(run, task, objects, counts)
    return Outcome(task, counts, shard.bytes_read)


def _rows(task: Task, found: Measured) -> list[dict[str, Any]]:
    triples = zip(found.hashes, found.readings, found.contents, strict=True)
    return [reading_row(task.series, task.number, *triple) for triple in triples]


def _counts(found: Measured) -> dict[str, int]:
    return {s: sum(r.status == s for r in found.readings) for s in ("ok", "refused", "unreadable")}


def _commit(run: Run, task: Task, objects: dict[str, bytes], counts: dict[str, int]) -> None:
    for name, data in objects.items():
        run.place.put(name, data)
    told = [{"name": n, "bytes": len(d), "sha256": hashlib.sha256(d).hexdigest()} for n, d in objects.items()]
    document = {"schema": COMMIT, "task": task.kind, "name": task.name, "objects": told, "counts": counts}
    run.place.create(task.commit(run.paths), document_bytes(document))


@lru_cache(maxsize=4)
def _calibration(place: Store, name: str) -> tuple[Calibration, str]:
    """A calibration of a run's place and the SHA-256 of its document."""
    try:
        data = place.get(name)
    except Missing:
        raise InputError(f"{place.place}/{name}: its calibration is missing; plan the run again") from None
    with tempfile.NamedTemporaryFile(suffix=".json", prefix="siloscope-") as file:
        file.write(data)
        file.flush()
        return Calibration.load(Path(file.name)), hashlib.sha256(data).hexdigest()
