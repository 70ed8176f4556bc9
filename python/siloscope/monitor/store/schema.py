"""The tables. Times are µs of UTC; ids that travel between machines are UUIDv7; ids of places are their owners'."""

from __future__ import annotations

from sqlalchemy import (
    JSON,
    BigInteger,
    Boolean,
    Column,
    Float,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    String,
    Table,
    Text,
    UniqueConstraint,
    text,
)

metadata = MetaData(
    naming_convention={
        "ix": "ix_%(table_name)s_%(column_0_N_name)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "fk": "fk_%(table_name)s_%(column_0_N_name)s",
        "pk": "pk_%(table_name)s",
    }
)

NUMBER = BigInteger().with_variant(Integer, "sqlite")
"""Primary keys that count up."""

CURRENT = "superseded IS NULL"
"""Readings that no later run has replaced."""


REPLACED = "superseded IS NOT NULL"
"""Readings that one has."""


def number() -> Column[int]:
    return Column("id", NUMBER, primary_key=True, autoincrement=True)


site = Table("site", metadata, Column("key", String(40), primary_key=True), Column("value", JSON, nullable=False))

place = Table(
    "place",
    metadata,
    Column("id", String(80), primary_key=True),
    Column("parent", ForeignKey("place.id")),
    Column("kind", String(20), nullable=False),
    Column("name", Text, nullable=False),
    Column("zone", String(64)),
    Column("version", Integer, nullable=False),
)

product = Table(
    "product",
    metadata,
    Column("id", String(80), primary_key=True),
    Column("name", Text, nullable=False),
    Column("density", Float, nullable=False),
    Column("density_std", Float, nullable=False),
    Column("document", JSON, nullable=False),
    Column("version", Integer, nullable=False),
)

silo = Table(
    "silo",
    metadata,
    Column("id", String(80), primary_key=True),
    Column("place", ForeignKey("place.id")),
    Column("name", Text, nullable=False),
    Column("product", ForeignKey("product.id")),
    Column("vessel", JSON, nullable=False),
    Column("capacity", Float),
    Column("stale_after_s", Integer, nullable=False),
    Column("modbus_unit", Integer, unique=True),
    Column("serial", BigInteger),
    Column("banner", Text),
    Column("removed", BigInteger),
    Column("version", Integer, nullable=False),
)

filling = Table(
    "filling",
    metadata,
    number(),
    Column("silo", ForeignKey("silo.id"), nullable=False),
    Column("product", ForeignKey("product.id"), nullable=False),
    Column("since", BigInteger, nullable=False),
    UniqueConstraint("silo", "since"),
)

camera = Table(
    "camera",
    metadata,
    Column("id", String(80), primary_key=True),
    Column("silo", ForeignKey("silo.id"), nullable=False),
    Column("intrinsics", Text),
    Column("sensor", Text),
    Column("depth_unit", Float),
    Column("expected_s", Integer),
    Column("moved_since", BigInteger),
    Column("removed", BigInteger),
    Column("version", Integer, nullable=False),
)

calibration = Table(
    "calibration",
    metadata,
    Column("id", String(36), primary_key=True),
    Column("silo", ForeignKey("silo.id"), nullable=False),
    Column("camera", ForeignKey("camera.id"), nullable=False),
    Column("document", LargeBinary, nullable=False),
    Column("sha256", String(64), nullable=False),
    Column("origin", String(20), nullable=False),
    Column("state", String(20), nullable=False),
    Column("frames", Integer, nullable=False),
    Column("created", BigInteger, nullable=False),
    Column("valid_from", BigInteger, nullable=False),
    Column("valid_to", BigInteger),
    Column("confirmed_by", Text),
    Index("ix_calibration_camera_state", "camera", "state"),
)

frame = Table(
    "frame",
    metadata,
    Column("id", String(36), primary_key=True),
    Column("camera", ForeignKey("camera.id"), nullable=False),
    Column("sha256", String(64), nullable=False),
    Column("captured", BigInteger, nullable=False),
    Column("received", BigInteger, nullable=False),
    Column("clock", String(10), nullable=False),
    Column("format", String(20), nullable=False),
    Column("bytes", Integer, nullable=False),
    Column("kept", Boolean, nullable=False),
    Column("state", String(10), nullable=False),
    Column("attempts", Integer, nullable=False),
    Column("not_before", BigInteger, nullable=False),
    Column("error", Text),
    Column("run", Integer),
    UniqueConstraint("camera", "sha256"),
    Index("ix_frame_state_captured", "state", "captured"),
    Index("ix_frame_camera_captured", "camera", "captured"),
    Index("ix_frame_sha256", "sha256"),
    Index("ix_frame_kept_captured", "kept", "captured"),
)

run = Table(
    "run",
    metadata,
    number(),
    Column("version", String(40), nullable=False),
    Column("config", String(64), nullable=False),
    Column("origin", String(20), nullable=False),
    Column("created", BigInteger, nullable=False),
    Column("note", Text),
)

