"""Several processes on one PostgreSQL: each takes frames and measures, one tells, publishes and fires alerts."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from monitor.servers import Server, ago, eventually, frame_bytes, write_site
from monitor.test_delivery import receiving
from monitor.test_mqtt import Broker, Reader, broken
from monitor.test_store import new_url, postgres  # noqa: F401  (a fixture)
from siloscope.errors import UsageError
from siloscope.monitor import administration
from siloscope.monitor.lock import Lock
from siloscope.monitor.store.engine import opened
from siloscope.monitor.store.leader import PUBLISHING, Leadership


@pytest.fixture
def url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    return new_url(request, tmp_path, "postgresql")


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Broker]:
    made = Broker(tmp_path / "broker")
    yield made
    made.kill()


class Two:
    """Two services on one folder and database, with MQTT and a webhook."""

    def __init__(self, folder: Path, url: str, mqtt: int, webhook: int) -> None:
        more = f'[mqtt]\nhost = "127.0.0.1"\nport = {mqtt}\nbox = "box1"\n'
        more += f'[[webhook]]\nid = "erp"\nurl = "http://127.0.0.1:{webhook}/"\nsecret_file = "secret"\n'
        more += 'allow_private = true\n[[rule]]\nid = "high"\nkind = "overfill"\nlevel = 0.3\nchannels = ["erp"]\n'
        site = write_site(folder / "site", more=more)
        (folder / "site" / "secret").write_text("secret\n")
        self.data, self.url = folder / "data", url
        options = ("--database", url)
        self.servers = [Server(self.data, site, options).start() for _ in range(2)]
        self.token = str(administration.token(self.data, url, "camera", "cam7", None)["token"])

    def leads(self) -> list[bool]:
        return [one.get("/readyz").json["detail"]["leads"] for one in self.alive]

    @property
    def alive(self) -> list[Server]:
        return [one for one in self.servers if one.process is not None and one.process.poll() is None]

    def leader(self) -> Server:
        eventually(lambda: sum(self.leads()) == 1)
        return self.alive[self.leads().index(True)]

    def send(self, server: Server, level: float, seconds: int) -> Any:
        taken = server.post("cam7", frame_bytes(level, 60 + seconds), self.token, Captured_At=ago(seconds=seconds))
        return server.settled(taken.json["frame"])

    def end(self) -> None:
        for one in self.alive:
            one.kill()


@broken
def test_one_process_publishes_and_another_takes_over(tmp_path: Path, url: str, broker: Broker) -> None:
    reader = Reader(broker.port)
    with receiving() as hook:
        two = Two(tmp_path, url, broker.port, hook.server_port)
        try:
            first = two.leader()
            (other,) = [one for one in two.alive if one is not first]
            frame = two.send(other, 0.7, 40)  # taken by the one that does not lead
            assert frame["state"] == "measured"
            number = frame["reading"]["id"]
            reader.has("siloscope/box1/silo7/state", lambda body: json.loads(body)["seq"] == number)
            eventually(lambda: hook.came)
            assert json.loads(hook.came[0][2])["event"] == "firing"

            first.kill()
            reader.has("siloscope/box1/status", lambda body: body == b"offline")
            assert two.leader() is other
            reader.has("siloscope/box1/status", lambda body: body == b"online")
            later = two.send(other, 0.1, 2)["reading"]["id"]
            reader.has("siloscope/box1/silo7/state", lambda body: json.loads(body)["seq"] == later)
            eventually(lambda: len(hook.came) > 1)
            told = [json.loads(body) for _, _, body in hook.came]
            assert [one["event"] for one in told] == ["firing", "resolved"]
            assert len({one["alert"] for one in told}) == 1
        finally:
            two.end()
            reader.stop()


def test_an_office_is_held_by_one_and_falls_with_its_session(url: str) -> None:
    from sqlalchemy import text

    stores = [opened(url) for _ in range(2)]
    one, other = (Leadership(store, PUBLISHING) for store in stores)
    assert (one.held(), other.held(), one.held()) == (True, False, True)
    one.release()
    assert (other.held(), one.held()) == (True, False)
    with stores[0].write() as connection:  # the server ends the session, as it does when a machine is gone
        ended = "SELECT pg_terminate_backend(pid) FROM pg_locks WHERE locktype = 'advisory' AND objid = :key"
        connection.execute(text(ended), {"key": PUBLISHING})
    assert other.held() is False
    assert one.held()
    one.release()
    for store in stores:
        store.close()


def test_a_frame_whose_process_was_killed_is_measured_by_another(url: str, tmp_path: Path) -> None:
    from monitor.test_store import NOW, arrived, filled
    from siloscope.monitor.store import frames

    store = opened(url)
    filled(store, tmp_path / "site")
    key = arrived(store, "a" * 64, NOW, frames.QUEUED)
    assert frames.claim(store, NOW, NOW + 100).id == key
    assert frames.requeue_interrupted(store, NOW + 50) == 0
    assert frames.requeue_interrupted(store, NOW + 200) == 1
    assert frames.claim(store, NOW + 200, NOW + 300).attempts == 2
    store.close()


def test_a_folder_is_shared_only_where_a_database_is(tmp_path: Path) -> None:
    first = Lock(tmp_path / "lock", shared=True)
    assert first.alone
    with pytest.raises(UsageError):
        Lock(tmp_path / "lock", shared=True)  # while the first one tidies up
    first.share()
    second = Lock(tmp_path / "lock", shared=True)
    assert not second.alone
    with pytest.raises(UsageError):
        Lock(tmp_path / "lock")
    first.release()
    second.release()
