"""What the rules see of a silo, and the alerts that come of it."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection

from siloscope.monitor import rules
from siloscope.monitor.clock import DAY, HOUR, SECOND
from siloscope.monitor.outbox import Outbox
from siloscope.monitor.store import alerts, places, readings
from siloscope.monitor.store.engine import Store

NEWEST = 12
"""Readings by which lens, camera and feed are judged."""

MOVED = 3
"""Readings in a row that say that the camera moved before anybody believes it."""

REFILL = 6.0
"""A rise between two readings beyond so many deviations of one is a refill: by noise alone one in some 100,000."""

CODES = {
    "dirty-lens": frozenset(("lens-film", "too-little-seen", "sensor-buried")),
    "camera-moved": frozenset(("camera-moved",)),
    "bridging": frozenset(("stuck-feed", "rathole")),
}
"""Remarks of a reading by the rule that counts them."""

COUNTED = {"dirty-lens": NEWEST, "camera-moved": MOVED, "bridging": MOVED}
"""How many of the newest readings."""


@dataclass(frozen=True)
class Seen:
    """What is known of a silo at a moment. Times in µs."""

    now: int
    stale_after: int
    last: Any = None
    """The newest reading with an answer."""
    newest: Sequence[Any] = ()
    """The newest readings, the last first, answered or not."""
    hour: Sequence[Any] = ()
    """Answered readings of the hour before the last one."""
    day: Sequence[Any] = ()
    """Those of the day before the last one."""
    daily: float | None = None
    """Usual use, m³ a day."""
    daily_std: float | None = None
    begun: int | None = None
    """When the first frame was due."""

    @property
    def stale(self) -> bool:
        """Whether the newest answer is too old to be acted on."""
        return self.last is None or self.now - self.last.time > self.stale_after


def values(seen: Seen) -> dict[str, rules.Value]:
    """What each kind of rule looks at; unknown where it can't be told, and where all there is is stale."""
    data = rules.Value(None, seen.now)
    found = dict.fromkeys(rules.KINDS, data)
    since = seen.last.time if seen.last is not None else seen.begun
    if since is not None:
        found["no-data"] = rules.Value((seen.now - since) / SECOND, seen.now)
    newest = seen.newest[0] if seen.newest else None
    if newest is not None and seen.now - newest.time <= seen.stale_after:
        for kind, codes in CODES.items():
            found[kind] = rules.Value(_fraction(seen.newest[: COUNTED[kind]], codes, COUNTED[kind]), newest.time)
    if seen.stale:
        return found
    time = seen.last.time
    for kind in ("low", "critical", "overfill"):
        found[kind] = rules.Value(seen.last.fill, time)
    found["sudden-drop"] = rules.Value(_drop(seen.hour, seen.last), time)
    found["consumption"] = rules.Value(_deviation(seen), time)
    found["flatline"] = rules.Value(_flat_hours(seen), time)
    return found


def _fraction(newest: Sequence[Any], codes: frozenset[str], least: int) -> float | None:
    """Fraction of readings with one of these remarks; None while there are too few to judge by."""
    if len(newest) < min(least, MOVED):
        return None
    return sum(bool(codes & codes_of(reading)) for reading in newest) / len(newest)


def codes_of(reading: Any) -> set[str]:
    """A reading's remarks."""
    return {remark["code"] for remark in reading.quality} | ({reading.reason} if reading.reason else set())


def _drop(hour: Sequence[Any], last: Any) -> float | None:
    """How far the fill fell in an hour, as a fraction of the capacity."""
    fills = [reading.fill for reading in hour if reading.fill is not None]
    return None if last.fill is None or not fills else float(max(fills) - last.fill)


def _deviation(seen: Seen) -> float | None:
    """By how much the last day's use differs from the usual one, as its fraction."""
    if not seen.daily or len(seen.day) < 8 or seen.day[-1].time - seen.day[0].time < 0.8 * DAY:
        return None
    return float(abs(_fallen(seen.day) / ((seen.day[-1].time - seen.day[0].time) / DAY) / seen.daily - 1.0))


def _fallen(day: Sequence[Any]) -> float:
    """What was taken out, m³: the volume's changes, with rises beyond noise, which are refills, left out.

    Smaller rises count against the falls around them: were they left out too, noise alone would add up to a use.
    """
    known = [reading for reading in day if reading.volume is not None]
    taken = 0.0
    for before, after in itertools.pairwise(known):
        noise = REFILL * max(before.own_std or 0.0, after.own_std or 0.0)
        if after.volume - before.volume <= noise:
            taken += before.volume - after.volume
    return float(taken)


