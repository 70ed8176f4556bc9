"""Two servers on this machine, an edge and its hub: weeks without a link, clocks that jump, nothing lost or doubled."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from monitor import farm
from monitor.farm import Farm
from monitor.servers import eventually
from siloscope.client import Client, ServiceError
from siloscope.errors import InputError
from siloscope.monitor.clock import CORRECTED, DAY, HOUR, MINUTE, SECOND, SUSPECT, SetClock
from siloscope.monitor.edge import Edge
from siloscope.monitor.epochs import Uptime
from siloscope.monitor.outlets import EdgeEntry
from siloscope.monitor.store import aging, alerts, places, readings, sync

SINCE = farm.NOON - 21 * DAY


@dataclass
class Machine:
    """True time, and a box whose clock may be wrong."""

    clock: SetClock
    uptime: int = 0
    boot: int = 0

    def wait(self, span: int) -> None:
        self.clock.time += span
        self.uptime += span

    def restart(self, clock: int) -> None:
        self.clock.time, self.uptime, self.boot = clock, 0, self.boot + 1

    @property
    def told(self) -> Uptime:
        return Uptime(lambda: self.uptime, str(self.boot))


@pytest.fixture
def hub(tmp_path: Path) -> Farm:
    return farm.make(tmp_path / "hub")


@pytest.fixture
def box(tmp_path: Path) -> Iterator[tuple[Farm, Machine]]:
    clock = SetClock(SINCE)
    service = farm.make(tmp_path / "edge", clock=clock)
    yield service, Machine(clock)
    farm.close(service)


def linked(service: Farm, machine: Machine, address: str, token: str, frames: Any = "samples") -> Edge:
    entry = EdgeEntry(token_file="token", frames=frames, backlog_per_s=2000.0)
    edge = Edge(service, Client(address, token), entry, machine.told)
    edge.epochs.look()
    return edge


def sent(edge: Edge, service: Farm) -> int:
    """Rounds until nothing is missing; how many."""
    for number in range(1, 300):
        edge.round()
        with service.store.read() as connection:
            if not sync.missing(connection, sync.READINGS) and not sync.missing(connection, sync.FRAMES):
                return number
    raise AssertionError("it does not come to an end")


def rows(service: Farm, silo: str = "silo7") -> list[Any]:
    with service.store.read() as connection:
        return list(readings.page(connection, silo, readings.Span(), None, 10_000))


def test_weeks_of_backlog_arrive_once_and_in_true_time(hub: Farm, box: tuple[Farm, Machine]) -> None:
    """Three weeks without a link; in the second the box restarts with a clock of years ago that is set days later."""
    service, machine = box
    edge = linked(service, machine, "http://127.0.0.1:9", "no link")
    true, lost = SINCE, 0
    for number in range(120):
        if number == 40:
            machine.restart(SINCE - 500 * DAY)
            lost = true - machine.clock.time
            edge = linked(service, machine, "http://127.0.0.1:9", "no link")
        if number == 80:
            machine.clock.time += lost
            lost = 0
            edge.epochs.look()
        machine.wait(250 * MINUTE - SECOND)
        true += 250 * MINUTE
        farm.measured(service, machine.clock.time + SECOND, own_std=0.01 + number * 1e-6)
        machine.uptime += SECOND
    with pytest.raises(ServiceError):
        edge.round()
    hub.clock.time = true
    with farm.listening(hub) as address:
        edge = linked(service, machine, address, farm.token(hub, "edge"))
        edge.round()
        assert rows(hub)[-1].time == true  # the newest is there at once
        sent(edge, service)
        found = rows(hub)
        assert [row.own_std for row in found] == pytest.approx([0.01 + number * 1e-6 for number in range(120)])
        wanted = [SINCE + (number + 1) * 250 * MINUTE for number in range(120)]
        assert max(abs(row.time - time) for row, time in zip(found, wanted, strict=True)) <= 10 * SECOND
        assert [row.clock for row in found] == ["good"] * 40 + ["corrected"] * 40 + ["good"] * 40
        with service.store.write() as connection:  # the hub had it, its answer was lost
            places.set_fact(connection, sync.READINGS, [])
        sent(edge, service)
        assert len(rows(hub)) == 120
        client = Client(address, farm.token(hub, "read"))
        assert client.now("silo7")["reading"] == found[-1].id


def test_a_box_whose_clock_is_wrong_now_is_put_right_by_the_hub(hub: Farm, box: tuple[Farm, Machine]) -> None:
    service, machine = box
    machine.restart(hub.clock.time - 400 * DAY)
    with farm.listening(hub) as address:
        edge = linked(service, machine, address, farm.token(hub, "edge"))
        farm.measured(service, machine.clock.time - HOUR)
        sent(edge, service)
    (row,) = rows(hub)
    assert (abs(row.time - (hub.clock.time - HOUR)) < MINUTE, row.clock) == (True, CORRECTED)


def test_what_nobody_can_date_is_stored_and_kept_out(hub: Farm, box: tuple[Farm, Machine]) -> None:
    service, machine = box
    machine.restart(40 * DAY)  # 1970
    edge = linked(service, machine, "http://127.0.0.1:9", "no link")
    farm.measured(service, machine.clock.time)
    machine.restart(hub.clock.time)
    with farm.listening(hub) as address:
        edge = linked(service, machine, address, farm.token(hub, "edge"))
        sent(edge, service)
    (row,) = rows(hub)
    assert row.clock == SUSPECT
    with hub.store.read() as connection:
        assert readings.last(connection, "silo7", answered=True) is None


def test_samples_of_the_frames_go_up_and_nothing_goes_before(hub: Farm, box: tuple[Farm, Machine]) -> None:
    service, machine = box
    times = [SINCE + number * 6 * HOUR for number in range(16)]
    for number, time in enumerate(times):
        farm.measured(service, time, status="refused" if number == 5 else "ok", own_std=0.01 + number * 1e-6)
    machine.clock.time = hub.clock.time
    with farm.listening(hub) as address:
        edge = linked(service, machine, address, farm.token(hub, "edge"))
        with service.store.read() as connection:
            assert aging.oldest(connection, 50, *sync.free(connection)) == []
            assert sync.pending(connection) == {"hub": 16}
        sent(edge, service)
        with service.store.read() as connection:
            assert len(aging.oldest(connection, 50, *sync.free(connection))) == 16
            assert sync.pending(connection) == {"hub": 0}
        kept = [time for time, there in zip(times, contents(hub, address), strict=True) if there]
    days = {time // DAY: time for time in reversed(times)}
    assert set(kept) == {*days.values(), times[5]}


def contents(hub: Farm, address: str) -> list[bool]:
    """Of each frame by its time, whether the hub has its bytes."""
    client = Client(address, farm.token(hub, "read"))
    found = sorted(client.pages("/api/v1/frames", {}), key=lambda frame: str(frame["captured"]))
    return [frame["kept"] and hub.blobs.intact(frame["sha256"]) for frame in found]


def test_settings_come_down_and_acknowledgements_go_up(hub: Farm, box: tuple[Farm, Machine]) -> None:
    service, machine = box
    machine.clock.time = hub.clock.time
    with farm.listening(hub) as address:
        edge = linked(service, machine, address, farm.token(hub, "edge"))
        edge.round()
        with hub.store.write() as connection:
            places.put(connection, "silo", "silo7", {"name": "Renamed", "stale_after_s": 99_999}, hub.clock.now())
            low = alerts.rule_get(connection, "low")
            values = {name: getattr(low, name) for name in ("place", "silo", "kind", "delay_s", "channels", "enabled")}
            alerts.put_rule(connection, "low", values | {"level": 0.4, "clear": 0.45}, hub.clock.now())
        edge.asked = float("-inf")
        edge.round()
        with service.store.read() as connection:
            assert places.get(connection, "silo", "silo7").name == "Renamed"
            assert alerts.rule_get(connection, "low").level == 0.4
        farm.measured(service, machine.clock.time, fill=0.3)
        sent(edge, service)
        for one in (service, hub):
            farm.look(one)
        (mine,), (theirs,) = firing(service), firing(hub)
        assert mine.id != theirs.id
        with service.store.write() as connection:
            alerts.acknowledge(connection, mine.id, "Anna", "seen", machine.clock.time)
        edge.round()
        assert (firing(hub)[0].acknowledged_by, firing(hub)[0].note) == ("Anna", "seen")


def firing(service: Farm) -> list[Any]:
    with service.store.read() as connection:
        found = alerts.listed(connection, silo="silo7", firing=True, before=None, count=9)
    return [row for row in found if row.kind == "low"]


def test_a_hub_that_refuses_loses_nothing_and_says_why(hub: Farm, box: tuple[Farm, Machine]) -> None:
    service, machine = box
    machine.clock.time = hub.clock.time
    farm.measured(service, machine.clock.time)
    with farm.listening(hub) as address:
        edge = linked(service, machine, address, farm.token(hub, "read"))
        with pytest.raises(ServiceError, match="role edge"):
            edge.round()
        with hub.store.write() as connection:
            places.remove(connection, "camera", "cam7", hub.clock.now())
        edge = linked(service, machine, address, farm.token(hub, "edge"))
        with pytest.raises(ServiceError, match="'cam7'"):
            edge.round()
        with service.store.read() as connection:
            assert sync.pending(connection) == {"hub": 1}
    assert rows(hub) == []


def test_site_toml_makes_the_link_that_works_by_itself(hub: Farm, tmp_path: Path) -> None:
    folder = tmp_path / "edge"
    folder.mkdir()
    (folder / "token").write_text(farm.token(hub, "edge"))
    remark = {"code": "lens-film", "message": "a film", "severity": "warning", "advice": "clean it"}
    with farm.listening(hub) as address:
        link = f'hub = "{address}"\n[edge]\ntoken_file = "token"\n'
        service = farm.make(folder, silos=link + farm.SILOS)
        (edge,) = service.parts
        edge.start()
        farm.measured(service, service.clock.now(), quality=[remark])
        (row,) = eventually(lambda: rows(hub))
        edge.stop()
        assert row.quality[0]["code"] == "lens-film"
        client = Client(address, farm.token(hub, "read"))
        assert client.now("silo7")["quality"][0]["code"] == "lens-film"


def test_a_hub_needs_a_token_at_the_edge(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\[edge\]"):
        farm.make(tmp_path, silos='hub = "https://hub.example.org"\n' + farm.SILOS)


def test_stretches_and_gaps_share_out_the_numbers() -> None:
    chance = random.Random(3)
    for _ in range(200):
        told = [(first := chance.randrange(1, 60), first + chance.randrange(9)) for _ in range(chance.randrange(9))]
        found = sync.joined(told)
        covered = {number for first, last in told for number in range(first, last + 1)}
        assert covered == {number for first, last in found for number in range(first, last + 1)}
        lost = {number for first, last in sync.gaps(found, 70) for number in range(first, last + 1)}
        assert lost == set(range(1, 71)) - covered
