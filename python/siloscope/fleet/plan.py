"""The plan of a run: its id, everything that decides its answers, and the shards there are."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from siloscope.errors import InputError, UsageError
from siloscope.fleet import shard_table
from siloscope.fleet.naming import RunPaths, Series
from siloscope.fleet.origin import told_of
from siloscope.fleet.places import open_store
from siloscope.fleet.settings import Settings
from siloscope.fleet.shard_table import ShardTable
from siloscope.fleet.store import Missing, Store
from siloscope.schema import documents
from siloscope.types.calibration import Calibration

SCHEMA = "siloscope.plan/1"

LATEST = "plan.json"
"""Names the run that was planned last in a place."""

ID_LENGTH = 16


@dataclass(frozen=True)
class Plan:
    """A run, without its shards."""

    run: str
    version: str
    """Of siloscope."""
    store: str
    """Where the sealed frames lie."""
    settings: Settings
    calibrations: dict[str, str]
    """SHA-256 of the calibration of every series that has one; the others' frames are located and folded."""

    @property
    def paths(self) -> RunPaths:
        """Where its objects lie."""
        return RunPaths(self.run)

    def folds(self, series: Series) -> bool:
        """Whether the series' calibration comes from its own frames."""
        return series.name not in self.calibrations

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        known = {"schema": SCHEMA, "run": self.run, "version": self.version, "store": self.store}
        return {**known, "settings": self.settings.to_dict(), "calibrations": self.calibrations}


def make(store_place: str | Path, out: str | Path, calibrations: Path | None, settings: Settings) -> tuple[Plan, int]:
    """Plans a run, or puts into its plan what has been sealed since; the plan and its number of shards.

    Parameters
    ----------
    store_place : path or URL
        A store that `siloscope.fleet.pack.pack` has made.
    out : path or URL
        The run's place; it may have several runs.
    calibrations : path, optional
        A folder with ``<silo>.json``, or ``<silo>.<camera>.json``. They win over those that were packed with frames.
    settings : Settings
        What to measure with; wins over what a monitor's frames were packed with.
    """
    store, place = open_store(store_place), open_store(out)
    table = shard_table.scan(store)
    texts = _calibrations(store, table, calibrations)
    hashes = {name: hashlib.sha256(text).hexdigest() for name, text in sorted(texts.items())}
    packed = told_of(store).get("settings", {})
    plan = Plan("", _version(), store.place, settings.over(packed), hashes)
    plan = replace(plan, run=_id(plan))
    for series in table.series:
        if series.name in texts:
            place.create(plan.paths.given_calibration(series), texts[series.name])
    place.put(plan.paths.shards(), table.to_bytes())
    place.put(plan.paths.plan(), document_bytes(plan.to_dict()))
    place.put(LATEST, document_bytes({"schema": SCHEMA, "run": plan.run}))
    return plan, len(table)


def split(place: str) -> tuple[str, str | None]:
    """A run as the user names it, ``PLACE`` or ``PLACE@ID``, as its place and id."""
    head, at, tail = place.rpartition("@")
    named = bool(at) and len(tail) == ID_LENGTH and set(tail) <= set("0123456789abcdef")
    return (head, tail) if named else (place, None)


def load(place: Store, run: str | None = None) -> Plan:
    """The plan of a run, the latest of its place unless an id is given; raises `InputError`."""
    try:
        wanted = run or json.loads(place.get(LATEST))["run"]
        told = json.loads(place.get(RunPaths(wanted).plan()))
        settings = Settings.from_dict(told["settings"])
        return Plan(told["run"], told["version"], told["store"], settings, told["calibrations"])
    except Missing:
        raise InputError(f"{place.place}: no such run is planned there; make one with `siloscope fleet plan`") from None
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{place.place}: its plan is damaged ({error}); plan it again") from None


def load_shards(place: Store, plan: Plan) -> ShardTable:
    """The shards of a plan."""
    return ShardTable.from_bytes(place.get(plan.paths.shards()))


def check_version(plan: Plan) -> None:
    """Raises `UsageError` where another version of siloscope made the plan: its answers are named by that one."""
    if plan.version != _version():
        raise UsageError(
            f"run {plan.run} was planned by siloscope {plan.version}, this is {_version()}; plan it anew, and compare "
            "the two with `siloscope fleet diff`"
        )


def document_bytes(document: Any) -> bytes:
    """A document as it is written: the same bytes for the same content."""
    return (json.dumps(documents.plain(document), sort_keys=True, separators=(",", ":")) + "\n").encode()


def _id(plan: Plan) -> str:
    """Hash of everything that decides the answers, but not of the frames: more of them go on with the same run."""
    deciding = {"version": plan.version, "settings": plan.settings.to_dict(), "calibrations": plan.calibrations}
    return hashlib.sha256(document_bytes(deciding)).hexdigest()[:ID_LENGTH]


def _version() -> str:
    from siloscope import _core

    return _core.__version__


def _calibrations(store: Store, table: ShardTable, folder: Path | None) -> dict[str, bytes]:
    """The document of every series that has a calibration, without what it took to make it."""
    if folder is not None and not folder.is_dir():
        raise UsageError(f"{folder}: no folder; give one with SILO.json for every silo, or leave --calibrations out")
    found: dict[str, bytes] = {}
    for series in table.series:
        own = [] if folder is None else [folder / f"{series.name}.json", folder / f"{series.silo}.json"]
        path = next((path for path in own if path.is_file()), None)
        if path is not None:
            found[series.name] = calibration_bytes(Calibration.load(path))
        elif (packed := table.packed.get(series)) is not None:
            found[series.name] = store.get(packed)
    return found


def calibration_bytes(calibration: Calibration) -> bytes:
    """A calibration's document, the same for the same calibration."""
    return document_bytes(calibration.to_dict() | {"timing_ms": {}})
