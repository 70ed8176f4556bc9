"""Alembic's door: runs migrations in one transaction each, with the write lock from the beginning."""

from __future__ import annotations

from alembic import context

from siloscope.monitor.store import schema_people
from siloscope.monitor.store.schema import metadata

TABLES = (metadata, schema_people)
"""Both modules fill the same metadata."""

store = context.config.attributes["store"]
with store.write() as connection:
    context.configure(connection, target_metadata=metadata, render_as_batch=True)
    context.run_migrations()