reading = Table(
    "reading",
    metadata,
    number(),
    Column("frame", ForeignKey("frame.id")),
    Column("silo", ForeignKey("silo.id"), nullable=False),
    Column("camera", ForeignKey("camera.id")),
    Column("time", BigInteger, nullable=False),
    Column("clock", String(10), nullable=False),
    Column("run", ForeignKey("run.id"), nullable=False),
    Column("superseded", NUMBER),
    Column("calibration", ForeignKey("calibration.id")),
    Column("status", String(12), nullable=False),
    Column("reason", Text),
    Column("message", Text),
    Column("volume", Float),
    Column("volume_std", Float),
    Column("own_std", Float),
    Column("ullage", Float),
    Column("ullage_std", Float),
    Column("fill", Float),
    Column("capacity", Float),
    Column("mass", Float),
    Column("mass_std", Float),
    Column("density", Float),
    Column("level", Float),
    Column("level_min", Float),
    Column("level_max", Float),
    Column("level_axis", Float),
    Column("level_std", Float),
    Column("datum", String(20)),
    Column("distance", Float),
    Column("distance_min", Float),
    Column("distance_max", Float),
    Column("coverage", Float),
    Column("quality", JSON, nullable=False),
    UniqueConstraint("frame", "run"),
    Index("ix_reading_frame", "frame"),
    Index(
        "ix_reading_replaced",
        *("silo", "run", "time"),
        sqlite_where=text(REPLACED),
        postgresql_where=text(REPLACED),
    ),
    Index(
        "ix_reading_current",
        *("silo", "time", "status", "clock", "volume", "volume_std", "fill", "mass"),
        sqlite_where=text(CURRENT),
        postgresql_where=text(CURRENT),
    ),
)

surface = Table(
    "surface",
    metadata,
    Column("reading", ForeignKey("reading.id"), primary_key=True),
    Column("silo", ForeignKey("silo.id"), nullable=False),
    Column("time", BigInteger, nullable=False),
    Column("blob", LargeBinary, nullable=False),
    Index("ix_surface_silo_time", "silo", "time"),
)

event = Table(
    "event",
    metadata,
    Column("id", String(36), primary_key=True),
    Column("silo", ForeignKey("silo.id"), nullable=False),
    Column("kind", String(12), nullable=False),
    Column("start", BigInteger, nullable=False),
    Column("end", BigInteger, nullable=False),
    Column("volume", Float, nullable=False),
    Column("volume_std", Float, nullable=False),
    Column("mass", Float),
    Index("ix_event_silo_start", "silo", "start"),
)

forecast = Table(
    "forecast",
    metadata,
    Column("silo", ForeignKey("silo.id"), primary_key=True),
    Column("time", BigInteger, nullable=False),
    Column("daily", Float, nullable=False),
    Column("daily_std", Float, nullable=False),
    Column("day_to_day", Float, nullable=False),
    Column("empty_by", BigInteger),
    Column("earliest", BigInteger),
    Column("latest", BigInteger),
)

ticket = Table(
    "ticket",
    metadata,
    Column("id", String(36), primary_key=True),
    Column("silo", ForeignKey("silo.id"), nullable=False),
    Column("time", BigInteger, nullable=False),
    Column("mass", Float, nullable=False),
    Column("number", Text),
    Column("note", Text),
    Column("created", BigInteger, nullable=False),
    Column("created_by", Text, nullable=False),
    Index("ix_ticket_silo_time", "silo", "time"),
)

rule = Table(
    "rule",
    metadata,
    Column("id", String(80), primary_key=True),
    Column("place", ForeignKey("place.id")),
    Column("silo", ForeignKey("silo.id")),
    Column("kind", String(24), nullable=False),
    Column("level", Float),
    Column("clear", Float),
    Column("delay_s", Integer, nullable=False),
    Column("channels", JSON, nullable=False),
    Column("enabled", Boolean, nullable=False),
    Column("version", Integer, nullable=False),
)

rule_state = Table(
    "rule_state",
    metadata,
    Column("rule", ForeignKey("rule.id"), primary_key=True),
    Column("silo", ForeignKey("silo.id"), primary_key=True),
    Column("state", String(10), nullable=False),
    Column("since", BigInteger),
    Column("seen", BigInteger, nullable=False),
    Column("alert", String(36)),
)

alert = Table(
    "alert",
    metadata,
    Column("id", String(36), primary_key=True),
    Column("rule", String(80), nullable=False),
    Column("kind", String(24), nullable=False),
    Column("silo", ForeignKey("silo.id"), nullable=False),
    Column("since", BigInteger, nullable=False),
    Column("fired", BigInteger, nullable=False),
    Column("resolved", BigInteger),
    Column("value", Float),
    Column("threshold", Float),
    Column("acknowledged", BigInteger),
    Column("acknowledged_by", Text),
    Column("note", Text),
    Column("version", Integer, nullable=False),
    Index("ix_alert_silo_fired", "silo", "fired"),
    Index("ix_alert_resolved", "resolved"),
)

outbox = Table(
    "outbox",
    metadata,
    number(),
    Column("channel", String(40), nullable=False),
    Column("key", String(200), nullable=False),
    Column("payload", JSON, nullable=False),
    Column("created", BigInteger, nullable=False),
    Column("attempts", Integer, nullable=False),
    Column("next", BigInteger, nullable=False),
    Column("error", Text),
    Column("delivered", BigInteger),
    UniqueConstraint("channel", "key"),
    Index("ix_outbox_channel_delivered_next", "channel", "delivered", "next"),
)

change = Table(
    "change",
    metadata,
    number(),
    Column("kind", String(20), nullable=False),
    Column("subject", Text, nullable=False),
    Column("silo", String(80)),
    Column("time", BigInteger, nullable=False),
    sqlite_autoincrement=True,
)
