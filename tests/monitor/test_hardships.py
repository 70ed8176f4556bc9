"""The word that an acknowledged frame is there for good: kept under kills, power cuts and full disks.

Short here; `make monitor-proof` does it at length.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from monitor import hardships
from monitor.servers import frame_bytes, serving, write_site

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


def test_an_empty_file_after_a_power_cut_is_made_anew_or_named(tmp_path: Path) -> None:
    """What a cut left empty under a whole name: a calibration's file, and the bytes of a waiting frame."""
    data, site = tmp_path / "data", write_site(tmp_path / "site")
    with serving(data, site) as server:
        token = server.token("camera", "cam7")
        done = server.settled(server.post("cam7", frame_bytes(0.5), token).json["frame"])
        server.kill()
    (calibration,) = (data / "calibrations").glob("*.json")
    with serving(data, site, "--workers", "0") as server:
        waiting = server.post("cam7", frame_bytes(0.4), token).json["frame"]
        sha256 = server.get(f"/api/v1/frames/{waiting}").json["sha256"]
        server.kill()
    (data / "frames" / sha256[:2] / sha256).write_bytes(b"")
    assert done["state"] == "measured"
    for _ in range(2):
        calibration.write_bytes(b"")
        with serving(data, site) as server:
            lost = server.settled(waiting)
            assert (lost["state"], lost["kept"]) == ("failed", False)
            assert "send the frame again" in lost["error"]
            again = server.settled(server.post("cam7", frame_bytes(0.6), token).json["frame"])
            assert again["state"] == "measured"
            server.kill()
    with serving(data, site) as server:
        assert server.post("cam7", frame_bytes(0.4), token).status == 201
        assert server.settled(waiting)["state"] == "measured"
