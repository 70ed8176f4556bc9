"""A whole database as a file, from a file, and from one database to another."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Table, func, insert, select, text
from sqlalchemy.exc import DatabaseError

from siloscope.errors import InputError, UsageError
from siloscope.monitor.store import schema_people
from siloscope.monitor.store.engine import Store, opened, revision_of, whole
from siloscope.monitor.store.schema import metadata

BATCH = 2000

TABLES = (metadata, schema_people)
"""Both modules fill the same metadata."""


def write_file(store: Store, path: Path) -> int:
    """Writes the database as an SQLite file, whatever it is itself; readers and writers go on meanwhile. Its bytes."""
    if path.exists():
        raise UsageError(f"{path}: is there already; name a new file for the backup")
    part = path.with_name(f"{path.name}.part")
    part.unlink(missing_ok=True)
    try:
        if store.is_sqlite:
            store.vacuum_into(part)
        else:
            target = opened(f"sqlite:///{part.absolute()}")
            copy(store, target)
            target.close()
        _flush(part)
        os.replace(part, path)
        _flush(path.parent)
    finally:
        for left in path.parent.glob(f"{part.name}*"):
            left.unlink()
    return path.stat().st_size


def _flush(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def read_file(path: Path) -> Store:
    """A backup, opened; raises `InputError` where it is none, damaged, or of a newer program."""
    if not path.is_file():
        raise InputError(f"{path}: no such backup; check the path")
    with path.open("rb") as file:
        if file.read(16) != b"SQLite format 3\x00":
            raise InputError(f"{path}: is no backup of `siloscope monitor backup`")
    try:
        store = opened(f"sqlite:///{path.absolute()}")
        with store.read() as connection:
            wrong = whole(connection)
    except DatabaseError as error:
        wrong = [str(error.orig)]
    if wrong:
        raise InputError(f"{path}: the backup is damaged ({wrong[0]}); take another one")
    return store


def copy(source: Store, target: Store) -> dict[str, int]:
    """Copies all rows into an empty database of the same schema, all or nothing; number of rows by table."""
    if revision_of(source) != revision_of(target):
        raise UsageError("both databases must have this program's schema; start the service on them once")
    with source.read() as reader, target.write() as writer:
        for table in metadata.sorted_tables:
            if writer.execute(select(func.count()).select_from(table)).scalar_one():
                raise UsageError(f"the other database is not empty (table {table.name}); give a new one")
        found = {table.name: _copied(reader, writer, table) for table in metadata.sorted_tables}
        if not target.is_sqlite:
            _set_sequences(writer)
    return found


def _copied(reader: Connection, writer: Connection, table: Table) -> int:
    count = 0
    for rows in _rows(reader, table):
        writer.execute(insert(table), rows)
        count += len(rows)
    return count


def _rows(reader: Connection, table: Table) -> Iterator[list[dict[str, Any]]]:
    """Rows in the order of their keys; of places, those that others lie in first."""
    wanted = select(table).order_by(*table.primary_key.columns)
    if table.name == "place":
        yield from ([row] for row in _parents_first(reader, table))
        return
    for part in reader.execution_options(yield_per=BATCH).execute(wanted).partitions(BATCH):
        yield [dict(row._mapping) for row in part]


def _parents_first(reader: Connection, table: Table) -> Iterator[dict[str, Any]]:
    rows = [dict(row._mapping) for row in reader.execute(select(table))]
    done: set[str | None] = {None}
    while rows:
        ready = [row for row in rows if row["parent"] in done]
        yield from ready
        done |= {row["id"] for row in ready}
        rows = [row for row in rows if row["id"] not in done]


def _set_sequences(writer: Connection) -> None:
    """PostgreSQL's counters go on behind what was copied."""
    for table in metadata.sorted_tables:
        key = table.primary_key.columns.keys()
        if key == ["id"] and table.c.id.type.python_type is int:
            newest = writer.execute(select(func.max(table.c.id))).scalar()
            if newest is not None:
                name = f'"{table.name}"'
                writer.execute(text("SELECT setval(pg_get_serial_sequence(:t, 'id'), :n)"), {"t": name, "n": newest})
