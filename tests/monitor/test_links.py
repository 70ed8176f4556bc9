"""Links that drop: what was to be sent waits on the disk, arrives once, and goes only when the other side has it."""

from __future__ import annotations

import random
import subprocess
import sys
import time
from pathlib import Path

import pytest

from monitor import farm
from monitor.farm import Farm
from monitor.servers import Server, eventually, frame_bytes
from monitor.test_edge import rows
from siloscope.client import ServiceError
from siloscope.monitor.clock import MINUTE, SetClock
from siloscope.monitor.edge import Edge
from siloscope.monitor.epochs import Uptime
from siloscope.monitor.outlets import EdgeEntry
from siloscope.monitor.store import sync
from wire import Wire


class Box:
    """An edge box that measures a frame a minute."""

    def __init__(self, folder: Path, hub: Farm) -> None:
        self.clock = SetClock(hub.clock.time - 600 * MINUTE)
        self.hub, self.service = hub, farm.make(folder, clock=self.clock)
        self.count = 0
        """Readings so far; each has its number in its deviation."""

    def link(self, address: str, token: str) -> Edge:
        from siloscope.client import Client

        entry = EdgeEntry(token_file="token", frames="none", backlog_per_s=5000.0)
        return Edge(self.service, Client(address, token), entry, Uptime(lambda: self.clock.time, "1"))

    def measure(self, number: int) -> None:
        for _ in range(number):
            self.count += 1
            self.clock.time += MINUTE
            farm.measured(self.service, self.clock.time, own_std=0.01 + 1e-6 * self.count)
        self.hub.clock.time = self.clock.time

    def send(self, edge: Edge) -> None:
        """Rounds until the hub has all readings."""
        for _ in range(100):
            edge.round()
            if not self.waits:
                return
        raise AssertionError("it does not come to an end")

    @property
    def waits(self) -> bool:
        with self.service.store.read() as connection:
            return bool(sync.missing(connection, sync.READINGS))


def test_a_link_that_drops_in_the_middle_loses_and_doubles_nothing(tmp_path: Path) -> None:
    """It drops 25 times at random bytes while readings go on; the backlog of each outage follows."""
    hub, draw = farm.make(tmp_path / "hub"), random.Random(4)
    box = Box(tmp_path / "edge", hub)
    with farm.listening(hub) as address:
        wire = Wire(address)
        edge, dropped = box.link(wire.root, farm.token(hub, "edge")), 0
        for _ in range(25):
            box.measure(draw.randrange(1, 8))
            wire.mend()
            wire.budget = draw.randrange(400, 9000)
            try:
                for _ in range(3):
                    edge.round()
            except ServiceError:
                dropped += 1
            wire.cut()
        wire.budget = None
        wire.mend()
        box.send(edge)
        wire.close()
    assert dropped > 8
    assert [round((row.own_std - 0.01) / 1e-6) for row in rows(hub)] == list(range(1, box.count + 1))
    farm.close(box.service)


def test_a_restart_sends_nothing_again_that_was_acknowledged(tmp_path: Path) -> None:
    hub = farm.make(tmp_path / "hub")
    box = Box(tmp_path / "edge", hub)
    box.measure(30)
    with farm.listening(hub) as address:
        wire, token = Wire(address), farm.token(hub, "edge")
        box.send(box.link(wire.root, token))
        farm.close(box.service)
        box.service = farm.make(tmp_path / "edge", clock=box.clock)
        wire.sent.clear()
        again = box.link(wire.root, token)
        again.round()
        assert b"/edge/readings" not in b"".join(wire.sent)
        box.measure(2)
        box.send(again)
        told = b"".join(wire.sent)
        assert 1 <= told.count(b"POST /api/v1/edge/readings") <= 2
        wire.close()
    assert len(rows(hub)) == 32
    farm.close(box.service)


def test_what_waits_is_on_the_disk_before_it_is_sent(tmp_path: Path) -> None:
    """A box that is switched off during an outage still has what it measured."""
    hub = farm.make(tmp_path / "hub")
    box = Box(tmp_path / "edge", hub)
    box.measure(20)
    with pytest.raises(ServiceError):
        box.link("http://127.0.0.1:9", "none").round()
    farm.close(box.service)
    box.service = farm.make(tmp_path / "edge", clock=box.clock)
    assert box.waits
    with farm.listening(hub) as address:
        box.send(box.link(address, farm.token(hub, "edge")))
    assert len(rows(hub)) == 20
    farm.close(box.service)


def test_a_watched_folder_keeps_its_files_while_the_link_is_down(shared: Server, tmp_path: Path) -> None:
    wire = Wire(shared.root)
    wire.cut()
    folder = tmp_path / "frames"
    folder.mkdir()
    (tmp_path / "token").write_text(shared.token("camera", "cam7"))
    command = [sys.executable, "-m", "siloscope", "send", str(folder), "--to", wire.root, "--camera", "cam7"]
    command += ["--token-file", str(tmp_path / "token"), "--watch", "--delete"]
    names = [f"202611{day:02d}T050000Z.png" for day in (11, 12, 13)]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
        try:
            for number, name in enumerate(names):
                (folder / name).write_bytes(frame_bytes(0.61 + 0.01 * number))
            time.sleep(4.0)
            assert sorted(path.name for path in folder.iterdir()) == names
            wire.mend()
            eventually(lambda: not any(folder.iterdir()))
        finally:
            process.terminate()
    wire.close()
    times = {frame["captured"] for frame in shared.get("/api/v1/frames?camera=cam7&count=200").json["items"]}
    assert {f"2026-11-{day}T05:00:00Z" for day in (11, 12, 13)} <= times
