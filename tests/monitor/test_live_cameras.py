"""Cameras that the service drives itself: folders, commands, devices; killed, failing, refused, aimed."""

from __future__ import annotations

import hashlib
import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monitor import farm
from monitor.farm import Farm
from monitor.servers import Server, eventually, frame_bytes, serving, write_site
from siloscope import Camera, Frame, UsageError
from siloscope.cli import main
from siloscope.io import open as open_frames
from siloscope.monitor.live import driver
from siloscope.monitor.live.attach import attach
from siloscope.monitor.live.captures import LiveSource
from siloscope.monitor.live.command import CommandSource
from siloscope.monitor.live.device import DeviceSource, file_of
from siloscope.monitor.live.driver import Driver
from siloscope.monitor.live.folder import FolderSource
from siloscope.monitor.publish import metrics
from siloscope.monitor.store import frames, live

LARGEST = 16 << 20

LONG_AGO = 3600.0


def written(folder: Path, name: str, body: bytes) -> Path:
    """A file that was complete an hour ago."""
    path = folder / name
    path.write_bytes(body)
    then = time.time() - LONG_AGO
    os.utime(path, (then, then))
    return path


def driven(folder: Path, source: str, *, cameras: int = 1) -> Path:
    """A site whose camera the service drives."""
    site = write_site(folder / "site", cameras)
    site.write_text(site.read_text() + f"live = '{source}'\nexpected_s = 600\n")
    return site


def camera(server: Server) -> Any:
    return server.get("/api/v1/cameras").json["items"][0]


def taken(server: Server) -> list[Any]:
    return list(server.get("/api/v1/frames?count=1000").json["items"])


@contextmanager
def driving(service: Farm, source: LiveSource) -> Iterator[None]:
    """A driver of cam7 within this process."""
    with service.store.write() as connection:
        live.set_all(connection, {"cam7": "test"}, service.clock.now())
    one = Driver(service, "cam7", source)
    one.start()
    try:
        yield
    finally:
        one.stop()
        farm.close(service)


def state(service: Farm) -> live.State:
    with service.store.read() as connection:
        return live.states(connection)["cam7"]


def hashes(service: Farm) -> list[str]:
    with service.store.read() as connection:
        return [row.sha256 for row in frames.listed(connection, "cam7", None, None, 1000)]


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Waits of tenths of seconds."""
    for name in ("FIRST_WAIT_S", "RETRY_S", "USUAL_S"):
        monkeypatch.setattr(driver, name, 0.1)


# --- a folder


def test_a_folders_frames_are_measured_as_any_other_and_known_after_a_kill(tmp_path: Path) -> None:
    site = driven(tmp_path, "folder:incoming")
    folder = site.parent / "incoming"
    folder.mkdir()
    written(folder, "20261101T060000Z.png", frame_bytes(0.5))
    (folder / ".part").write_bytes(b"unfinished")
    with serving(tmp_path / "data", site) as server:
        (frame,) = eventually(lambda: taken(server))
        assert server.settled(frame["id"])["state"] == "measured"
        assert frame["captured"] == "2026-11-01T06:00:00Z"
        (reading,) = eventually(lambda: server.get("/api/v1/silos/silo7/readings").json["items"])
        assert reading["status"] == "ok"
        eventually(lambda: camera(server)["live"]["state"] == "ok")
        server.kill()
    second = written(folder, "20261101T070000Z.png", frame_bytes(0.52))
    with serving(tmp_path / "data", site) as server:
        eventually(lambda: len(taken(server)) == 2)
        assert second.exists()
        detail = server.get("/readyz").json["detail"]
        assert (detail["live_cameras"], detail["live_failing"]) == (1, 0)
        assert server.stop() == 0


def test_an_inbox_is_emptied_and_what_is_no_frame_is_named_and_stays(tmp_path: Path, quick: None) -> None:
    inbox = tmp_path / "inbox"
    inbox.mkdir()
    good = written(inbox, "a.png", frame_bytes(0.5))
    stray = written(inbox, "b.html", b"<html>no frame</html>")
    service = farm.make(tmp_path / "farm")
    with driving(service, FolderSource(inbox, LARGEST, removes=True)):
        eventually(lambda: state(service)["state"] == live.FAILING)
        assert state(service)["problem"].startswith("b.html: a file that begins with")
        assert (good.exists(), stray.exists()) == (False, True)
        time.sleep(0.5)
        assert state(service)["state"] == live.FAILING
        written(inbox, "c.png", frame_bytes(0.4))
        eventually(lambda: state(service)["state"] == live.OK)
        assert hashes(service) == [hashlib.sha256(frame_bytes(level)).hexdigest() for level in (0.4, 0.5)]


def test_a_folder_that_is_not_there_is_waited_for(tmp_path: Path, quick: None) -> None:
    service = farm.make(tmp_path / "farm")
    with driving(service, FolderSource(tmp_path / "later", LARGEST, removes=False)):
        eventually(lambda: state(service)["state"] == live.FAILING)
        assert "later: No such file" in state(service)["problem"]
        assert b'siloscope_live_camera_up{camera="cam7"} 0.0' in metrics.text(service)
        (tmp_path / "later").mkdir()
        written(tmp_path / "later", "a.png", frame_bytes(0.5))
        eventually(lambda: state(service)["state"] == live.OK)
        assert b'siloscope_live_camera_up{camera="cam7"} 1.0' in metrics.text(service)


def test_a_frame_without_room_waits_where_it_is(tmp_path: Path, quick: None) -> None:
    inbox = tmp_path / "inbox"
    inbox.mkdir()
    path = written(inbox, "a.png", frame_bytes(0.5))
    service = farm.make(tmp_path / "farm")
    limits = service.settings.limits
    service.intake.limits = replace(limits, queue=0)
    with driving(service, FolderSource(inbox, LARGEST, removes=True)):
        eventually(lambda: state(service)["state"] == live.FAILING)
        assert "wait to be measured" in state(service)["problem"]
        assert path.exists()
        service.intake.limits = limits
        eventually(lambda: state(service)["state"] == live.OK)
        assert len(hashes(service)) == 1
        eventually(lambda: not path.exists())


# --- a command

GRAB = """import os, pathlib, sys, time
place = pathlib.Path(sys.argv[1])
runs = len(list(place.glob("run*")))
(place / f"run{runs}").write_text(str(os.getpid()))
if runs == 0:
    time.sleep(60)
