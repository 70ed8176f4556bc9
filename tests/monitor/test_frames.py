"""From a camera's frame to the answer: the way through the whole service."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from monitor.servers import Server, ago, eventually, frame_bytes, problem, serving, true_volume, write_site


@pytest.fixture(scope="module")
def server(shared: Server) -> Server:
    return shared


@pytest.fixture(scope="module")
def token(server: Server) -> str:
    return server.token("camera", "cam7")


def test_a_frame_becomes_a_reading_with_its_deviation_and_age(server: Server, token: str) -> None:
    body = frame_bytes(0.5)
    taken = server.post("cam7", body, token, Captured_At=ago(minutes=3))
    assert taken.status == 201
    frame = server.settled(taken.json["frame"])
    assert (frame["state"], frame["sha256"], frame["clock"]) == ("measured", hashlib.sha256(body).hexdigest(), "good")
    reading = frame["reading"]
    assert abs(reading["volume_m3"] - true_volume(0.5)) < 4 * reading["volume_std_m3"]
    now = server.get("/api/v1/silos/silo7/now").json
    assert (now["state"], now["stale"], now["frame"]) == ("ok", False, frame["id"])
    assert 170 < now["age_s"] < 300
    assert now["mass_kg"] == pytest.approx(reading["volume_m3"] * 770, rel=0.2)
    surface = server.get("/api/v1/silos/silo7/surface").json
    assert len(surface["heights_m"]) == len(surface["seen"]) == surface["side"] == 32
    assert server.get(f"/api/v1/frames/{frame['id']}/content").body == body


def test_the_same_bytes_are_the_same_frame(server: Server, token: str) -> None:
    first = server.post("cam7", frame_bytes(0.4), token)
    again = server.post("cam7", frame_bytes(0.4), token)
    assert (first.status, again.status) == (201, 200)
    assert first.json == again.json
    other = server.post("cam8", frame_bytes(0.4), server.token("camera", "cam8"))
    assert other.status == 201
    assert other.json != first.json


def test_what_is_no_frame_is_refused_by_name(server: Server, token: str) -> None:
    body = frame_bytes(0.3)
    assert problem(server.post("cam7", body, token, Content_SHA256="0" * 64)) == (409, "hash-differs")
    assert problem(server.post("cam7", body, token, Content_SHA256="xyz")) == (422, "invalid")
    assert problem(server.post("cam7", body, token, Captured_At="yesterday")) == (422, "invalid")
    assert problem(server.post("cam7", body, token, Captured_At="2026-01-01T00:00:00")) == (422, "invalid")
    assert problem(server.post("cam7", b"", token)) == (422, "invalid")
    assert problem(server.post("cam7", b"<html>nothing</html>", token)) == (415, "unknown-format")
    assert problem(server.post("cam7", b"\x89PNG\r\n\x1a\n" + bytes(17 << 20), token)) == (413, "too-large")
    assert problem(server.post("cam9", body, server.token("admin"))) == (404, "not-found")


def test_only_the_cameras_own_token_may_send(server: Server, token: str) -> None:
    body = frame_bytes(0.3)
    assert problem(server.ask("POST", "/api/v1/cameras/cam7/frames", body)) == (401, "unauthorized")
    assert problem(server.post("cam7", body, "wrong")) == (401, "unauthorized")
    assert problem(server.post("cam8", body, token)) == (403, "forbidden")
    assert problem(server.post("cam7", body, server.token("read"))) == (403, "forbidden")
    assert problem(server.get("/api/v1/silos/silo7/now", token)) == (404, "not-found")


def test_a_damaged_frame_fails_with_its_reason(server: Server, token: str) -> None:
    taken = server.post("cam7", frame_bytes(0.3)[:5000], token)
    assert taken.status == 201
    frame = server.settled(taken.json["frame"])
    assert frame["state"] == "failed"
    assert "PNG" in frame["error"]


def test_frames_wait_for_a_calibration_where_there_is_none(tmp_path: Path) -> None:
    with serving(tmp_path / "data", write_site(tmp_path / "site", calibrated=False)) as server:
        taken = server.post("cam7", frame_bytes(0.5), server.token("camera", "cam7"))
        assert eventually(lambda: server.settled(taken.json["frame"]))["state"] == "gathering"
        assert server.get("/api/v1/silos/silo7/now").json["state"] == "no-calibration"
