"""Against an S3 server of our own (moto): races, dropped connections, two range reads, a whole run."""

from __future__ import annotations

import json
import socket
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fleet.outputs import answers
from siloscope import InputError
from siloscope.cli import main
from siloscope.fleet import plan
from siloscope.fleet.naming import Series
from siloscope.fleet.object_store import ObjectStore
from siloscope.fleet.pack import pack
from siloscope.fleet.places import open_store
from siloscope.fleet.publish import CURRENT, publish
from siloscope.fleet.reading import SealedShard
from siloscope.fleet.running import Opened, run
from siloscope.fleet.store import Missing

pytest.importorskip("moto")
pytest.importorskip("obstore")


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    """The address of an S3 server with the bucket ``mill``."""
    import boto3
    from moto.server import ThreadedMotoServer

    moto = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    moto.start()
    host, port = moto.get_host_and_port()
    address = f"http://{host}:{port}"
    keys = {"aws_access_key_id": "test", "aws_secret_access_key": "test", "region_name": "us-east-1"}
    boto3.client("s3", endpoint_url=address, **keys).create_bucket(Bucket="mill")
    yield address
    moto.stop()


@pytest.fixture
def s3(server: str, monkeypatch: pytest.MonkeyPatch) -> str:
    """The bucket, with the environment that leads to it."""
    for name, value in {
        "AWS_ENDPOINT_URL": server,
        "AWS_REGION": "us-east-1",
        "AWS_ACCESS_KEY_ID": "test",
        "AWS_SECRET_ACCESS_KEY": "test",
    }.items():
        monkeypatch.setenv(name, value)
    return "s3://mill"


@pytest.fixture(params=["folder", "s3"])
def any_store(request: pytest.FixtureRequest, tmp_path: Path) -> Any:
    if request.param == "folder":
        return open_store(tmp_path / "store")
    return open_store(f"{request.getfixturevalue('s3')}/{tmp_path.name}")


def test_of_sixteen_racing_committers_one_wins(any_store: Any) -> None:
    start = threading.Barrier(16)

    def race(number: int) -> bool:
        start.wait()
        return bool(any_store.create("commits/run/a.json", f"{number}".encode()))

    with ThreadPoolExecutor(16) as pool:
        won = list(pool.map(race, range(16)))
    assert sum(won) == 1
    assert any_store.get("commits/run/a.json") == str(won.index(True)).encode()


def test_an_exchange_needs_the_version_that_is_there(any_store: Any) -> None:
    assert any_store.version("current") is None
    assert any_store.exchange("current", None, b"one")
    assert not any_store.exchange("current", None, b"two")
    known = any_store.version("current")
    assert any_store.exchange("current", known, b"three")
    assert not any_store.exchange("current", known, b"four")
    assert any_store.get("current") == b"three"


def test_ranges_names_and_sizes(any_store: Any) -> None:
    any_store.put("a/b/c", b"0123456789")
    any_store.put("a/d", b"")
    assert any_store.get_range("a/b/c", 2, 3) == b"234"
    assert any_store.get_tail("a/b/c", 4) == b"6789"
    assert set(any_store.names("a/")) == {"a/b/c", "a/d"}
    assert sorted(any_store.below("a/")) == ["b", "d"]
    assert (any_store.size("a/b/c"), any_store.size("none")) == (10, None)
    with pytest.raises(Missing):
        any_store.get("none")


def test_a_run_in_an_object_store_gives_the_same_bytes(
    s3: str, archives: list[Path], calibrations: Path, measuring: Any, tmp_path: Path
) -> None:
    some = archives[2:5]
    for place in (str(tmp_path / "folder"), f"{s3}/whole"):
        pack(some, f"{place}/store", shard_frames=8)
        plan.make(f"{place}/store", f"{place}/run", calibrations, measuring)
        run(f"{place}/run", workers=2)
    remote = open_store(f"{s3}/whole/run")
    for name in remote.names(""):
        local = tmp_path / "copy" / name
        local.parent.mkdir(parents=True, exist_ok=True)
        local.write_bytes(remote.get(name))
    assert answers(tmp_path / "copy") == answers(tmp_path / "folder" / "run")
    published = publish(Opened.of(f"{s3}/whole/run"))
    assert published["previous"] is None
    assert published["results"].startswith("s3://mill/whole/run/results/run=")
    assert publish(Opened.of(f"{s3}/whole/run"))["previous"] is None
    assert remote.version(CURRENT) is not None


