"""Runs: what measured readings, and readings that a run of elsewhere brings in. Older ones stay, and count no more."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import ColumnElement, Connection, func, insert, select, update

from siloscope.monitor.store.rows import Record
from siloscope.monitor.store.schema import frame, reading, run

FLEET = "fleet"
"""Origin of a run that was imported."""


def of_silo(connection: Connection, silo: str) -> list[dict[str, Any]]:
    """The runs that a silo has readings of, the newest first, each with how many count and how many are replaced."""
    counts: dict[int, dict[str, Any]] = {}
    for name, condition in (
        ("current", reading.c.superseded.is_(None)),
        ("replaced", reading.c.superseded.is_not(None)),
    ):
        columns = (reading.c.run, func.count().label("number"), func.min(reading.c.time), func.max(reading.c.time))
        wanted = select(*columns).where(reading.c.silo == silo, condition).group_by(reading.c.run)
        for key, number, first, last in connection.execute(wanted):
            known = counts.setdefault(key, {"current": 0, "replaced": 0, "first": first, "last": last})
            known |= {name: number, "first": min(known["first"], first), "last": max(known["last"], last)}
    rows = connection.execute(select(run).where(run.c.id.in_(counts)).order_by(run.c.id.desc()))
    return [{**row._mapping, **counts[row.id]} for row in rows]


def frames_between(connection: Connection, camera: str, first: int, last: int) -> dict[int, Record]:
    """A camera's frames of a stretch, both ends included, by their times: id and clock."""
    wanted = select(frame.c.id, frame.c.captured, frame.c.clock)
    chosen = [frame.c.camera == camera, frame.c.captured.between(first, last)]
    return {row.captured: row for row in connection.execute(wanted.where(*chosen))}


def bring_in(connection: Connection, rows: Sequence[dict[str, Any]]) -> int:
    """Adds readings of a run, or makes those of it that are there count again; how many were added."""
    return sum(_bring_in(connection, row) for row in rows)


def _bring_in(connection: Connection, row: dict[str, Any]) -> bool:
    same = _same(row)
    there = select(reading.c.id).where(*same, reading.c.run == row["run"]).limit(1)
    number = connection.execute(there).scalar()
    added = number is None
    if added:
        number = connection.execute(insert(reading).values(**row).returning(reading.c.id)).scalar_one()
    else:
        connection.execute(update(reading).where(reading.c.id == number).values(superseded=None))
    older = [*same, reading.c.id != number, reading.c.superseded.is_(None)]
    connection.execute(update(reading).where(*older).values(superseded=number))
    return added


def _same(row: dict[str, Any]) -> list[ColumnElement[bool]]:
    """Conditions of the readings of the same frame; of one that is not known here, those of its camera and moment."""
    if row["frame"] is not None:
        return [reading.c.frame == row["frame"]]
    return [reading.c.silo == row["silo"], reading.c.camera == row["camera"], reading.c.time == row["time"]]
