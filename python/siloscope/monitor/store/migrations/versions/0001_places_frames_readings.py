"""Places, frames, readings."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

NUMBER = sa.BigInteger().with_variant(sa.Integer(), "sqlite")

revision = "0001"
down_revision = None


def upgrade() -> None:
    """To this schema."""
    op.create_table(
        "place",
        sa.Column("id", sa.String(80), nullable=False),
        sa.Column("parent", sa.String(80)),
        sa.Column("kind", sa.String(20), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("zone", sa.String(64)),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.ForeignKeyConstraint(["parent"], ["place.id"]),
        sa.PrimaryKeyConstraint("id"),
    )
    op.create_table(
        "product",
        sa.Column("id", sa.String(80), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("density", sa.Float(), nullable=False),
        sa.Column("density_std", sa.Float(), nullable=False),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.PrimaryKeyConstraint("id"),
    )
    op.create_table(
        "run",
        sa.Column("id", NUMBER, nullable=False),
        sa.Column("version", sa.String(40), nullable=False),
        sa.Column("config", sa.String(64), nullable=False),
        sa.Column("origin", sa.String(20), nullable=False),
        sa.Column("created", sa.BigInteger(), nullable=False),
        sa.Column("note", sa.Text()),
        sa.PrimaryKeyConstraint("id"),
    )
    op.create_table(
        "site",
        sa.Column("key", sa.String(40), nullable=False),
        sa.Column("value", sa.JSON(), nullable=False),
        sa.PrimaryKeyConstraint("key"),
    )
    op.create_table(
        "silo",
        sa.Column("id", sa.String(80), nullable=False),
        sa.Column("place", sa.String(80)),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("product", sa.String(80)),
        sa.Column("vessel", sa.JSON(), nullable=False),
        sa.Column("capacity", sa.Float()),
        sa.Column("stale_after_s", sa.Integer(), nullable=False),
        sa.Column("modbus_unit", sa.Integer()),
        sa.Column("serial", sa.BigInteger()),
        sa.Column("banner", sa.Text()),
        sa.Column("removed", sa.BigInteger()),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.ForeignKeyConstraint(["place"], ["place.id"]),
        sa.ForeignKeyConstraint(["product"], ["product.id"]),
        sa.PrimaryKeyConstraint("id"),
        sa.UniqueConstraint("modbus_unit", name="uq_silo_modbus_unit"),
    )
    op.create_table(
        "camera",
        sa.Column("id", sa.String(80), nullable=False),
        sa.Column("silo", sa.String(80), nullable=False),
        sa.Column("intrinsics", sa.Text()),
        sa.Column("sensor", sa.Text()),
        sa.Column("depth_unit", sa.Float()),
        sa.Column("expected_s", sa.Integer()),
        sa.Column("moved_since", sa.BigInteger()),
        sa.Column("removed", sa.BigInteger()),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.ForeignKeyConstraint(["silo"], ["silo.id"]),
        sa.PrimaryKeyConstraint("id"),
    )
    op.create_table(
        "event",
        sa.Column("id", sa.String(36), nullable=False),
        sa.Column("silo", sa.String(80), nullable=False),
        sa.Column("kind", sa.String(12), nullable=False),
        sa.Column("start", sa.BigInteger(), nullable=False),
        sa.Column("end", sa.BigInteger(), nullable=False),
        sa.Column("volume", sa.Float(), nullable=False),
        sa.Column("volume_std", sa.Float(), nullable=False),
        sa.Column("mass", sa.Float()),
        sa.ForeignKeyConstraint(["silo"], ["silo.id"]),
        sa.PrimaryKeyConstraint("id"),
    )
    op.create_index("ix_event_silo_start", "event", ["silo", "start"])

    op.create_table(
        "filling",
        sa.Column("id", NUMBER, nullable=False),
        sa.Column("silo", sa.String(80), nullable=False),
        sa.Column("product", sa.String(80), nullable=False),
        sa.Column("since", sa.BigInteger(), nullable=False),
        sa.ForeignKeyConstraint(["product"], ["product.id"]),
        sa.ForeignKeyConstraint(["silo"], ["silo.id"]),
        sa.PrimaryKeyConstraint("id"),
        sa.UniqueConstraint("silo", "since", name="uq_filling_silo_since"),
    )
    op.create_table(
        "forecast",
        sa.Column("silo", sa.String(80), nullable=False),
        sa.Column("time", sa.BigInteger(), nullable=False),
        sa.Column("daily", sa.Float(), nullable=False),
        sa.Column("daily_std", sa.Float(), nullable=False),
        sa.Column("day_to_day", sa.Float(), nullable=False),
        sa.Column("empty_by", sa.BigInteger()),
        sa.Column("earliest", sa.BigInteger()),
        sa.Column("latest", sa.BigInteger()),
        sa.ForeignKeyConstraint(["silo"], ["silo.id"]),
        sa.PrimaryKeyConstraint("silo"),
    )
    op.create_table(
        "calibration",
        sa.Column("id", sa.String(36), nullable=False),
        sa.Column("silo", sa.String(80), nullable=False),
        sa.Column("camera", sa.String(80), nullable=False),
        sa.Column("document", sa.LargeBinary(), nullable=False),
        sa.Column("sha256", sa.String(64), nullable=False),
        sa.Column("origin", sa.String(20), nullable=False),
        sa.Column("state", sa.String(20), nullable=False),
        sa.Column("frames", sa.Integer(), nullable=False),
        sa.Column("created", sa.BigInteger(), nullable=False),
        sa.Column("valid_from", sa.BigInteger(), nullable=False),
        sa.Column("valid_to", sa.BigInteger()),
        sa.Column("confirmed_by", sa.Text()),
        sa.ForeignKeyConstraint(["camera"], ["camera.id"]),
        sa.ForeignKeyConstraint(["silo"], ["silo.id"]),
        sa.PrimaryKeyConstraint("id"),
    )
    op.create_index("ix_calibration_camera_state", "calibration", ["camera", "state"])

    op.create_table(
        "frame",
        sa.Column("id", sa.String(36), nullable=False),
        sa.Column("camera", sa.String(80), nullable=False),
        sa.Column("sha256", sa.String(64), nullable=False),
        sa.Column("captured", sa.BigInteger(), nullable=False),
        sa.Column("received", sa.BigInteger(), nullable=False),
        sa.Column("clock", sa.String(10), nullable=False),
        sa.Column("format", sa.String(20), nullable=False),
        sa.Column("bytes", sa.Integer(), nullable=False),
        sa.Column("kept", sa.Boolean(), nullable=False),
        sa.Column("state", sa.String(10), nullable=False),
        sa.Column("attempts", sa.Integer(), nullable=False),
        sa.Column("not_before", sa.BigInteger(), nullable=False),
        sa.Column("error", sa.Text()),
        sa.Column("run", sa.Integer()),
        sa.ForeignKeyConstraint(["camera"], ["camera.id"]),
        sa.PrimaryKeyConstraint("id"),
        sa.UniqueConstraint("camera", "sha256", name="uq_frame_camera_sha256"),
    )
    op.create_index("ix_frame_camera_captured", "frame", ["camera", "captured"])
    op.create_index("ix_frame_kept_captured", "frame", ["kept", "captured"])
    op.create_index("ix_frame_sha256", "frame", ["sha256"])
    op.create_index("ix_frame_state_captured", "frame", ["state", "captured"])

    op.create_table(
        "reading",
        sa.Column("id", NUMBER, nullable=False),
        sa.Column("frame", sa.String(36)),
        sa.Column("silo", sa.String(80), nullable=False),
        sa.Column("camera", sa.String(80)),
        sa.Column("time", sa.BigInteger(), nullable=False),
        sa.Column("clock", sa.String(10), nullable=False),
        sa.Column("run", NUMBER, nullable=False),
        sa.Column("superseded", NUMBER),
        sa.Column("calibration", sa.String(36)),
        sa.Column("status", sa.String(12), nullable=False),
        sa.Column("reason", sa.Text()),
        sa.Column("message", sa.Text()),
        sa.Column("volume", sa.Float()),
        sa.Column("volume_std", sa.Float()),
        sa.Column("own_std", sa.Float()),
        sa.Column("ullage", sa.Float()),
        sa.Column("ullage_std", sa.Float()),
        sa.Column("fill", sa.Float()),
        sa.Column("capacity", sa.Float()),
        sa.Column("mass", sa.Float()),
        sa.Column("mass_std", sa.Float()),
        sa.Column("density", sa.Float()),
        sa.Column("level", sa.Float()),
        sa.Column("level_min", sa.Float()),
        sa.Column("level_max", sa.Float()),
        sa.Column("level_axis", sa.Float()),
        sa.Column("level_std", sa.Float()),
        sa.Column("datum", sa.String(20)),
        sa.Column("distance", sa.Float()),
        sa.Column("distance_min", sa.Float()),
        sa.Column("distance_max", sa.Float()),
        sa.Column("coverage", sa.Float()),
        sa.Column("quality", sa.JSON(), nullable=False),
        sa.ForeignKeyConstraint(["calibration"], ["calibration.id"]),
        sa.ForeignKeyConstraint(["camera"], ["camera.id"]),
        sa.ForeignKeyConstraint(["frame"], ["frame.id"]),
        sa.ForeignKeyConstraint(["run"], ["run.id"]),
        sa.ForeignKeyConstraint(["silo"], ["silo.id"]),
        sa.PrimaryKeyConstraint("id"),
        sa.UniqueConstraint("frame", "run", name="uq_reading_frame_run"),
    )
    op.create_index(
        "ix_reading_current",
        "reading",
        ["silo", "time", "status", "clock", "volume", "volume_std", "fill", "mass"],
        sqlite_where=sa.text("superseded IS NULL"),
        postgresql_where=sa.text("superseded IS NULL"),
    )
    op.create_index("ix_reading_frame", "reading", ["frame"])

    op.create_table(
        "surface",
        sa.Column("reading", NUMBER, nullable=False),
        sa.Column("silo", sa.String(80), nullable=False),
        sa.Column("time", sa.BigInteger(), nullable=False),
        sa.Column("blob", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(["reading"], ["reading.id"]),
        sa.ForeignKeyConstraint(["silo"], ["silo.id"]),
        sa.PrimaryKeyConstraint("reading"),
    )
    op.create_index("ix_surface_silo_time", "surface", ["silo", "time"])
