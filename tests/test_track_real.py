"""`track` on real life: times in names, ullage, outages, outliers, going on, frames at the same time."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import siloscope
import stories
from silos import known, noisy, scene
from siloscope.cli import main
from siloscope.errors import InputError
from siloscope.io.writers import write_camera, write_npy
from siloscope.simulation import Feed
from siloscope.tracking.clock import Clock, time_in_name
from siloscope.tracking.outliers import gaps, outliers
from siloscope.tracking.story import track_of
from siloscope.types.floor import Floor
from siloscope.types.track import DAY, Reading

MADE = noisy(scene(Feed("mound", 0.45)))
HOUR = 3600.0


@pytest.mark.parametrize(
    ("name", "time"),
    [
        ("2026-03-01T06:00:00Z.png", 1772344800.0),
        ("march/cam1_20260301_060000.png", 1772344800.0),
        ("IMG_20260301-060000123.png", None),
        ("2026-03-01 06.00.00.png", 1772344800.0),
        ("20260301T070000+0100_depth.npy", 1772344800.0),
        ("depth_2026-03-01_06-00.npy", 1772344800.0),
        ("frame-1772344800.npy", 1772344800.0),
        ("1772344800250.png", 1772344800.25),
        ("1772344800.250000.png", 1772344800.25),
        ("frame_000123.png", None),
        ("20261301_060000.png", None),
        ("silo7.png", None),
    ],
)
def test_times_in_names(name: str, time: float | None) -> None:
    assert time_in_name(name) == time


def test_a_name_s_time_wins_over_the_interval() -> None:
    clock = Clock(60.0, 0.0)
    assert clock.time(3, None, "20260301_060000.png") == 1772344800.0
    assert clock.time(3, 1.7e9, "20260301_060000.png") == 1.7e9
    assert clock.time(3, None, "3.png") == 180.0
    assert clock.time(3, 12.5, "recording.bag") == 12.5


def readings(
    volumes: Sequence[float] | NDArray[np.float64], own: float = 0.01, coverage: float = 0.8, ullage: bool = False
) -> list[Reading]:
    """Hourly readings."""
    return [
        Reading(
            k, f"{k}.png", 1.7e9 + HOUR * k, "ok", None, None if ullage else v, None if ullage else 0.1,
            coverage=coverage, ullage=20.0 - v, ullage_std=0.1, own_std=own, density=700.0,
        )
        for k, v in enumerate(volumes)
    ]  # fmt: skip


class TestOutliers:
    def test_a_spike_makes_no_refill(self) -> None:
        volumes = np.linspace(10.0, 8.0, 30)
        spiked = volumes.copy()
        spiked[11] += 3.0
        clean, found = track_of(readings(volumes)), track_of(readings(spiked))
        assert [e.kind for e in found.events] == [e.kind for e in clean.events] == ["withdrawal"]
        assert found.readings[11].quality == ("outlier",)
        assert found.use is not None
        assert clean.use is not None
        assert found.use.daily == pytest.approx(clean.use.daily, rel=1e-6)

    def test_a_refill_is_none(self) -> None:
        volumes = [5.0, 4.9, 4.8, 9.0, 8.9, 8.8]
        assert not outliers(volumes, [0.01] * 6, [0.8] * 6).any()
        assert [e.kind for e in track_of(readings(volumes)).events][1] == "refill"

    def test_a_refill_is_not_told_from_one_partly_seen_frame(self) -> None:
        told = readings([5.0, 5.0, 5.0, 5.0, 9.0])
        assert len(track_of(told).events) == 1
        told[-1] = replace(told[-1], coverage=0.1)
        assert track_of(told).events == ()


def test_a_month_s_refills_are_told_and_no_others() -> None:
    """Dust, outages, strayed readings, a dirty lens, a moved camera; `python -m benchmarks.track` asks more months."""
    held = []
    for seed in range(6):
        story = stories.draw(seed)
        for ullage in (False, True):
            told = [replace(r, volume=None, volume_std=None) if ullage else r for r in story.readings]
            found = track_of(told, capacity=story.capacity)
            refills = tuple((e.start or 0.0, e.end or 0.0) for e in found.events if e.kind == "refill")
            assert stories.refills(story, refills) == (0, 0), (seed, ullage)
        for day in (9.0, 17.0, 25.0):
            use = track_of(stories.until(story, day), capacity=story.capacity).use
            assert use is not None
            truth = story.empty_at(stories.START + DAY * day)
            held.append((use.earliest or 0.0) <= truth <= (use.latest or math.inf))
    assert np.mean(held) >= 0.85


def test_a_moved_camera_makes_no_refill() -> None:
    volumes = np.linspace(10.0, 8.0, 40)
    told = readings(volumes)
    moved = [replace(r, volume=(r.volume or 0.0) + 0.3, quality=("camera-moved",)) for r in told[20:]]
    assert [e.kind for e in track_of([*told[:20], *moved]).events] == ["withdrawal"]
    filled = [replace(r, volume=(r.volume or 0.0) + 3.0) for r in moved]
    assert [e.kind for e in track_of([*told[:20], *filled]).events] == ["withdrawal", "refill", "withdrawal"]


def test_a_delivery_is_told_by_the_clean_readings_about_its_dust() -> None:
    volumes = [5.0, 4.9, 4.8, 7.0, 3.0, 8.0, 8.9, 8.8, 8.7]
    told = readings(volumes)
    dusty = [replace(r, quality=("dust-or-fog",)) if k in (3, 4, 5) else r for k, r in enumerate(told)]
    refills = [e for e in track_of(dusty).events if e.kind == "refill"]
    assert [(e.first, e.last) for e in refills] == [(2, 6)]
    assert refills[0].volume == pytest.approx(4.1)


def test_gaps_are_gaps() -> None:
    times = [HOUR * k for k in (0, 1, 2, 3, 50, 51, 52)]
    assert gaps(times) == ((3 * HOUR, 50 * HOUR),)
    assert gaps(times[:4]) == ()


def test_the_story_is_told_by_ullage_where_the_bottom_is_unknown() -> None:
    volumes = [*np.linspace(10.0, 6.0, 30), *np.linspace(14.0, 11.0, 30)]
    plain, free = track_of(readings(volumes)), track_of(readings(volumes, ullage=True))
    assert (plain.basis, free.basis) == ("volume", "ullage")
    assert [(e.kind, e.first, e.last) for e in free.events] == [(e.kind, e.first, e.last) for e in plain.events]
    assert [e.volume for e in free.events] == pytest.approx([e.volume for e in plain.events])
    assert [e.mass for e in free.events] == pytest.approx([700.0 * e.volume for e in free.events])
    assert free.use is not None
    assert plain.use is not None
    assert free.use.daily == pytest.approx(plain.use.daily)
    assert free.use.empty_by is None, "only a known bottom tells when it is reached"
    assert free.use.lowest_by is not None
    until = free.use.lowest_by - (free.readings[-1].time or 0.0)
    assert until == pytest.approx((11.0 - 6.0) / free.use.daily * DAY, rel=1e-3)
    assert free.readings[7].flow == pytest.approx(plain.readings[7].flow)


@pytest.fixture(scope="module")
def story(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six hourly frames with their times in the names, a calibration and a camera."""
    folder = tmp_path_factory.mktemp("story")
    known(MADE).save(folder / "silo.json")
    write_camera(MADE.camera, folder / "camera.json")
    (folder / "frames").mkdir()
    for k, level in enumerate((0.6, 0.55, 0.5, 0.7, 0.65, 0.6)):
        seen = replace(MADE, feed=Feed("mound", level), seed=k).render()
        write_npy(folder / "frames" / f"20260301_{6 + k:02d}0000.npy", seen.measured.astype(np.float32))
    return folder


