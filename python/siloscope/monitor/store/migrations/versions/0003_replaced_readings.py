"""An index of the readings that later runs replaced, so that a silo's runs are told quickly."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"


def upgrade() -> None:
    """To this schema."""
    op.create_index(
        "ix_reading_replaced",
        "reading",
        ["silo", "run", "time"],
        sqlite_where=sa.text("superseded IS NOT NULL"),
        postgresql_where=sa.text("superseded IS NOT NULL"),
    )
