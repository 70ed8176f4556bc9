"""Rules are pure: these are their laws."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from siloscope.monitor import alerts, rules
from siloscope.monitor.clock import DAY, HOUR, MINUTE
from siloscope.monitor.rules import FIRING, OK, PENDING, Rule, State, Value
from siloscope.monitor.store import alerts as stored
from siloscope.monitor.store import places

LOW = Rule("low", "low", 0.2, 0.25, 0)
FULL = Rule("overfill", "overfill", 0.95, 0.92, 0)


def run(rule: Rule, values: list[float | None], every: int = MINUTE) -> list[str]:
    """What a sequence of values begins and ends."""
    state, told = State(), []
    for k, value in enumerate(values):
        made = rules.step(rule, state, Value(value, k * every))
        told += [f"fires {k}"] if made.fires else []
        told += [f"resolves {k}"] if made.resolves else []
        state = made.state
    return told


def test_a_rule_fires_once_beyond_its_level_and_ends_beyond_the_other() -> None:
    assert run(LOW, [0.3, 0.2, 0.19, 0.22, 0.19, 0.24, 0.26, 0.19]) == ["fires 1", "resolves 6", "fires 7"]
    assert run(FULL, [0.9, 0.95, 0.93, 0.97, 0.91]) == ["fires 1", "resolves 4"]


def test_a_value_that_trembles_about_the_level_rings_once() -> None:
    assert run(LOW, [0.201, 0.199] * 50) == ["fires 1"]


def test_a_rule_waits_its_delay_and_forgets_what_was_short() -> None:
    slow = replace(LOW, delay_s=180)
    assert run(slow, [0.1, 0.1, 0.1, 0.1, 0.1]) == ["fires 3"]
    assert run(slow, [0.1, 0.1, 0.3, 0.1, 0.1, 0.1, 0.1]) == ["fires 6"]


def test_an_unknown_value_changes_nothing() -> None:
    assert run(LOW, [0.1, None, None, 0.1, None, 0.3]) == ["fires 0", "resolves 5"]
    slow = replace(LOW, delay_s=120)
    assert run(slow, [0.1, None, 0.1]) == ["fires 2"]


@given(st.lists(st.one_of(st.none(), st.floats(0, 1)), max_size=60), st.integers(0, 600))
def test_alerts_begin_and_end_in_turn(values: list[float | None], delay: int) -> None:
    told = [word.split()[0] for word in run(replace(LOW, delay_s=delay), values)]
    assert told == ["fires", "resolves"] * (len(told) // 2) + ["fires"] * (len(told) % 2)


@given(st.floats(0, 1), st.sampled_from([OK, PENDING, FIRING]))
def test_the_same_value_again_changes_nothing_more(value: float, name: str) -> None:
    state = State(name, None if name == OK else 0)
    once = rules.step(LOW, state, Value(value, MINUTE)).state
    again = rules.step(LOW, once, Value(value, MINUTE))
    assert again.state == once
    assert not again.fires


def reading(time: int, fill: float | None = 0.5, *codes: str, **more: Any) -> Any:
    quality = [{"code": code} for code in codes]
    values = {"time": time, "fill": fill, "volume": None if fill is None else 10 * fill, "own_std": 0.01}
    return SimpleNamespace(**values, quality=quality, reason=None, **more)


NOW = 100 * DAY


def seen(**more: Any) -> dict[str, float | None]:
    told = {
        "now": NOW,
        "stale_after": 2 * HOUR,
        "last": reading(NOW - MINUTE),
        "newest": [reading(NOW - MINUTE)],
    } | more
    return {kind: value.value for kind, value in alerts.values(alerts.Seen(**told)).items()}


def test_stale_data_say_nothing_but_that_there_are_none() -> None:
    old = reading(NOW - 3 * HOUR, 0.01, "lens-film")
    found = seen(last=old, newest=[old] * 12)
    assert found["no-data"] == pytest.approx(3 * 3600)
    assert {kind for kind, value in found.items() if value is not None} == {"no-data"}


def test_a_leak_is_told_by_the_fall_of_an_hour_between_two_levels() -> None:
    hour = [reading(NOW - 50 * MINUTE, 0.8), reading(NOW - 30 * MINUTE, 0.7)]
    assert seen(last=reading(NOW, 0.55), hour=hour)["sudden-drop"] == pytest.approx(0.25)
    assert seen(last=reading(NOW, 0.9), hour=hour)["sudden-drop"] < 0


def test_consumption_and_flatline_look_at_the_last_day() -> None:
    day = [reading(NOW - DAY + k * HOUR, 0.9 - 0.01 * k) for k in range(25)]
    assert seen(last=day[-1], day=day, daily=2.4)["consumption"] == pytest.approx(0.0, abs=0.05)
    assert seen(last=day[-1], day=day, daily=1.2)["consumption"] == pytest.approx(1.0, abs=0.1)
    still = [reading(NOW - DAY + k * HOUR, 0.9) for k in range(25)]
    assert seen(last=still[-1], day=still, daily=2.4)["flatline"] == pytest.approx(24.0)
    assert seen(last=day[-1], day=day, daily=2.4)["flatline"] <= 1.0
    assert seen(last=still[-1], day=still)["flatline"] is None


@pytest.mark.parametrize(
    ("kind", "code"),
    [
        ("dirty-lens", "lens-film"),
        ("camera-moved", "camera-moved"),
        ("bridging", "rathole"),
        ("bridging", "stuck-feed"),
    ],
)
def test_remarks_of_the_newest_readings_are_counted(kind: str, code: str) -> None:
    bad, good = reading(NOW - MINUTE, 0.5, code), reading(NOW - MINUTE, 0.5)
    assert seen(newest=[bad] * 12)[kind] == 1.0
    assert seen(newest=[good] * 12)[kind] == 0.0
    assert seen(newest=[bad])[kind] is None


def test_every_kind_has_levels_in_their_order() -> None:
    for kind in rules.DEFAULTS.values():
        if kind.level is not None:
            assert kind.clear is not None
            assert (kind.clear > kind.level) == kind.falling
            told = rules.clear_of(kind.name, 0.5 * kind.level)
            assert (told > 0.5 * kind.level) == kind.falling


def test_the_nearest_rule_of_a_kind_is_in_force(monkeypatch: pytest.MonkeyPatch) -> None:
    def row(key: str, silo: str | None = None, place: str | None = None, enabled: bool = True) -> Any:
        return SimpleNamespace(id=key, kind="low", silo=silo, place=place, enabled=enabled)

    site, farm, own = row("site"), row("farm", place="farm"), row("own", silo="silo7")
    monkeypatch.setattr(places, "above", lambda _c, _p: ["barn", "farm"])
    silo = SimpleNamespace(id="silo7", place="barn")
    for known, best in (
        ([site, farm, own], ["own"]),
        ([farm, site], ["farm"]),
        ([site, row("x", place="y")], ["site"]),
    ):
        monkeypatch.setattr(stored, "rules", lambda _c, known=known: known)
        assert [one.id for one in alerts.in_force(None, silo)] == best
    off = [site, row("off", silo="silo7", enabled=False)]
    monkeypatch.setattr(stored, "rules", lambda _c: off)
    assert alerts.in_force(None, silo) == []
