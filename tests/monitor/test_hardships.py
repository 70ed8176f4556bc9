"""The word that an acknowledged frame is there for good: kept under kills, power cuts and full disks.

Short here; `make monitor-proof` does it at length.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from monitor import hardships

needs_disks = pytest.mark.skipif(not hardships.may_mount(), reason="this machine lets no test mount a disk of its own")


def test_no_acknowledged_frame_is_lost_by_kills(tmp_path: Path) -> None:
    found = hardships.kills(tmp_path, 4)
    assert found.acknowledged > 50
    assert found.lost == 0


def test_the_test_of_kills_notices_a_broken_word(tmp_path: Path) -> None:
    assert hardships.kills(tmp_path, 2, careless="acknowledge-first").lost > 0


@needs_disks
def test_no_acknowledged_frame_is_lost_by_a_power_cut(tmp_path: Path) -> None:
    found = hardships.power_cuts(tmp_path, 2)
    assert found.acknowledged > 10
    assert found.lost == 0


@needs_disks
def test_the_test_of_power_cuts_notices_missing_flushes(tmp_path: Path) -> None:
    assert hardships.power_cuts(tmp_path, 1, careless="no-flush").lost > 0


@needs_disks
def test_a_full_disk_refuses_and_goes_on_when_there_is_room(tmp_path: Path) -> None:
    found, before = hardships.full_disk(tmp_path)
    assert set(found.refused) == {507}
    assert 10 < before < found.acknowledged
    assert found.lost == 0