def _flat_hours(seen: Seen) -> float | None:
    """Hours since the volume last changed beyond its noise; None where the silo is not in use."""
    if not seen.daily or seen.last.volume is None:
        return None
    for reading in reversed(seen.day):
        if reading.volume is None:
            continue
        noise = 4.0 * max(reading.own_std or 0.0, seen.last.own_std or 0.0)
        if abs(reading.volume - seen.last.volume) > noise:
            return float(seen.last.time - reading.time) / HOUR
    return float(seen.last.time - seen.day[0].time) / HOUR if seen.day else None


class Alerting:
    """Looks at silos with their rules."""

    def __init__(self, store: Store, outbox: Outbox) -> None:
        self._store, self._outbox = store, outbox

    def look(self, silo_id: str, now: int) -> None:
        """One silo."""
        with self._store.write() as connection:
            silo = places.get(connection, "silo", silo_id)
            if silo is None:
                return
            seen = values(self._seen(connection, silo, now))
            states = alerts.states(connection, silo_id)
            for row in in_force(connection, silo):
                self._step(connection, silo, row, states.get(row.id), seen[row.kind])

    def _step(self, connection: Connection, silo: Any, row: Any, before: Any, seen: rules.Value) -> None:
        if seen.value is None:
            return  # what is not known leaves all as it is, also up to when it was looked at
        rule = rule_of(row, silo)
        state = rules.State() if before is None else rules.State(before.state, before.since)
        if before is not None and seen.time < before.seen:
            return  # a late reading tells of the past
        made = rules.step(rule, state, seen)
        if before is not None and made.state == state:
            return
        alert = None if before is None else before.alert
        if made.fires:
            alert = self._fire(connection, silo, rule, row, made, seen)
        elif made.resolves and alert is not None:
            alerts.resolve(connection, alert, seen.time)
            self._outbox.announce(connection, row.channels, alert, seen.time)
            alert = None
        values_ = {"state": made.state.name, "since": made.state.since, "seen": seen.time, "alert": alert}
        alerts.set_state(connection, rule.id, silo.id, values_)

    def _fire(
        self, connection: Connection, silo: Any, rule: rules.Rule, row: Any, made: rules.Step, seen: rules.Value
    ) -> str:
        values_ = {
            "rule": rule.id,
            "kind": rule.kind,
            "silo": silo.id,
            "since": made.state.since,
            "fired": seen.time,
            "value": seen.value,
            "threshold": rule.level,
        }
        alert = alerts.fire(connection, values_)
        self._outbox.announce(connection, row.channels, alert, seen.time)
        return alert

    def _seen(self, connection: Connection, silo: Any, now: int) -> Seen:
        last = readings.last(connection, silo.id, answered=True)
        forecast = readings.forecast_of(connection, silo.id)
        day: Sequence[Any] = ()
        if last is not None:
            day = readings.recent(connection, silo.id, last.time - DAY, last.time)
        return Seen(
            now,
            silo.stale_after_s * SECOND,
            last,
            readings.newest(connection, silo.id, NEWEST),
            [reading for reading in day if last is not None and reading.time >= last.time - HOUR],
            day,
            None if forecast is None else forecast.daily,
            None if forecast is None else forecast.daily_std,
        )


def rule_of(row: Any, silo: Any) -> rules.Rule:
    """A rule with the levels that it has for a silo."""
    level = float(silo.stale_after_s) if row.level is None else row.level
    return rules.Rule(row.id, row.kind, level, level if row.clear is None else row.clear, row.delay_s)


def in_force(connection: Connection, silo: Any) -> list[Any]:
    """The rules for a silo: of each kind the one that names it, else that of the nearest place, else the site's."""
    around = places.above(connection, silo.place)
    best: dict[str, tuple[int, Any]] = {}
    for row in alerts.rules(connection):
        if row.silo == silo.id:
            rank = 0
        elif row.silo is None and row.place in around:
            rank = 1 + around.index(row.place)
        elif row.silo is None and row.place is None:
            rank = 1 + len(around)
        else:
            continue
        if row.kind not in best or rank < best[row.kind][0]:
            best[row.kind] = (rank, row)
    return [row for _, row in best.values() if row.enabled]


def add_defaults(connection: Connection, now: int) -> None:
    """The rules of a new site: one of each kind, for all silos."""
    if alerts.rules(connection):
        return
    for kind in rules.DEFAULTS.values():
        values_ = {"place": None, "silo": None, "kind": kind.name, "level": kind.level, "clear": kind.clear}
        more = {"delay_s": kind.delay_s, "channels": [], "enabled": True}
        alerts.put_rule(connection, kind.name, values_ | more, now)