pathlib.Path(sys.argv[2]).write_bytes((place / "frame.png").read_bytes())
"""


def test_a_command_that_is_killed_is_run_again(tmp_path: Path) -> None:
    (tmp_path / "grab.py").write_text(GRAB)
    (tmp_path / "frame.png").write_bytes(frame_bytes(0.5))
    site = driven(tmp_path, f'command:{sys.executable} "{tmp_path}/grab.py" "{tmp_path}" {{file}}.png')
    with serving(tmp_path / "data", site) as server:
        first = int(eventually(lambda: (tmp_path / "run0").exists() and (tmp_path / "run0").read_text()))
        assert (camera(server)["live"]["source"], camera(server)["live"]["state"]) == ("command", "starting")
        os.kill(first, signal.SIGKILL)
        eventually(lambda: camera(server)["live"]["state"] == "failing")
        assert "was ended by signal 9" in camera(server)["live"]["problem"]
        assert server.get("/readyz").json["detail"]["live_failing"] == 1
        (frame,) = eventually(lambda: taken(server))
        assert server.settled(frame["id"])["state"] == "measured"
        eventually(lambda: camera(server)["live"]["state"] == "ok")
        assert server.stop() == 0


def test_aiming_hurries_a_camera_whose_turn_is_far_off(tmp_path: Path) -> None:
    """Each run gives other bytes, so each is a frame of its own; the next one would be due in ten minutes."""
    (tmp_path / "grab.py").write_text(
        "import pathlib, sys, time\n"
        "sys.stdout.buffer.write(pathlib.Path(sys.argv[1]).read_bytes() + str(time.time_ns()).encode())\n"
    )
    (tmp_path / "frame.png").write_bytes(frame_bytes(0.5))
    site = driven(tmp_path, f'command:{sys.executable} "{tmp_path}/grab.py" "{tmp_path}/frame.png"')
    with serving(tmp_path / "data", site) as server:
        eventually(lambda: taken(server))
        time.sleep(2.0)
        assert len(taken(server)) == 1
        assert server.get("/api/v1/cameras/cam7/pose").json["camera"] == "cam7"
        eventually(lambda: len(taken(server)) >= 3)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["-c", "import sys; sys.exit('lens cap on')"], "ended with exit code 1 .lens cap on."),
        (["-c", "pass"], "wrote no frame"),
        (["-c", "import sys; sys.stdout.write('0' * 5000); sys.stdout.flush(); input()"], "wrote no frame|5000|exit"),
    ],
)
def test_a_command_that_gives_no_frame_says_why(tmp_path: Path, words: list[str], told: str) -> None:
    source = CommandSource(" ".join([sys.executable, words[0], f'"{words[1]}"']), tmp_path, 1 << 20)
    with pytest.raises(Exception, match=told):
        next(source.captures(600.0, lambda: False))


def test_a_command_that_writes_or_takes_too_much_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    endless = CommandSource(f"{sys.executable} -c \"while True: print('0' * 1000)\"", tmp_path, 100_000)
    with pytest.raises(Exception, match="wrote more than 100000 bytes"):
        next(endless.captures(600.0, lambda: False))
    monkeypatch.setattr("siloscope.monitor.live.command.LONGEST_S", 0.3)
    slow = CommandSource(f'{sys.executable} -c "import time; time.sleep(60)"', tmp_path, 100_000)
    with pytest.raises(Exception, match="took longer than"):
        next(slow.captures(600.0, lambda: False))
    assert list(slow.captures(600.0, lambda: True)) == []
    with pytest.raises(Exception, match="check the command and its path"):
        next(CommandSource("/no/such/program", tmp_path, 1).captures(600.0, lambda: False))


# --- a device


class Depth:
    """A camera that gives its own process' number as depth, and dies of its third frame."""

    count = 0

    def newest(self) -> Frame:
        self.count += 1
        if self.count == 3:
            os._exit(7)
        depth = np.full((48, 64), 1000 + self.count, np.uint16)
        depth[0, 0] = os.getpid() % 60_000
        lens = Camera(64, 48, 38.5, 38.75, 31.25, 23.5)
        return Frame(depth, lens, 0.001, timestamp=time.time(), gravity=np.array([0.0, 0.0, 9.8]), source="depth")

    def __enter__(self) -> Depth:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing to let go."""


def test_a_device_whose_driver_dies_is_started_again(
    tmp_path: Path, quick: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("siloscope.monitor.live.device.SETTLE_S", 0.0)
    service = farm.make(tmp_path / "farm")
    seen: list[str | None] = []
    tell = live.tell

    def told(connection: Any, camera: str, state: str, problem: str | None, now: int) -> None:
        seen.append(problem)
        tell(connection, camera, state, problem, now)

    monkeypatch.setattr(live, "tell", told)
    with driving(service, DeviceSource(Depth)):
        eventually(lambda: len(hashes(service)) >= 5)
    assert any(problem and "ended unexpectedly" in problem for problem in seen)
    with open_frames(service.blobs.path(hashes(service)[0])) as source:
        frame = next(iter(source))
    assert frame.camera == Camera(64, 48, 38.5, 38.75, 31.25, 23.5)
    assert (frame.depth_unit, frame.depth.dtype) == (0.001, np.uint16)
    assert frame.gravity.tolist() == [0.0, 0.0, 9.8]


def test_between_distant_frames_a_device_is_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("siloscope.monitor.live.device.SETTLE_S", 0.0)

    def numbers(wanted_s: float) -> set[int]:
        source = DeviceSource(Depth)
        bodies = [next(source.captures(wanted_s, lambda: False)).body for _ in range(2)]
        source.close()
        return {int(number) for number in map(first_pixel, bodies)}

    assert len(numbers(1.0)) == 1
    assert len(numbers(600.0)) == 2


def first_pixel(body: bytes) -> Any:
    import io

    return np.load(io.BytesIO(body))["depth"][0, 0]


def test_a_points_frame_is_refused() -> None:
    with pytest.raises(Exception, match="no depth image"):
        file_of(Frame(points=np.zeros((3, 3))))


# --- what is told before the start


@pytest.mark.parametrize(
    ("entries", "told"),
    [
        ({"cam7": "webcam:0"}, "cam7.*no such source; known are realsense"),
        ({"cam7": "folder:"}, "no such source"),
        ({"cam7": "command:"}, "says no command"),
        ({"cam7": "command:grab 'open"}, "quotation"),
        ({"cam7": "orbbec:12"}, "not chosen by a serial number"),
        ({"cam9": "realsense"}, "there is no such camera"),
        ({"cam7": "realsense", "cam8": "realsense:12"}, "several cameras are live from realsense"),
        ({"cam7": "realsense:12", "cam8": "realsense:12"}, "several cameras"),
    ],
)
def test_a_source_that_can_not_be_is_told_at_the_start(tmp_path: Path, entries: dict[str, str], told: str) -> None:
    service = farm.make(tmp_path / "farm")
    service.live = {name: (text, tmp_path) for name, text in entries.items()}
    with pytest.raises(UsageError, match=told):
        attach(service)
    farm.close(service)


def test_two_devices_of_a_maker_have_a_serial_number_each(tmp_path: Path) -> None:
    service = farm.make(tmp_path / "farm")
    service.live = {"cam7": ("realsense:11", tmp_path), "cam8": ("realsense:12", tmp_path)}
    attach(service)
    assert [type(part) for part in service.parts] == [Driver, Driver]
    farm.close(service)


def test_the_command_line_names_a_source(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "frames"
    folder.mkdir()
    written(folder, "a.png", frame_bytes(0.5))
    with serving(tmp_path / "data", write_site(tmp_path / "site"), "--live", f"cam7=folder:{folder}") as server:
        eventually(lambda: taken(server))
    assert main(["serve", "--data", str(tmp_path / "other"), "--live", "cam7"]) == 2
    assert "such as cam7=realsense" in capsys.readouterr().err


def test_who_drives_no_camera_any_more_has_no_state_of_it(tmp_path: Path) -> None:
    service = farm.make(tmp_path / "farm")
    service.live = {"cam7": ("realsense", tmp_path)}
    attach(service)
    assert state(service)["state"] == live.STARTING
    service.live = {}
    attach(service)
    with service.store.read() as connection:
        assert live.states(connection) == {}
    farm.close(service)
