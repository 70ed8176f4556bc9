"""A monitor's frames sealed, measured by a run, and brought back: the new readings count, the old ones stay."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("fastapi", reason="a monitor needs the extra [monitor]")

from monitor.servers import Server, eventually, frame_bytes, serving, write_site
from monitor.test_store import new_url, postgres  # noqa: F401  (a fixture)
from siloscope.cli import main
from siloscope.client import Client

LEVELS = (0.7, 0.6, 0.5, 0.4, 0.3)

TIMES = [f"2026-11-{day:02d}T06:00:00.25Z" for day in (26, 27, 28, 29, 30)]


@pytest.fixture(scope="module", params=["sqlite", "postgresql"])
def monitor(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Server, Any]]:
    """A running monitor with five measured frames, and its database's URL."""
    folder = tmp_path_factory.mktemp("monitor")
    url = None if request.param == "sqlite" else new_url(request, folder, "postgresql")
    options = () if url is None else ("--database", url)
    with serving(folder / "data", write_site(folder / "site"), *options) as server:
        token = _token(server, url)
        for level, time in zip(LEVELS, TIMES, strict=True):
            taken = server.post("cam7", frame_bytes(level, 7), token, Captured_At=time)
            assert server.settled(taken.json["frame"])["state"] == "measured"
        yield server, url


def _token(server: Server, url: str | None) -> str:
    from siloscope.monitor import administration

    return str(administration.token(server.data, url, "camera", "cam7", None)["token"])


def command(*words: Any, url: str | None = None, code: int = 0) -> None:
    more = [] if url is None else ["--database", url]
    assert main([str(word) for word in words] + more) == code


def told_by(capsys: Any, *words: Any, url: str | None = None) -> Any:
    """The document that a command prints."""
    capsys.readouterr()
    command(*words, "--json", url=url)
    return json.loads(capsys.readouterr().out)


def _kinds(server: Server) -> list[str]:
    return [event["kind"] for event in server.get("/api/v1/silos/silo7/events").json["items"]]


def test_a_run_comes_back_as_a_run_and_keeps_the_old_readings(
    monitor: tuple[Server, Any], tmp_path: Path, capsys: Any
) -> None:
    server, url = monitor
    client = Client(server.root)
    before = list(client.readings("silo7"))
    # the story is told a moment after the readings it is of
    kinds = eventually(lambda: _kinds(server))
    store, run = tmp_path / "store", tmp_path / "run"
    packed = told_by(capsys, "pack", "--monitor", server.data, "-o", store, url=url)
    assert (packed["frames"], packed["series"], packed["problems"]) == (5, {"silo7.cam7": 5}, [])
    assert told_by(capsys, "pack", "--monitor", server.data, "-o", store, url=url)["present"] == 5
    command("fleet", "plan", store, "--out", run)
    command("fleet", "run", run, "--workers", 1)
    told = told_by(capsys, "fleet", "publish", run, "--monitor", server.data, url=url)
    assert (told["added"], told["with_frame"], told["left_out"]) == (5, 5, 0)

    after = eventually(lambda: [row for row in client.readings("silo7") if row["run"] == told["monitor_run"]])
    assert [row["frame"] for row in after] == [row["frame"] for row in before]
    assert [row["time"] for row in after] == [row["time"] for row in before]
    assert [row["calibration"] for row in after] == [row["calibration"] for row in before]
    for new, old in zip(after, before, strict=True):  # the same program with the same settings: the same answer
        for name in ("volume_m3", "volume_std_m3", "mass_kg", "fill_fraction", "capacity_m3", "coverage"):
            assert new[name] == pytest.approx(old[name], rel=1e-6), name
        assert new["level_m"]["max"] == pytest.approx(old["level_m"]["max"])
        assert [one["code"] for one in new["quality"]] == [one["code"] for one in old["quality"]]
    first = before[0]["run"]
    kept = server.get(f"/api/v1/silos/silo7/readings?run={first}").json["items"]
    assert [row["id"] for row in kept] == [row["id"] for row in before]
    assert all(row["superseded"] for row in kept)
    runs = {one["id"]: one for one in server.get("/api/v1/silos/silo7/runs").json["items"]}
    assert (runs[told["monitor_run"]]["origin"], runs[told["monitor_run"]]["config"]) == ("fleet", told["run"])
    assert [(runs[key]["current"], runs[key]["replaced"]) for key in (told["monitor_run"], first)] == [(5, 0), (0, 5)]
    assert server.get("/api/v1/silos/silo7/now").json["reading"] == after[-1]["id"]
    assert server.get("/api/v1/silos/silo7/surface").json["reading"] == before[-1]["id"]
    assert kinds == ["withdrawal"]
    assert eventually(lambda: _kinds(server) == kinds)

    again = told_by(capsys, "fleet", "publish", run, "--monitor", server.data, url=url)
    assert (again["added"], again["again"], again["monitor_run"]) == (0, 5, told["monitor_run"])
    assert len(list(client.readings("silo7"))) == 5

    other = tmp_path / "other"  # another run with another product, then the first one again
    command("fleet", "plan", store, "--out", other, "--product", "barley")
    command("fleet", "run", other, "--workers", 1)
    command("fleet", "publish", other, "--monitor", server.data, url=url)
    masses = [row["mass_kg"] for row in client.readings("silo7")]
    assert all(mass < 0.95 * row["mass_kg"] for mass, row in zip(masses, before, strict=True))
    command("fleet", "publish", run, "--monitor", server.data, url=url)
    assert [row["run"] for row in client.readings("silo7")] == [told["monitor_run"]] * 5


