"""Clocks that are wrong and frames that come late: nothing of it in a graph, a rule or the newest answer."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from monitor import farm
from monitor.servers import Server, ago, frame_bytes, serving, write_site
from siloscope.monitor.clock import DAY, HOUR, MINUTE, SECOND, SUSPECT, capture
from siloscope.monitor.publish.image import images
from siloscope.monitor.store import alerts, frames, readings
from siloscope.monitor.store.recording import Recorder
from siloscope.monitor.story import Storyteller


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    folder = tmp_path_factory.mktemp("times")
    with serving(folder / "data", write_site(folder / "site", cameras=2)) as running:
        yield running


EPOCH, FUTURE = "1970-01-01T00:01:00Z", "2041-01-01T00:00:00Z"


@pytest.mark.parametrize("told", [EPOCH, FUTURE, "2001-09-09T01:46:40Z"])
def test_a_clock_that_was_never_set_is_in_no_graph(server: Server, told: str) -> None:
    camera = server.token("camera", "cam8")
    good = server.post("cam8", frame_bytes(0.55, 3), camera, Captured_At=ago(minutes=2))
    server.settled(good.json["frame"])
    before = server.get("/api/v1/silos/silo7/now").json
    wide = "/api/v1/silos/silo7/readings?from=1969-01-01T00:00:00Z&to=2050-01-01T00:00:00Z"
    counted = sum(bucket["count"] for bucket in server.get(f"{wide}&buckets=81").json["items"])
    seed = 100 + len(told) + int(told[2:4])
    frame = server.settled(server.post("cam8", frame_bytes(0.15, seed), camera, Captured_At=told).json["frame"])
    assert (frame["state"], frame["clock"], frame["reading"]["clock"]) == ("measured", SUSPECT, SUSPECT)
    after = server.get("/api/v1/silos/silo7/now").json
    assert (after["reading"], after["state"]) == (before["reading"], "ok")
    assert after["cameras"][1]["last_frame"] != frame["id"]
    assert sum(bucket["count"] for bucket in server.get(f"{wide}&buckets=81").json["items"]) == counted
    assert all(event["start"] > "2025" for event in server.get("/api/v1/silos/silo7/events").json["items"])
    apart = [row for row in server.get(f"{wide}&count=1000").json["items"] if row["frame"] == frame["id"]]
    assert [row["clock"] for row in apart] == [SUSPECT]


def test_a_camera_with_a_clock_of_the_future_still_falls_silent(tmp_path: Path) -> None:
    service = farm.make(tmp_path)
    farm.measured(service, service.clock.now())
    arrival = frames.Arrival("cam7", "f" * 64, service.clock.now() + 900 * DAY, service.clock.now(), SUSPECT, "png", 3)
    Recorder(service.store).record(arrival, lambda: True)
    service.clock.time += farm.LATE
    with service.store.read() as connection:
        assert images(connection, service.clock.now())[0].status == "silent"
        assert frames.newest(connection, "cam7").clock == "good"
    farm.close(service)


@pytest.mark.parametrize("off", [-600 * DAY, 6 * MINUTE, 900 * DAY])
def test_a_time_that_can_not_be_is_suspect_and_an_age_wins_over_it(off: int) -> None:
    assert capture(farm.NOON + off, None, farm.NOON + 0).clock == (SUSPECT if off > 0 else "good")
    found = capture(5 * SECOND, 3 * HOUR, farm.NOON)
    assert (found.time, found.clock) == (farm.NOON - 3 * HOUR, "corrected")


def test_late_frames_take_their_place(server: Server) -> None:
    """Sent in the wrong order, they lie in the order of their times, and the newest stays the newest."""
    token = server.token("camera", "cam7")
    begin = datetime.now(UTC) - timedelta(days=20)
    order = (5, 0, 3, 1, 4, 2)
    for hour in order:
        body = frame_bytes(0.7 - 0.02 * hour, 40 + hour)
        server.settled(
            server.post("cam7", body, token, Captured_At=(begin + timedelta(hours=hour)).isoformat()).json["frame"]
        )
    span = (
        f"from={(begin - timedelta(hours=1)):%Y-%m-%dT%H:%M:%SZ}&to={(begin + timedelta(hours=6)):%Y-%m-%dT%H:%M:%SZ}"
    )
    found = server.get(f"/api/v1/silos/silo7/readings?{span}").json["items"]
    times = [datetime.fromisoformat(row["time"]) for row in found]
    assert [round((time - begin).total_seconds() / 3600) for time in times] == list(range(6))
    volumes = [row["volume_m3"] for row in found]
    assert volumes == sorted(volumes, reverse=True)
    ids = [row["id"] for row in found]
    assert sorted(ids) != ids
    assert datetime.fromisoformat(server.get("/api/v1/silos/silo7/now").json["time"]) > times[-1]


def test_events_are_told_anew_from_where_a_late_frame_lies(tmp_path: Path) -> None:
    service = farm.make(tmp_path)
    begin, now = farm.NOON - 2 * DAY, farm.NOON
    levels = [0.3] * 12 + [0.8] * 12
    late = set(range(8, 16))
    teller = Storyteller(service.store)
    for hour in sorted(range(24), key=lambda hour: (hour in late, hour)):
        farm.reading(service, time=begin + hour * HOUR, fill=levels[hour])
        if hour == 23:
            teller.tell("silo7", begin, now)
    teller.tell("silo7", begin + 8 * HOUR, now)
    with service.store.read() as connection:
        (event,) = readings.events(connection, "silo7", readings.Span())
    assert event.kind == "refill"
    assert begin + 11 * HOUR - SECOND <= event.start < event.end <= begin + 13 * HOUR
    farm.close(service)


def test_no_rule_fires_on_a_late_reading(tmp_path: Path) -> None:
    service = farm.make(tmp_path)
    farm.reading(service, fill=0.6)
    farm.look(service)
    farm.reading(service, time=service.clock.now() - 5 * HOUR, fill=0.01)
    farm.look(service)
    service.clock.time += farm.LATE
    farm.reading(service, time=service.clock.now() - farm.LATE + MINUTE, fill=0.01)  # the newest, but stale
    farm.look(service)
    with service.store.read() as connection:
        assert {row.kind for row in alerts.firing(connection)} == {"no-data"}
    farm.close(service)
