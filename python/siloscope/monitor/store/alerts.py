"""Rules, where each of them stands for each silo, and the alerts that came of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import Connection, delete, func, insert, select, update

from siloscope.monitor.store import changes
from siloscope.monitor.store.engine import new_id
from siloscope.monitor.store.rows import Record
from siloscope.monitor.store.schema import alert, rule, rule_state


def rules(connection: Connection) -> Sequence[Record]:
    """All rules by id."""
    return connection.execute(select(rule).order_by(rule.c.id)).all()


def rule_get(connection: Connection, key: str) -> Record | None:
    """A rule."""
    return connection.execute(select(rule).where(rule.c.id == key)).one_or_none()


def put_rule(connection: Connection, key: str, values: dict[str, Any], now: int) -> bool:
    """Sets a rule; whether anything changed."""
    found = rule_get(connection, key)
    if found is None:
        connection.execute(insert(rule).values(id=key, version=1, **values))
    elif all(found._mapping[name] == value for name, value in values.items()):
        return False
    else:
        connection.execute(update(rule).where(rule.c.id == key).values(**values, version=found.version + 1))
    changes.note(connection, "rule", key, values.get("silo"), now)
    return True


def remove_rule(connection: Connection, key: str, now: int) -> bool:
    """Removes a rule; its alerts end and stay in the list."""
    connection.execute(delete(rule_state).where(rule_state.c.rule == key))
    gone = connection.execute(delete(rule).where(rule.c.id == key)).rowcount == 1
    open_ = [alert.c.rule == key, alert.c.resolved.is_(None)]
    connection.execute(update(alert).where(*open_).values(resolved=now, version=alert.c.version + 1))
    if gone:
        changes.note(connection, "rule", key, None, now)
    return gone


def states(connection: Connection, silo: str) -> dict[str, Record]:
    """Where each rule stands for a silo."""
    return {row.rule: row for row in connection.execute(select(rule_state).where(rule_state.c.silo == silo))}


def set_state(connection: Connection, rule_id: str, silo: str, values: dict[str, Any]) -> None:
    """Writes where a rule stands for a silo."""
    same = [rule_state.c.rule == rule_id, rule_state.c.silo == silo]
    if not connection.execute(update(rule_state).where(*same).values(**values)).rowcount:
        connection.execute(insert(rule_state).values(rule=rule_id, silo=silo, **values))


def fire(connection: Connection, values: dict[str, Any]) -> str:
    """Adds an alert."""
    key = new_id()
    connection.execute(insert(alert).values(id=key, version=1, **values))
    changes.note(connection, "alert", key, values["silo"], values["fired"])
    return key


def resolve(connection: Connection, key: str, now: int) -> None:
    """Ends an alert."""
    ended = update(alert).where(alert.c.id == key, alert.c.resolved.is_(None))
    connection.execute(ended.values(resolved=now, version=alert.c.version + 1))
    changes.note(connection, "alert", key, _silo(connection, key), now)


def acknowledge(connection: Connection, key: str, who: str, note: str | None, now: int) -> Record | None:
    """Notes who has seen an alert; who was first stays. None where there is none."""
    first = [alert.c.id == key, alert.c.acknowledged.is_(None)]
    values = {"acknowledged": now, "acknowledged_by": who, "note": note, "version": alert.c.version + 1}
    if connection.execute(update(alert).where(*first).values(**values)).rowcount:
        changes.note(connection, "alert", key, _silo(connection, key), now)
    return get(connection, key)


def get(connection: Connection, key: str) -> Record | None:
    """An alert."""
    return connection.execute(select(alert).where(alert.c.id == key)).one_or_none()


def listed(
    connection: Connection, *, silo: str | None, firing: bool | None, before: str | None, count: int
) -> Sequence[Record]:
    """Alerts, the newest first; ids rise with the time they fired, so one is the cursor."""
    wanted = select(alert)
    if silo is not None:
        wanted = wanted.where(alert.c.silo == silo)
    if firing is not None:
        wanted = wanted.where(alert.c.resolved.is_(None) if firing else alert.c.resolved.is_not(None))
    if before is not None:
        wanted = wanted.where(alert.c.id < before)
    return connection.execute(wanted.order_by(alert.c.id.desc()).limit(count)).all()


def firing(connection: Connection) -> Sequence[Record]:
    """Number of unresolved alerts by silo and kind."""
    wanted = select(alert.c.silo, alert.c.kind, func.count().label("number")).where(alert.c.resolved.is_(None))
    return connection.execute(wanted.group_by(alert.c.silo, alert.c.kind)).all()


def _silo(connection: Connection, key: str) -> str | None:
    return connection.execute(select(alert.c.silo).where(alert.c.id == key)).scalar()
