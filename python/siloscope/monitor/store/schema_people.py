"""The tables of people: users, roles, sessions, links, tokens, audit. Of secrets there are hashes only."""

from __future__ import annotations

from sqlalchemy import JSON, BigInteger, Column, ForeignKey, Index, String, Table, Text

from siloscope.monitor.store.schema import metadata, number

user = Table(
    "user",
    metadata,
    Column("id", String(36), primary_key=True),
    Column("name", String(80), nullable=False, unique=True),
    Column("password", Text),
    Column("created", BigInteger, nullable=False),
    Column("disabled", BigInteger),
)

grant = Table(
    "grant",
    metadata,
    number(),
    Column("user", ForeignKey("user.id"), nullable=False),
    Column("place", ForeignKey("place.id")),
    Column("role", String(10), nullable=False),
)

session = Table(
    "session",
    metadata,
    Column("hash", String(64), primary_key=True),
    Column("user", ForeignKey("user.id"), nullable=False),
    Column("created", BigInteger, nullable=False),
    Column("expires", BigInteger, nullable=False),
)

link = Table(
    "link",
    metadata,
    Column("hash", String(64), primary_key=True),
    Column("user", ForeignKey("user.id")),
    Column("created", BigInteger, nullable=False),
    Column("expires", BigInteger, nullable=False),
    Column("used", BigInteger),
)

token = Table(
    "token",
    metadata,
    Column("id", String(36), primary_key=True),
    Column("hash", String(64), nullable=False, unique=True),
    Column("role", String(10), nullable=False),
    Column("camera", String(80)),
    Column("name", Text),
    Column("created", BigInteger, nullable=False),
    Column("revoked", BigInteger),
)

audit = Table(
    "audit",
    metadata,
    number(),
    Column("time", BigInteger, nullable=False),
    Column("who", Text, nullable=False),
    Column("action", Text, nullable=False),
    Column("subject", Text),
    Column("detail", JSON),
    Column("address", Text),
    Index("ix_audit_time", "time"),
)
