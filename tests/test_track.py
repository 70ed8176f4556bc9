"""The story of a silo: events, use and forecast from made-up readings with known truth."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import siloscope
from silos import known, scene
from siloscope.content import Content, Parts
from siloscope.errors import InputError, UsageError
from siloscope.simulation import Feed
from siloscope.tracking.events import events, legs
from siloscope.tracking.story import reading_of, track_of
from siloscope.tracking.use import Rate, forecast, use
from siloscope.types.track import DAY, utc

START = 1_772_000_000.0


def story(volumes: list[float | None], hours: float = 1.0, noise: float = 0.002) -> siloscope.Track:
    """A track of readings with these volumes; None is a refused one."""
    readings = []
    for i, volume in enumerate(volumes):
        parts = Parts(0.01, 0.01, 0.0, noise, 0.0, 0.0)
        content = (
            Content("refused", "too-little-seen")
            if volume is None
            else Content("ok", volume=volume, volume_std=0.02, parts=parts, capacity=10.0, mass=600.0 * volume)
        )
        readings.append(reading_of(i, START + 3600.0 * hours * i, content))
    return track_of(readings, capacity=10.0)


def test_what_readings_share_grows_with_the_volume_and_stays_in_a_difference() -> None:
    """A radius that is off by 1 % makes each volume off by 2 %, and their difference too."""
    volume = np.array([10.0, 10.0, 4.0, 4.0])
    own, shared = np.full(4, 0.003), 0.02 * volume
    (alone,) = events(np.arange(4.0), volume, own)
    (whole,) = events(np.arange(4.0), volume, own, std=np.hypot(own, shared))
    assert alone.volume_std == alone.own_std == whole.own_std == pytest.approx(0.003 * np.sqrt(2.0))
    assert whole.volume_std == pytest.approx(np.hypot(0.003 * np.sqrt(2.0), 0.02 * 6.0))


def test_a_quiet_silo_has_no_events() -> None:
    draw = np.random.default_rng(0)
    assert story(list(5.0 + 0.002 * draw.standard_normal(200))).events == ()


def test_refills_and_withdrawals_with_their_amounts() -> None:
    falling = list(np.linspace(6.0, 2.0, 41))
    found = story([*falling, 2.0, 2.0, *np.linspace(3.0, 8.0, 6), 8.0, 8.0, *np.linspace(7.9, 5.0, 30)])
    assert [e.kind for e in found.events] == ["withdrawal", "refill", "withdrawal"]
    assert [e.volume for e in found.events] == pytest.approx([4.0, 6.0, 3.0], abs=1e-9)
    refill = found.events[1]
    assert (refill.first, refill.last) == (42, 48)
    assert refill.mass == pytest.approx(600.0 * 6.0)
    assert refill.volume_std == pytest.approx(0.002 * np.sqrt(2.0))


def test_refused_readings_are_passed_over() -> None:
    found = story([6.0, 5.5, None, 4.5, 4.0])
    assert [e.volume for e in found.events] == pytest.approx([2.0])
    assert found.readings[3].flow == pytest.approx(-0.5)
    assert found.readings[2].flow is None
    assert found.counts == {"ok": 4, "refused": 1, "unreadable": 0}


def test_the_forecast_covers_what_comes() -> None:
    """Days of use drawn from one distribution: the date of emptiness lies in the band about as often as stated."""
    draw = np.random.default_rng(2)
    inside = 0
    for _ in range(100):
        use = np.maximum(draw.normal(0.5, 0.15, 60), 0.0)
        left = 12.0 - np.concatenate([[0.0], np.cumsum(use)])
        found = story(list(left[:11]), hours=24.0).use
        assert found is not None
        assert found.earliest is not None
        empty = START + DAY * float(np.interp(0.0, -left, np.arange(61.0)))
        inside += found.earliest <= empty <= (found.latest or np.inf)
    assert 88 <= inside <= 100


def test_daily_use_counts_what_is_taken_between_refills() -> None:
    day = [5.0 - 0.1 * h for h in range(25)]
    found = story([*day, *(v + 2.0 for v in day), *(v + 1.0 for v in day)])
    assert found.use is not None
    assert found.use.daily == pytest.approx(3 * 2.4 / (74.0 / 24.0), rel=0.02)


def test_less_than_a_day_tells_no_daily_use() -> None:
    assert story(list(np.linspace(6.0, 2.0, 24))).use is None
    assert story(list(np.linspace(6.0, 2.0, 26))).use is not None


def test_flow_into_emptiness_weighs_what_was_there() -> None:
    assert story([2.0, 0.0]).readings[1].mass_flow == pytest.approx(-1.2)


def test_only_frames_taken_together_tell_that_the_content_moves() -> None:
    frames = [scene(Feed("mound", level)).render().frame() for level in (0.45, 0.44)]
    silo = known(scene(None))
    for interval, codes in ((60.0, ("filling-in-progress",)), (3600.0, ()), (None, ())):
        assert siloscope.track(frames, silo, interval=interval).readings[1].quality == codes


def test_without_times_there_is_no_use() -> None:
    readings = [reading_of(i, None, Content("ok", volume=5.0 - i, volume_std=0.1)) for i in range(4)]
    assert track_of(readings).use is None


@given(st.lists(st.floats(0.0, 10.0), min_size=2, max_size=60), st.floats(0.01, 3.0))
def test_legs_take_turns_and_each_is_large_enough(volumes: list[float], least: float) -> None:
    volume = np.array(volumes)
    found = list(legs(volume, np.full(len(volume), least / np.sqrt(2.0) * (1.0 + 1e-9))))
    assert all(abs(volume[b] - volume[a]) > least * (1.0 - 1e-12) and b > a for a, b in found)
    signs = [np.sign(volume[b] - volume[a]) for a, b in found]
    assert all(s != t for s, t in itertools.pairwise(signs))
    assert all(one[1] == other[0] for one, other in itertools.pairwise(found))
    if np.ptp(volume) <= least:
        assert found == []


def test_a_level_without_a_cone_is_over_the_lowest_point_of_the_story() -> None:
    made = [scene(Feed("flat", level)) for level in (0.8, 0.7)]
    silo = known(made[0])
    assert silo.parameters is not None
    values = silo.parameters.copy()
    values[5:7] = np.nan
    blind = replace(silo, parameters=values, silo=siloscope.SiloGeometry(radius=silo.silo.radius))
    found = siloscope.track([m.render().frame() for m in made], blind)
    assert found.height_datum == "lowest-seen"
    assert found.readings[0].level == pytest.approx(0.1 * made[0].silo.height, abs=5e-3)
    assert found.readings[1].level == pytest.approx(0.0, abs=5e-3)
    assert found.readings[0].volume is None


def test_no_frames_at_all() -> None:
    with pytest.raises(InputError, match="no frame"):
        siloscope.track([], known(scene(Feed("flat", 0.4))))


@pytest.mark.parametrize(
    "times", [{"interval": 0.0}, {"interval": float("nan")}, {"interval": 1e300}, {"start": START},
              {"interval": 60.0, "start": float("inf")}],
)  # fmt: skip
def test_times_that_can_not_be_are_refused(times: dict[str, Any]) -> None:
    with pytest.raises(UsageError, match="interval"):
        siloscope.track([], known(scene(Feed("flat", 0.4))), **times)


def test_a_clock_that_was_set_in_between_tells_no_use() -> None:
    falling = story([9.0 - 0.5 * i for i in range(8)], hours=24.0)
    assert falling.use is not None
    jumping = story([9.0 - 0.5 * i for i in range(8)], hours=1e15)
    assert jumping.use is None


def test_only_absolute_times_are_dates() -> None:
    assert utc(START) == "2026-02-25T06:13:20Z"
    assert utc(12.0) is None
    assert utc(None) is None


def test_stored_readings_give_events_and_use_without_a_frame() -> None:
    """What a service has in its database is enough: times, volumes, deviations."""
    volume = np.concatenate([np.linspace(6.0, 2.0, 41), np.linspace(3.0, 8.0, 6), np.linspace(7.9, 5.0, 30)])
    time = START + 3600.0 * np.arange(len(volume))
    own, std = np.full(len(volume), 0.002), np.full(len(volume), 0.02)
    found = events(time, volume, own, capacity=10.0, mass=600.0 * volume)
    same = story(list(volume))
    assert [event.to_dict() for event in found] == [event.to_dict() for event in same.events]
    assert use(time, volume, std, found) == same.use
    unknown = np.full(len(volume), np.nan)
    assert [(e.start, e.mass, e.kind) for e in events(unknown, volume, unknown)] == [
        (None, None, "withdrawal"),
        (None, None, "refill"),
        (None, None, "withdrawal"),
    ]
    assert use(unknown, volume, std, found) is None
    assert events([], [], []) == ()


def test_the_forecast_of_a_steady_use_is_its_quotient() -> None:
    empty, earliest, latest = forecast(6.0, 0.0, Rate(0.5, 0.0, 0.0))
    assert empty == earliest == latest == pytest.approx(12.0, abs=1e-6)
    assert forecast(6.0, 0.0, Rate(1e-6, 0.0, 0.0)) == (None, None, None)