def test_what_the_monitor_does_not_know_is_named(
    monitor: tuple[Server, Any], archives: list[Path], calibrations: Path, measuring: Any, tmp_path: Path, capsys: Any
) -> None:
    from siloscope.fleet import plan
    from siloscope.fleet.pack import pack

    server, url = monitor
    pack(archives[3:4], tmp_path / "store")
    plan.make(tmp_path / "store", tmp_path / "run", calibrations, measuring)
    command("fleet", "publish", tmp_path / "run", "--monitor", server.data, url=url, code=2)
    assert "shards of run" in capsys.readouterr().err
    command("fleet", "publish", tmp_path / "run", "--monitor", server.data, "--partial", url=url, code=3)
    assert "no camera 'cam' in a silo 'silo03'" in capsys.readouterr().err
    command("pack", "--monitor", tmp_path, "-o", tmp_path / "none", code=3)
    command("pack", "-o", tmp_path / "none", code=2)
    command("pack", archives[0], "--monitor", server.data, "-o", tmp_path / "none", code=2)


def test_frames_of_two_calibrations_are_two_series(tmp_path: Path, capsys: Any) -> None:
    """A camera that was moved: what it saw before is measured as it was then."""
    folder = tmp_path
    with serving(folder / "data", write_site(folder / "site")) as server:
        token, admin = server.token("camera", "cam7"), server.token("admin")
        for level, time in zip(LEVELS[:2], TIMES[:2], strict=True):
            server.settled(server.post("cam7", frame_bytes(level, 8), token, Captured_At=time).json["frame"])
        document = json.loads((folder / "site" / "silo7.json").read_text())
        document["t_x"] += 1e-9
        assert server.send("PUT", "/api/v1/silos/silo7/calibration", document, admin).status == 200
        server.settled(server.post("cam7", frame_bytes(0.5, 8), token).json["frame"])
        packed = told_by(capsys, "pack", "--monitor", server.data, "-o", folder / "store")
        (second,) = set(packed["series"]) - {"silo7.cam7"}
        assert (packed["series"]["silo7.cam7"], packed["series"][second]) == (2, 1)
        command("fleet", "plan", folder / "store", "--out", folder / "run")
        command("fleet", "run", folder / "run", "--workers", 1)
        before = [(row["calibration"], row["frame"]) for row in Client(server.root).readings("silo7")]
        assert told_by(capsys, "fleet", "publish", folder / "run", "--monitor", server.data)["with_frame"] == 3
        assert [(row["calibration"], row["frame"]) for row in Client(server.root).readings("silo7")] == before
        assert len({calibration for calibration, _ in before}) == 2
