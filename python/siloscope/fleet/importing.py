"""A run of the fleet brought into a monitor: its readings count from then on, those before stay and count no more."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

from siloscope.errors import InputError
from siloscope.fleet import results
from siloscope.fleet.naming import Series
from siloscope.fleet.origin import told_of
from siloscope.fleet.places import open_store
from siloscope.fleet.running import Opened
from siloscope.fleet.tables import read
from siloscope.monitor.clock import GOOD, SECOND, SystemClock
from siloscope.monitor.settings import Settings
from siloscope.monitor.store import changes, places, readings, runs
from siloscope.monitor.store.engine import Store, opened
from siloscope.monitor.story import Storyteller
from siloscope.reasons import REMARKS

SCHEMA = "siloscope.import/1"

NAMES = {
    "volume": "volume_m3",
    "volume_std": "volume_std_m3",
    "own_std": "own_std_m3",
    "ullage": "ullage_m3",
    "ullage_std": "ullage_std_m3",
    "fill": "fill_fraction",
    "capacity": "capacity_m3",
    "mass": "mass_kg",
    "mass_std": "mass_std_kg",
    "density": "density_kg_m3",
    "level": "level_m",
    "level_min": "level_min_m",
    "level_max": "level_max_m",
    "level_axis": "level_axis_m",
    "level_std": "level_std_m",
    "coverage": "coverage",
    "status": "status",
    "reason": "reason",
}
"""Columns of a monitor's readings by those of a run's results."""


def into_monitor(run: Opened, data: Path, database: str | None = None) -> dict[str, Any]:
    """Brings in what is committed of a run; the document of ``siloscope fleet publish --monitor``.

    Doing it again changes nothing; bringing an older run in again makes its readings count again.

    Parameters
    ----------
    run : Opened
        The run.
    data : path
        The folder of ``siloscope serve --data``; the service may run meanwhile.
    database : str, optional
        The service's ``--database``.

    Raises
    ------
    InputError
        Where the monitor has no silo or camera of a series' name.
    """
    if not data.is_dir():
        raise InputError(f"{data}: no monitor's data; give the --data folder of `siloscope serve`")
    store = opened(Settings(data, database).url)
    try:
        return _Import(store, run).all()
    finally:
        store.close()


class _Import:
    """One import."""

    def __init__(self, store: Store, run: Opened) -> None:
        self._store, self._run = store, run
        self._now = SystemClock().now()
        self._told = told_of(open_store(run.plan.store))
        self._teller = Storyteller(store)
        self.counts = {"added": 0, "again": 0, "with_frame": 0, "left_out": 0}

    def all(self) -> dict[str, Any]:
        plan = self._run.plan
        homes = {series: self._home(series) for series in self._run.table.series}
        with self._store.write() as connection:
            number = readings.run_of(connection, plan.version, plan.run, runs.FLEET, self._now, f"run {plan.run}")
        begins: dict[str, int] = {}
        for silo in results.silos(self._run):
            for series, shard in results.committed(self._run, silo):
                first = self._bring_in(self._rows(series, shard, number, homes[series]))
                home = homes[series]["silo"]
                begins[home] = min(begins.get(home, first), first)
        for silo, begin in begins.items():
            self._teller.tell(silo, begin, self._now)
        return {"schema": SCHEMA, "run": plan.run, "version": plan.version, "monitor_run": number, **self.counts}

    def _home(self, series: Series) -> dict[str, Any]:
        """Silo, camera and calibration of a series in the monitor."""
        found = self._told.get("series", {}).get(series.name)
        home: dict[str, Any] = found or {"silo": series.silo, "camera": series.camera, "calibration": None}
        with self._store.read() as connection:
            camera = places.get(connection, "camera", home["camera"])
            known = home["calibration"] and places.calibration_get(connection, home["calibration"])
        if camera is None or camera.silo != home["silo"]:
            raise InputError(
                f"{series.name}: the monitor has no camera '{home['camera']}' in a silo '{home['silo']}'; pack frames "
                "with --silo and --camera-id as the monitor names them, or add the camera"
            )
        is_ours = known and not self._run.plan.folds(series)
        return {**home, "calibration": home["calibration"] if is_ours else None}

    def _bring_in(self, rows: list[dict[str, Any]]) -> int:
        """One shard, all or nothing; its first time."""
        if not rows:
            return self._now
        with self._store.write() as connection:
            added = runs.bring_in(connection, rows)
            changes.note(connection, "reading", f"run {rows[0]['run']}", rows[0]["silo"], self._now)
        self.counts["added"] += added
        self.counts["again"] += len(rows) - added
        self.counts["with_frame"] += sum(row["frame"] is not None for row in rows)
        return min(int(row["time"]) for row in rows)

    def _rows(self, series: Series, number: int, run: int, home: dict[str, Any]) -> list[dict[str, Any]]:
        """A shard's readings as the monitor has them; unreadable and undated ones are left out."""
        table = read(self._run.place.get(self._run.plan.paths.result(series, number))).to_pylist()
        told = [row for row in table if row["status"] in ("ok", "refused") and row["captured"] is not None]
        self.counts["left_out"] += len(table) - len(told)
        times = [_micros(row["captured"]) for row in told]
        if not times:
            return []
        with self._store.read() as connection:
            frames = runs.frames_between(connection, home["camera"], min(times), max(times))
        return list(_readings(zip(times, told, strict=True), frames, {**home, "run": run}))


def _readings(rows: Any, frames: dict[int, Any], home: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for time, row in rows:
        frame = frames.get(time)
        yield {
            **{name: row[column] for name, column in NAMES.items()},
            **home,
            **_distances(row),
            "frame": None if frame is None else frame.id,
            "clock": GOOD if frame is None else frame.clock,
            "time": time,
            "quality": [_remark(code, row["status"], row["reason"]) for code in row["quality"] or ()],
        }


def _distances(row: dict[str, Any]) -> dict[str, float | None]:
    """From the camera's height down to the surface, m."""
    heights = {"distance": "level_m", "distance_min": "level_max_m", "distance_max": "level_min_m"}
    datum = row["datum_m"]
    return {name: None if None in (datum, row[h]) else datum - row[h] for name, h in heights.items()}


def _remark(code: str, status: str, reason: str | None) -> dict[str, Any]:
    """A remark of which a run keeps the code alone."""
    meaning, advice = REMARKS.get(code, (code, None))
    severity = "refusal" if status == "refused" and code == reason else "warning"
    return {"code": code, "message": meaning, "severity": severity, "advice": advice}


def _micros(time: datetime) -> int:
    return int(time.timestamp()) * SECOND + time.microsecond