def run(story: Path, frames: list[Path], *more: str) -> int:
    where = ["--calibration", str(story / "silo.json"), "--camera", str(story / "camera.json")]
    return main(["track", *map(str, frames), *where, *more])


def test_going_on_counts_no_frame_twice(story: Path, tmp_path: Path) -> None:
    frames = sorted((story / "frames").iterdir())
    assert run(story, frames, "--jobs", "1", "--out", str(tmp_path / "whole"), "--name", "Silo 7") == 0
    assert run(story, frames[:3], "--out", str(tmp_path / "first")) == 0
    more = ["--continue", str(tmp_path / "first" / "track.json"), "--jobs", "2"]
    assert run(story, frames[1:], *more, "--out", str(tmp_path / "both")) == 0
    whole, both = (json.loads((tmp_path / name / "track.json").read_text()) for name in ("whole", "both"))
    assert [r["digest"] for r in both["readings"]] == [r["digest"] for r in whole["readings"]]
    assert both["events"] == whole["events"]
    assert whole["readings"][0]["time_utc"] == "2026-03-01T06:00:00Z"
    assert "Silo 7" in (tmp_path / "whole" / "report.html").read_text("utf-8")


def test_a_damaged_track_is_named(story: Path, tmp_path: Path) -> None:
    (tmp_path / "track.json").write_text('{"schema": "siloscope.track/1", "readings": [{"index": -1}]}')
    with pytest.raises(InputError, match="readings"):
        siloscope.track(
            sorted((story / "frames").iterdir()), story / "silo.json", continue_from=tmp_path / "track.json"
        )


def test_an_unknown_bottom_still_tells_the_refill(story: Path) -> None:
    untold = replace(known(MADE), floor=Floor())
    frames = [replace(MADE, feed=Feed("mound", at), seed=k).render() for k, at in enumerate((0.6, 0.55, 0.5, 0.7))]
    taken = [replace(seen.frame(), timestamp=1.7e9 + HOUR * k) for k, seen in enumerate(frames)]
    found = siloscope.track(taken, untold)
    assert found.basis == "ullage"
    refill = next(event for event in found.events if event.kind == "refill")
    assert refill.volume == pytest.approx(frames[3].true_volume - frames[2].true_volume, rel=0.01)
