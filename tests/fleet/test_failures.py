"""Kills at random moments, damaged shards, shards that fail: what is committed stays, the rest is done or named."""

from __future__ import annotations

import contextlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from fleet.outputs import answers, files, rows
from siloscope.cli import main
from siloscope.fleet import plan
from siloscope.fleet.running import Opened, run
from siloscope.fleet.tasks import Task

Planned = Callable[[str], str]


@pytest.fixture(scope="module")
def expected(
    store: Path, calibrations: Path, measuring: Any, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, str]:
    place = tmp_path_factory.mktemp("whole") / "run"
    plan.make(store, place, calibrations, measuring)
    run(str(place), workers=2)
    return answers(place)


def started(place: str, *options: str) -> subprocess.Popen[bytes]:
    program = [sys.executable, "-m", "siloscope", "fleet", "run", place, *options]
    return subprocess.Popen(program, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)


def children(process: int) -> Iterator[tuple[int, str]]:
    """All processes below one, with their command lines."""
    for number in (Path("/proc") / str(process) / "task" / str(process) / "children").read_text().split():
        with contextlib.suppress(OSError):
            yield int(number), (Path("/proc") / number / "cmdline").read_text().replace("\0", " ")
            yield from children(int(number))


def some_commits(place: str, least: int, process: subprocess.Popen[bytes]) -> None:
    """Waits until so many tasks are committed."""
    limit = time.monotonic() + 120.0
    while len(files(place, "commits")) < least and process.poll() is None and time.monotonic() < limit:
        time.sleep(0.02)


def ended(process: subprocess.Popen[bytes], patience: float) -> None:
    """Ends a driver and all that it began: its session is its own."""
    try:
        process.wait(patience)
    except subprocess.TimeoutExpired:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def stamps(place: str) -> dict[str, int]:
    """When each committed object was written."""
    done = [json.loads(path.read_text()) for path in Path(place).glob("commits/**/*.json")]
    names = [row["name"] for commit in done for row in commit.get("objects", ())]
    return {name: (Path(place) / name).stat().st_mtime_ns for name in names}


def goes_on(place: str, expected: dict[str, str]) -> None:
    """A re-run completes with the same bytes and writes nothing anew that was committed."""
    before = stamps(place)
    run(place, workers=2)
    assert answers(place) == expected
    after = stamps(place)
    assert {name: after[name] for name in before} == before


def test_a_killed_worker_costs_its_task_one_attempt(planned: Planned, expected: dict[str, str]) -> None:
    place, draw = planned("worker"), random.Random(1)
    process = started(place, "--workers", "2")
    for least in (3, 9, 15):
        some_commits(place, least + draw.randrange(4), process)
        workers = (
            [number for number, line in children(process.pid) if "spawn_main" in line] if process.poll() is None else []
        )
        if workers:
            with contextlib.suppress(ProcessLookupError):
                os.kill(draw.choice(workers), signal.SIGKILL)
    process.wait(300)
    assert process.returncode == 0
    assert answers(place) == expected


def test_a_killed_driver_is_gone_on_with(planned: Planned, expected: dict[str, str]) -> None:
    place, draw = planned("driver"), random.Random(2)
    for least in (2, 14):
        process = started(place, "--workers", "2")
        some_commits(place, least + draw.randrange(6), process)
        workers = list(children(process.pid)) if process.poll() is None else []
        process.kill()
        process.wait()
        for number, _ in workers:  # they see that their driver is gone, and end
            limit = time.monotonic() + 60.0
            while Path(f"/proc/{number}").exists() and time.monotonic() < limit:
                time.sleep(0.05)
            assert not Path(f"/proc/{number}").exists()
    goes_on(place, expected)


@pytest.mark.parametrize("victim", ["raylet", "driver"])
def test_rays_processes_killed(victim: str, planned: Planned, expected: dict[str, str]) -> None:
    pytest.importorskip("ray")
    place = planned(victim)
    process = started(place, "--engine", "ray", "--workers", "2")
    some_commits(place, 4, process)
    assert process.poll() is None
    below = list(children(process.pid))
    raylets = [number for number, line in below if "/raylet/raylet " in line]
    assert raylets
    os.kill(raylets[0] if victim == "raylet" else process.pid, signal.SIGKILL)
    ended(process, 30.0)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    for number, _ in below:
        with contextlib.suppress(ProcessLookupError):
            os.kill(number, signal.SIGKILL)
    goes_on(place, expected)


