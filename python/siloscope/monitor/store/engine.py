"""The database: one write lock, durable commits, and the schema's version."""

from __future__ import annotations

import contextlib
import secrets
import sqlite3
import threading
import time
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, Engine, Table, create_engine, event, text
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.exc import ArgumentError, DatabaseError, OperationalError

from siloscope import _core
from siloscope.errors import InputError, UsageError
from siloscope.monitor.store.filesystem import refuse_network

MIGRATIONS = Path(__file__).parent / "migrations"

BUSY_MS = 30_000
"""How long a connection waits for another process's write, ms."""

BLOBS = 8480
"""PostgreSQL's advisory lock of the frames' bytes."""

MIGRATING = 8484
"""PostgreSQL's advisory lock of the schema."""

WRITE = "siloscope_write"
"""Execution option of connections that write."""


class Store:
    """A database of the service, opened.

    Reads go on beside a write; writes of this process come one after another, and each commit is on the disk when it
    returns.
    """

    def __init__(self, url: str) -> None:
        self.url = url
        self.engine = _engine(url)
        self._lock = threading.RLock()

    @property
    def is_sqlite(self) -> bool:
        """Whether it is a file."""
        return self.engine.dialect.name == "sqlite"

    @contextlib.contextmanager
    def read(self) -> Iterator[Connection]:
        """A connection with one view of the data."""
        with self.engine.connect() as connection, connection.begin():
            yield connection

    @contextlib.contextmanager
    def write(self) -> Iterator[Connection]:
        """A transaction: committed to the disk at the end, undone where an error is raised."""
        with self._lock, self.engine.connect() as connection:
            connection = connection.execution_options(**{WRITE: True})
            with connection.begin():
                yield connection

    def while_blobs_stay(self, connection: Connection, *, removing: bool = False) -> None:
        """Holds a lock to the transaction's end: bytes are removed only while no frame is being recorded.

        SQLite has one writer anyway.
        """
        if not self.is_sqlite:
            kind = "" if removing else "_shared"
            connection.execute(text(f"SELECT pg_advisory_xact_lock{kind}({BLOBS})"))

    @contextlib.contextmanager
    def migrating(self) -> Iterator[None]:
        """One process after the other brings the schema up to date; the second finds it done."""
        if self.is_sqlite:
            yield
            return
        with self.engine.connect() as connection, connection.begin():
            connection.execute(text(f"SELECT pg_advisory_xact_lock({MIGRATING})"))
            yield

    def insert_new(self, connection: Connection, table: Table, row: dict[str, Any]) -> bool:
        """Inserts a row unless one with its unique key is there; whether it was inserted."""
        return connection.execute(_insert_new(table, self.is_sqlite), row).scalar() is not None

    def vacuum_into(self, path: Path) -> None:
        """Writes an SQLite database as it is at this moment to a new file."""
        with contextlib.closing(sqlite3.connect(self.url.removeprefix("sqlite:///"), isolation_level=None)) as file:
            file.execute("VACUUM INTO ?", (str(path),))

    def close(self) -> None:
        """Closes all connections."""
        self.engine.dispose()


@lru_cache
def _insert_new(table: Table, is_sqlite: bool) -> Any:
    dialect: Any = sqlite if is_sqlite else postgresql
    return dialect.insert(table).on_conflict_do_nothing().returning(next(iter(table.primary_key.columns)))


def opened(url: str) -> Store:
    """The store of a URL, its schema brought up to this program's.

    Raises
    ------
    InputError
        For a database of a newer program, or one that can't be reached.
    UsageError
        For a URL that is none, or a file on a network file system.
    """
    if url.startswith("sqlite:///"):
        refuse_network(Path(url.removeprefix("sqlite:///")).parent)
    try:
        store = Store(url)
        found = revision_of(store)
    except (ArgumentError, ImportError) as error:
        raise UsageError(f"--database {url}: {error}; give a URL such as postgresql+psycopg://user@host/name") from None
    except OperationalError as error:
        raise InputError(f"the database can't be opened ({str(error.orig).strip()}); check its address") from None
    script = ScriptDirectory.from_config(_config(url))
    known = {revision.revision for revision in script.walk_revisions()}
    if found is not None and found not in known:
        raise InputError(
            f"the database has the schema '{found}' of a newer siloscope; this one is {_core.__version__} and knows up "
            f"to '{script.get_current_head()}'; install the newer program, or restore a backup of before"
        )
    if found != script.get_current_head():
        if found is not None:
            _keep_before(store, found)
        with store.migrating():
            migrate(store)
    return store


def _keep_before(store: Store, revision: str) -> None:
    """Keeps an SQLite file as it is before its schema changes: going back is restoring it."""
    if not store.is_sqlite:
        return
    path = Path(store.url.removeprefix("sqlite:///"))
    kept = path.with_name(f"{path.stem}.before-{revision}.db")
    if not kept.exists():
        store.vacuum_into(kept)


def revision_of(store: Store) -> str | None:
    """The schema of a database."""
    with store.read() as connection:
        return MigrationContext.configure(connection).get_current_revision()


def migrate(store: Store, to: str = "head") -> None:
    """Brings the schema to a revision: all of it or nothing."""
    config = _config(store.url)
    config.attributes["store"] = store
    command.upgrade(config, to)


def head() -> str | None:
    """The schema that this program has."""
    return ScriptDirectory.from_config(_config("sqlite://")).get_current_head()


def _config(url: str) -> Config:
    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS))
    config.set_main_option("sqlalchemy.url", url.replace("%", "%%"))
    return config


def _engine(url: str) -> Engine:
    if not url.startswith("sqlite"):
        engine = create_engine(url, pool_pre_ping=True)
        event.listen(engine, "connect", _durable_server)
        return engine
    engine = create_engine(url, connect_args={"check_same_thread": False})
    event.listen(engine, "connect", _durable_file)
    event.listen(engine, "begin", _begin)
    return engine


def _durable_file(connection: Any, _record: Any) -> None:
    connection.isolation_level = None  # transactions begin where `_begin` says so
    for pragma in ("journal_mode=WAL", "synchronous=FULL", f"busy_timeout={BUSY_MS}", "foreign_keys=ON"):
        connection.execute(f"PRAGMA {pragma}")


def _durable_server(connection: Any, _record: Any) -> None:
    with connection.cursor() as cursor:
        cursor.execute("SET synchronous_commit = on")
    connection.commit()


def _begin(connection: Connection) -> None:
    write = connection.get_execution_options().get(WRITE, False)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if write else "BEGIN")


def whole(connection: Connection) -> list[str]:
    """What is wrong with a SQLite file; nothing where it is whole."""
    if connection.dialect.name != "sqlite":
        return []
    try:
        found = [str(row[0]) for row in connection.execute(text("PRAGMA integrity_check"))]
    except DatabaseError as error:
        return [str(error.orig)]
    if found != ["ok"]:
        return found
    broken = [
        f"row {row[1]} of {row[0]} points nowhere" for row in connection.execute(text("PRAGMA foreign_key_check"))
    ]
    return broken


def new_id() -> str:
    """A UUIDv7: sorts by the time it was made."""
    stamp = time.time_ns() // 1_000_000
    value = (stamp << 80) | (0x7 << 76) | (secrets.randbits(12) << 64) | (0b10 << 62) | secrets.randbits(62)
    text_ = f"{value:032x}"
    return "-".join((text_[:8], text_[8:12], text_[12:16], text_[16:20], text_[20:]))