def test_every_command_of_the_fleet_takes_urls(
    s3: str, archives: list[Path], calibrations: Path, tmp_path: Path, capsys: Any
) -> None:
    store, place = f"{s3}/commands/store", f"{s3}/commands/run"

    def told(*words: str) -> Any:
        capsys.readouterr()
        assert main([*words, "--json"]) == 0
        return json.loads(capsys.readouterr().out)

    assert told("pack", str(archives[3]), "-o", store, "--shard-frames", "8")["frames"] == 20
    run_id = told("fleet", "plan", store, "--out", place, "--calibrations", str(calibrations))["run"]
    metrics = tmp_path / "fleet.prom"
    done = told("fleet", "worker", place, "--index", "0", "--of", "1", "--metrics", str(metrics))
    assert (done["complete"], done["place"], done["store"]) == (True, place, store)
    assert told("fleet", "run", place)["complete"]
    assert told("fleet", "status", f"{place}@{run_id}")["frames"]["done"] == 20
    assert told("fleet", "diff", place, f"{place}@{run_id}")["all"]["same"] == 20
    assert told("fleet", "publish", place, "--to", f"{s3}/commands/readings")["run"] == run_id
    assert open_store(f"{s3}/commands/readings").size(CURRENT)


@pytest.mark.parametrize("command", ["info", "calibrate", "track", "measure", "locate"])
def test_other_commands_say_what_a_store_of_objects_is_for(
    command: str, calibrations: Path, tmp_path: Path, capsys: Any
) -> None:
    known = ["--calibration", str(calibrations / "silo03.json")]
    words = {"calibrate": ["-o", str(tmp_path / "c.json")], "measure": known, "track": known}.get(command, [])
    assert main([command, "s3://mill/frames", *words]) == 3
    told = capsys.readouterr().err
    assert "s3://mill/frames: frames in an object store are read by `siloscope fleet`" in " ".join(told.split())


class Gate:
    """Lets connections through to a server, counts requests, and drops the first answers half-way."""

    def __init__(self, server: str, drops: int, after: int) -> None:
        self.target = ("127.0.0.1", int(server.rpartition(":")[2]))
        self.drops, self.after = drops, after
        self.requests: list[bytes] = []
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address = f"http://127.0.0.1:{self._listener.getsockname()[1]}"
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        self._listener.close()

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            upstream = socket.create_connection(self.target)
            threading.Thread(target=self._up, args=(client, upstream), daemon=True).start()
            threading.Thread(target=self._down, args=(upstream, client), daemon=True).start()

    def _up(self, client: socket.socket, upstream: socket.socket) -> None:
        try:
            while data := client.recv(1 << 16):
                if data.startswith((b"GET ", b"HEAD ", b"PUT ")):
                    self.requests.append(data)
                upstream.sendall(data)
        except OSError:
            return

    def _down(self, upstream: socket.socket, client: socket.socket) -> None:
        passed = 0
        try:
            while data := upstream.recv(1 << 14):
                client.sendall(data)
                passed += len(data)
                if passed > self.after and self.drops:
                    self.drops -= 1
                    break
        except OSError:
            pass
        for one in (client, upstream):
            one.close()


@pytest.fixture
def sealed(s3: str, archives: list[Path]) -> str:
    place = f"{s3}/gate"
    pack(archives[:1], place, shard_frames=8)
    return place


def test_a_dropped_connection_resumes(
    sealed: str, server: str, archives: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    gate = Gate(server, drops=3, after=100_000)
    monkeypatch.setenv("AWS_ENDPOINT_URL", gate.address)
    shard = SealedShard(ObjectStore(sealed), Series(archives[0].stem, "cam"), 0)
    assert [stored.problem for stored in shard.frames()] == [None] * 8
    assert gate.drops == 0
    gate.close()


def test_a_server_that_is_gone_is_told(sealed: str, server: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from siloscope.fleet import object_store

    monkeypatch.setattr(object_store, "RETRY", {"max_retries": 0})
    monkeypatch.setattr(object_store, "PAUSE", 0.0)
    with socket.create_server(("127.0.0.1", 0)) as unused:
        port = unused.getsockname()[1]
    monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{port}")
    with pytest.raises(InputError, match="does not answer as it should"):
        ObjectStore(sealed).get("manifest.parquet")


def test_a_sealed_shard_is_opened_with_two_range_reads(
    sealed: str, server: str, archives: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    gate = Gate(server, drops=0, after=0)
    monkeypatch.setenv("AWS_ENDPOINT_URL", gate.address)
    series = Series(archives[0].stem, "cam")
    shard = SealedShard(ObjectStore(sealed), series, 1)
    (first,) = shard.frames(np.array([2]))
    assert first.frame is not None
    asked = [request for request in gate.requests if b"/depth/c.1.0.0 " in request.partition(b"\r")[0]]
    assert len(asked) == 2
    assert all(b"range: bytes=" in line.lower() for line in asked)
    gate.close()