@pytest.fixture
def own_store(store: Path, tmp_path: Path) -> Path:
    """A copy of the store, to be damaged."""
    return Path(shutil.copytree(store, tmp_path / "store"))


def test_a_shard_that_is_gone_is_named(
    own_store: Path, calibrations: Path, measuring: Any, tmp_path: Path, capsys: Any
) -> None:
    lost = own_store / "silo=silo06" / "camera=cam" / "depth" / "c.1.0.0"
    kept = lost.read_bytes()
    lost.unlink()
    plan.make(own_store, tmp_path / "run", calibrations, measuring)
    place = str(tmp_path / "run")
    assert main(["fleet", "run", place, "--workers", "2", "--json"]) == 5
    shown = capsys.readouterr()
    told = json.loads(shown.out)
    assert [row["shard"] for row in told["failed"]] == ["silo06.cam.000001"]
    assert "no such file" in told["failed"][0]["reason"]
    assert (told["shards"]["left"], told["complete"]) == (1, False)
    assert "silo06.cam.000001" in shown.err
    assert main(["fleet", "run", place]) == 5  # given up: not tried again unless asked to
    assert main(["fleet", "publish", place]) == 2
    lost.write_bytes(kept)
    assert main(["fleet", "run", place, "--retry-failed"]) == 0
    assert main(["fleet", "status", place]) == 0


def test_a_damaged_frame_costs_its_own_reading(
    own_store: Path, calibrations: Path, measuring: Any, tmp_path: Path, capsys: Any
) -> None:
    path = own_store / "silo=silo08" / "camera=cam" / "depth" / "c.0.0.0"
    data = bytearray(path.read_bytes())
    data[1000] ^= 1
    path.write_bytes(data)
    plan.make(own_store, tmp_path / "run", calibrations, measuring)
    assert main(["fleet", "run", str(tmp_path / "run"), "--workers", "2", "--json"]) == 5
    told = json.loads(capsys.readouterr().out)
    assert [row["shard"] for row in told["damaged"]] == ["silo08.cam.000000"]
    assert (told["failed"], told["complete"]) == ([], True)
    unread = [row for row in rows(tmp_path / "run") if row["status"] == "unreadable"]
    assert len(unread) == 1
    assert "fails the checksum" in unread[0]["reason"]
    assert unread[0]["volume_m3"] is None


def test_a_silo_that_shows_no_wall_has_readings_that_say_so(tmp_path: Path) -> None:
    import numpy as np

    from fleet.population import camera
    from siloscope import Frame
    from siloscope.fleet.pack import pack
    from siloscope.fleet.settings import settings
    from siloscope.io import archive

    flat = np.full((240, 320), 1500, np.uint16)
    archive.write(tmp_path / "wall.zarr", [Frame(depth=flat, camera=camera(320), depth_unit=0.001)] * 3)
    pack([tmp_path / "wall.zarr"], tmp_path / "store")
    plan.make(tmp_path / "store", tmp_path / "run", None, settings(None))
    opened, _ = run(str(tmp_path / "run"))
    assert bool(opened.state.measured.all())
    assert {(row["status"], row["volume_m3"]) for row in rows(tmp_path / "run")} == {("refused", None)}


def test_attempts_are_bounded(planned: Planned, monkeypatch: pytest.MonkeyPatch) -> None:
    from siloscope.fleet.driver import ATTEMPTS, drive
    from siloscope.fleet.schedule import Schedule

    opened = Opened.of(planned("attempts"))
    began: list[Task] = []

    class Failing:
        def free(self) -> bool:
            return len(began) == len(told)

        def begin(self, task: Task) -> None:
            began.append(task)

        def ended(self, patience: float) -> list[tuple[Task, str]]:
            told.append(began[-1])
            return [(began[-1], "it can't be done")]

    told: list[Task] = []
    schedule = Schedule(opened.plan, opened.table, opened.state)
    drive(Failing(), schedule, opened.place, opened.plan, opened.account(), lambda _: None)  # type: ignore[arg-type]
    assert {began.count(task) for task in began} == {ATTEMPTS}
    state = Opened.of(opened.place.place).state
    assert len(state.failed) == sum(opened.plan.folds(s) for s in opened.table.series) + len(opened.table) + 9
