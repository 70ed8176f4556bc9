"""A floor learned from frames: the tare, and a discharge that a refill confirms."""

from __future__ import annotations

from pathlib import Path

import pytest

import siloscope
import vessels
from oracle.feed import Feed, Tip
from siloscope.errors import InputError


@pytest.mark.parametrize("kind", ["two_stage", "pyramid", "oblique", "flat_empty"])
def test_against_a_tare_any_floor_gives_a_true_volume(kind: str, tmp_path: Path) -> None:
    empty = vessels.Seen.draw(kind, 1).with_feed(None)
    silo = siloscope.tare(empty.calibration(), [empty.frame])
    assert (silo.floor.kind, silo.floor.evidence) == ("map", "tare")
    silo.save(tmp_path / "silo.json")
    silo = siloscope.Calibration.load(tmp_path / "silo.json")
    nothing = siloscope.measure(empty.again(7).frame, silo, top=empty.top)
    assert nothing.ok
    assert (nothing.volume or 0.0) < 3.0 * (nothing.volume_std or 0.0)
    rim = empty.vessel.bottom.rim
    for level, tip in ((0.7 * rim, None), (0.8 * rim, Tip(0.1, 0.0, rim, -0.5, False))):
        full = empty.with_feed(Feed(level, tip=tip))
        content = siloscope.measure(full.frame, silo, top=empty.top)
        assert content.volume is not None
        off = abs(content.volume - full.content)
        assert off < 0.01 * full.capacity, (off / full.capacity, content.coverage)
        assert off < 4.0 * (content.volume_std or 0.0)


def test_what_a_tare_has_not_seen_may_be_another_stage() -> None:
    """The upper stage alone is seen; a cone fits it, and the hidden lower one is 2 % of the silo."""
    empty = vessels.Seen.draw("two_stage", 901).with_feed(None)
    silo = siloscope.tare(empty.calibration(), [empty.frame])
    assert silo.floor.map is not None
    assert silo.floor.map.completed == "cone"
    nothing = siloscope.measure(empty.again(2).frame, silo, top=empty.top)
    off = (nothing.ullage or 0.0) - empty.capacity
    assert off < -0.01 * empty.capacity
    assert abs(off) < 2.0 * (nothing.ullage_std or 0.0)


def test_a_floor_seen_too_little_for_a_volume_leaves_the_ullage() -> None:
    empty = vessels.Seen.draw("pyramid", 911).with_feed(None)
    silo = siloscope.tare(empty.calibration(), [empty.frame])
    low = empty.vessel.bottom.lowest
    full = empty.with_feed(Feed(low - 0.85 * (low - 0.9)))
    content = siloscope.measure(full.frame, silo, top=empty.top)
    assert content.ok
    assert (content.volume, content.missing) == (None, ("floor",))
    assert "27 % of the floor was seen" in str(content.message)
    assert content.ullage == pytest.approx(full.ullage, abs=2.0 * (content.ullage_std or 0.0))
    assert (content.ullage_std or 1.0) < 0.03 * full.capacity


def test_an_empty_frame_that_shows_no_floor_is_no_tare() -> None:
    empty = vessels.Seen.draw("oblique", 1)
    dark = siloscope.Frame(depth=0.0 * empty.frame.depth, camera=empty.camera)
    with pytest.raises(InputError, match="quarter"):
        siloscope.tare(empty.calibration(), [dark])


def _story(levels: tuple[float, ...]) -> tuple[vessels.Seen, siloscope.Calibration]:
    empty = vessels.Seen.draw("oblique", 1).with_feed(None)
    lowest, rim = empty.vessel.bottom.lowest, empty.vessel.bottom.rim
    frames = [
        empty.with_feed(Feed(lowest - level * (lowest - 0.6 * rim))).again(k).frame for k, level in enumerate(levels)
    ]
    return empty, siloscope.learn_floor(empty.calibration(), frames)


def test_a_floor_seen_before_and_after_a_fill_is_learned() -> None:
    empty, silo = _story((0.1, 0.02, 0.9, 0.5, 0.02))
    assert (silo.floor.kind, silo.floor.evidence) == ("map", "discharge")
    full = empty.with_feed(Feed(0.8 * empty.vessel.bottom.rim))
    content = siloscope.measure(full.frame, silo, top=empty.top)
    assert content.volume == pytest.approx(full.content, abs=0.01 * full.capacity)


def test_a_discharge_alone_proves_nothing() -> None:
    _, silo = _story((0.9, 0.5, 0.2, 0.02))
    assert silo.floor.kind == "unknown"
