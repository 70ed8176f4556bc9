"""The readings of a run as tables: those of committed shards, silo by silo."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from siloscope.fleet.extras import arrow
from siloscope.fleet.naming import Series
from siloscope.fleet.running import Opened
from siloscope.fleet.tables import read


def silos(run: Opened) -> list[str]:
    """The silos of a run."""
    return sorted({series.silo for series in run.table.series})


def readings(run: Opened, silo: str) -> Any | None:
    """All readings of a silo as an Arrow table; None where nothing of it is committed."""
    tables = [read(run.place.get(run.plan.paths.result(series, number))) for series, number in committed(run, silo)]
    return arrow().concat_tables(tables) if tables else None


def committed(run: Opened, silo: str) -> Iterator[tuple[Series, int]]:
    """The measured shards of a silo."""
    for series, rows in zip(run.table.series, run.table.rows_by_series, strict=True):
        if series.silo == silo:
            yield from ((series, int(run.table.numbers[row])) for row in rows if run.state.measured[row])


def calibration(run: Opened, series: Series) -> dict[str, Any] | None:
    """The calibration document that a series was measured with; None where there is none yet."""
    paths = run.plan.paths
    name = paths.calibration(series) if run.plan.folds(series) else paths.given_calibration(series)
    return None if run.place.size(name) is None else dict(json.loads(run.place.get(name)))
