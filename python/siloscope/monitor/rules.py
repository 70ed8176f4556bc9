"""Rules as pure state machines: a value comes, the state goes on, and sometimes an alert begins or ends.

A rule has two levels: it becomes active beyond `level` and stays so until the value is back beyond `clear`, so that a
value that trembles about one level rings once. It fires after `delay_s` of being active. A value that is not known
changes nothing: that there are no data is a rule of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

from siloscope.monitor.clock import SECOND

OK, PENDING, FIRING = "ok", "pending", "firing"


@dataclass(frozen=True)
class Kind:
    """What a rule of a kind looks at; levels in the value's unit."""

    name: str
    meaning: str
    unit: str
    level: float | None
    clear: float | None
    delay_s: int
    falling: bool = False
    """Whether it is active below its level."""
    by_clock: bool = False
    """Whether the value grows while no reading comes."""


_KINDS = (
    Kind("low", "the fill is low", "fraction", 0.20, 0.25, 0, falling=True),
    Kind("critical", "the fill is critically low", "fraction", 0.08, 0.12, 0, falling=True),
    Kind("overfill", "the silo is nearly full", "fraction", 0.95, 0.92, 0),
    Kind("sudden-drop", "the fill fell within an hour, as a leak makes it", "fraction an hour", 0.10, 0.03, 0),
    Kind("consumption", "the last day's use differs from the usual use", "fraction", 0.5, 0.3, 0),
    Kind("flatline", "nothing is used, though the silo is in use", "hours", 24.0, 1.0, 0),
    Kind("no-data", "no reading comes", "seconds", None, None, 0, by_clock=True),
    Kind("dirty-lens", "most of the newest frames show a film on the lens, or too little", "fraction", 0.5, 0.2, 0),
    Kind("camera-moved", "the wall no longer lies where the calibration has it", "fraction", 0.99, 0.4, 0),
    Kind("bridging", "feed hangs or a hole goes down into it", "fraction", 0.6, 0.2, 0),
)

DEFAULTS = {kind.name: kind for kind in _KINDS}
"""Kinds by name, with the levels that they have unless told otherwise."""

KINDS = tuple(DEFAULTS)


@dataclass(frozen=True)
class Rule:
    """A rule as it is in force for a silo."""

    id: str
    kind: str
    level: float
    clear: float
    delay_s: int

    @property
    def falling(self) -> bool:
        """Whether it is active below its level."""
        return DEFAULTS[self.kind].falling


@dataclass(frozen=True)
class State:
    """Where a rule stands for a silo."""

    name: str = OK
    since: int | None = None
    """When the value went beyond the level, µs."""


@dataclass(frozen=True)
class Value:
    """What a rule looks at, and when that was so."""

    value: float | None
    time: int


@dataclass(frozen=True)
class Step:
    """The state after a value, and what that begins or ends."""

    state: State
    fires: bool = False
    resolves: bool = False


def step(rule: Rule, state: State, seen: Value) -> Step:
    """The state after a value."""
    if seen.value is None:
        return Step(state)
    sign = -1.0 if rule.falling else 1.0
    beyond = sign * (seen.value - rule.level) > 0.0 or seen.value == rule.level
    back = sign * (seen.value - rule.clear) < 0.0
    if state.name == OK:
        return _begun(rule, State(PENDING, seen.time), seen) if beyond else Step(state)
    if state.name == PENDING:
        return _begun(rule, state, seen) if beyond or not back else Step(State())
    return Step(State(), resolves=True) if back else Step(state)


def _begun(rule: Rule, state: State, seen: Value) -> Step:
    """A rule that is active: it fires once it has been so long enough."""
    since = seen.time if state.since is None else min(state.since, seen.time)
    if seen.time - since < rule.delay_s * SECOND:
        return Step(State(PENDING, since))
    return Step(State(FIRING, since), fires=True)


def clear_of(kind: str, level: float | None) -> float | None:
    """The second level of a rule for which only the first was given: as far from it as in the kind's defaults."""
    usual = DEFAULTS[kind]
    if level is None or usual.level is None or usual.clear is None:
        return level
    return level * usual.clear / usual.level if not usual.falling else level + (usual.clear - usual.level)
