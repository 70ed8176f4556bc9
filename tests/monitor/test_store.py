"""The store: schema and versions, backup and restore, both databases, retention, file systems."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from alembic.autogenerate import compare_metadata
from alembic.runtime.migration import MigrationContext
from sqlalchemy import event, text
from sqlalchemy.exc import IntegrityError

from monitor import farm
from monitor.servers import eventually, write_site
from siloscope.client import Client
from siloscope.errors import InputError, UsageError
from siloscope.monitor import administration, site
from siloscope.monitor.blobs import Blobs
from siloscope.monitor.clock import DAY, HOUR, SECOND, SetClock
from siloscope.monitor.lock import Lock
from siloscope.monitor.retention import Keeper
from siloscope.monitor.settings import Limits, Retention, Settings
from siloscope.monitor.store import aging, alerts, frames, people, places, readings, schema_people, transfer
from siloscope.monitor.store.engine import Store, new_id, opened, whole
from siloscope.monitor.store.filesystem import kind_of, refuse_network
from siloscope.monitor.store.recording import Recorder
from siloscope.monitor.store.schema import metadata

NOW = 1_800_000_000 * SECOND

ALL = (metadata, schema_people)


@pytest.fixture(scope="session")
def postgres() -> Iterator[str]:
    """A PostgreSQL server of its own, on a socket in a folder; its URL without the database's name."""
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb")) if os.geteuid() == 0 else []
    if not found or shutil.which("runuser") is None:
        pytest.skip("PostgreSQL is not installed (make services), or its own user can't be taken")
    binaries, folder = found[-1].parent, Path(tempfile.mkdtemp(prefix="siloscope-pg-"))
    shutil.chown(folder, "postgres")

    def run(*command: str) -> None:
        subprocess.run(["runuser", "-u", "postgres", "--", *command], check=True, capture_output=True, cwd=folder)

    run(str(binaries / "initdb"), "-D", str(folder / "data"), "-A", "trust", "-U", "postgres")
    options = f"-c listen_addresses='' -c unix_socket_directories={folder}"
    run(str(binaries / "pg_ctl"), "-D", str(folder / "data"), "-w", "-l", str(folder / "log"), "-o", options, "start")
    try:
        yield f"postgresql+psycopg://postgres@/{{}}?host={folder}"
    finally:
        run(str(binaries / "pg_ctl"), "-D", str(folder / "data"), "-m", "immediate", "stop")
        shutil.rmtree(folder)


@pytest.fixture(params=["sqlite", "postgresql"])
def store(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Store]:
    """An empty store of each kind of database."""
    found = opened(new_url(request, tmp_path, request.param))
    yield found
    found.close()


def new_url(request: pytest.FixtureRequest, folder: Path, kind: str) -> str:
    if kind == "sqlite":
        return Settings(folder).url
    from sqlalchemy import create_engine

    url, name = request.getfixturevalue("postgres"), f"t{time.time_ns()}"
    engine = create_engine(url.format("postgres"), isolation_level="AUTOCOMMIT")
    with engine.connect() as connection:
        connection.execute(text(f"CREATE DATABASE {name}"))
    engine.dispose()
    return str(url.format(name))


def filled(store: Store, folder: Path) -> None:
    path = write_site(folder)
    with store.write() as connection:
        site.apply(connection, site.read(path), path, NOW)
        run = readings.run_of(connection, "1", "x", "measured", NOW)
        for k in range(48):
            row = {"silo": "silo7", "time": NOW - k * HOUR, "clock": "good", "run": run, "status": "ok", "quality": []}
            readings.add(connection, {**row, "volume": 10.0 - 0.1 * k, "fill": 0.5}, b"x", NOW)
        people.add_user(connection, "ana", "scrypt", NOW)
        values = {"rule": "low", "kind": "low", "silo": "silo7", "since": NOW, "fired": NOW}
        alerts.fire(connection, {**values, "value": 0.1, "threshold": 0.2})


def arrived(store: Store, sha: str, captured: int, state: str = frames.MEASURED) -> str:
    found = frames.Arrival("cam7", sha, captured, captured, "good", "png", 3)
    key, new = Recorder(store).record(found, lambda: True)
    assert new
    with store.write() as connection:
        frames.settle(connection, key, "silo7", state, NOW)
    return key


def test_the_migrations_make_the_schema(store: Store) -> None:
    with store.read() as connection:
        context = MigrationContext.configure(connection, opts={"compare_type": True})
        differences = compare_metadata(context, metadata)
    assert differences == []


def test_a_frame_is_claimed_once_newest_first_and_counts_its_attempts(store: Store, tmp_path: Path) -> None:
    filled(store, tmp_path / "site")
    old, new = (arrived(store, sha, NOW + k, frames.QUEUED) for k, sha in enumerate(("a" * 64, "b" * 64)))
    first, second = frames.claim(store, NOW), frames.claim(store, NOW)
    assert (first.id, second.id, first.attempts) == (new, old, 1)
    assert frames.claim(store, NOW) is None
    assert frames.requeue_interrupted(store) == 2
    assert frames.claim(store, NOW).attempts == 2
    arrival = frames.Arrival("cam7", "a" * 64, NOW, NOW, "good", "png", 3)
    assert Recorder(store).record(arrival, lambda: True) == (old, False)
    with pytest.raises(frames.BytesGone):
        Recorder(store).record(frames.Arrival("cam7", "c" * 64, NOW, NOW, "good", "png", 3), lambda: False)


def test_frames_that_arrive_together_share_commits_and_none_is_told_before(store: Store, tmp_path: Path) -> None:
    """60 frames of 12 senders at a time; one whose bytes are gone fails alone, one of an unknown camera too."""
    filled(store, tmp_path / "site")
    commits = 0

    def counted(_connection: Any) -> None:
        nonlocal commits
        commits += 1

    event.listen(store.engine, "commit", counted)
    recorder, before = Recorder(store), commits

    def sent(k: int) -> str:
        camera = "nobody" if k == 30 else "cam7"
        arrival = frames.Arrival(camera, f"{k:064x}", NOW + k, NOW, "good", "png", 3)
        try:
            key, new = recorder.record(arrival, lambda: k != 40)
        except (frames.BytesGone, IntegrityError) as error:
            return type(error).__name__
        with store.read() as connection:
            assert frames.get(connection, key).sha256 == arrival.sha256
        return "new" if new else "known"

    with ThreadPoolExecutor(12) as pool:
        found = list(pool.map(sent, range(60)))
    assert found == ["IntegrityError" if k == 30 else "BytesGone" if k == 40 else "new" for k in range(60)]
    assert commits - before < 59 + 58  # a read's end is a commit too
    with store.read() as connection:
        assert frames.waiting(connection) == 58


def test_a_new_run_keeps_the_old_reading(store: Store, tmp_path: Path) -> None:
    filled(store, tmp_path / "site")
    key = arrived(store, "a" * 64, NOW)
    row = {"frame": key, "silo": "silo7", "time": NOW, "clock": "good", "status": "ok", "quality": []}
    with store.write() as connection:
        for note, volume in (("first", 1.0), ("second", 2.0)):
            run = readings.run_of(connection, "1", "x", "recomputed", NOW, note)
            readings.add(connection, {**row, "run": run, "volume": volume}, None, NOW)
        assert frames.reading_of(connection, key).volume == 2.0
        count = connection.execute(text("SELECT count(*) FROM reading WHERE frame IS NOT NULL")).scalar()
        shown = readings.page(connection, "silo7", readings.Span(NOW), None, 10)
    assert count == 2
    assert [row.volume for row in shown if row.frame] == [2.0]


def test_buckets_and_the_newest_are_of_good_clocks_only(store: Store, tmp_path: Path) -> None:
    filled(store, tmp_path / "site")
    with store.write() as connection:
        run = readings.run_of(connection, "1", "x", "measured", NOW)
        wrong = {"silo": "silo7", "time": 5 * SECOND, "clock": "suspect", "run": run, "status": "ok", "quality": []}
        readings.add(connection, {**wrong, "volume": 99.0}, None, NOW)
        readings.add(connection, {**wrong, "volume": 99.0, "time": NOW + 300 * DAY}, None, NOW)
        assert readings.last(connection, "silo7", answered=True).time == NOW
        found = readings.buckets(connection, "silo7", readings.Span(NOW - 2 * DAY, NOW + 1), HOUR)
        assert sum(row.number for row in found) == 48
        assert max(row.volume_max for row in found) == 10.0
        assert len(readings.page(connection, "silo7", readings.Span(), None, 100)) == 50


@pytest.mark.parametrize("to", ["sqlite", "postgresql"])
def test_a_site_moves_from_one_database_to_another(
    store: Store, to: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    filled(store, tmp_path / "site")
    (tmp_path / "other").mkdir()
    target = opened(new_url(request, tmp_path / "other", to))
    counts = transfer.copy(store, target)
    assert (counts["reading"], counts["surface"], counts["user"]) == (48, 48, 1)
    with target.write() as connection:
        run = readings.run_of(connection, "2", "y", "measured", NOW)
        row = {"silo": "silo7", "time": NOW, "clock": "good", "run": run, "status": "ok", "quality": []}
        assert readings.add(connection, row, None, NOW) > 48
        assert whole(connection) == []
    with pytest.raises(UsageError, match="not empty"):
        transfer.copy(store, target)
    target.close()


def test_a_backup_is_taken_and_put_back(store: Store, tmp_path: Path) -> None:
    filled(store, tmp_path / "site")
    transfer.write_file(store, tmp_path / "backup.db")
    with pytest.raises(UsageError, match="is there already"):
        transfer.write_file(store, tmp_path / "backup.db")
    administration.restore(tmp_path / "new", None, tmp_path / "backup.db")
    found = administration.restore(tmp_path / "new", None, tmp_path / "backup.db")
    assert Path(found["kept"]).exists()
    assert administration.check(tmp_path / "new", None)["wrong"] == []
    again = opened(Settings(tmp_path / "new").url)
    with again.read() as connection:
        assert len(readings.page(connection, "silo7", readings.Span(), None, 100)) == 48
    again.close()


def test_a_backup_that_is_none_or_damaged_is_refused(tmp_path: Path) -> None:
    store = opened(Settings(tmp_path).url)
    filled(store, tmp_path / "site")
    backup = tmp_path / "backup.db"
    transfer.write_file(store, backup)
    store.close()
    damaged = bytearray(backup.read_bytes())
    damaged[len(damaged) // 2 : len(damaged) // 2 + 6000] = bytes(6000)
    backup.write_bytes(bytes(damaged))
    with pytest.raises(InputError, match="damaged"):
        administration.restore(tmp_path / "new", None, backup)
    backup.write_bytes(b"no database")
    with pytest.raises(InputError, match="is no backup"):
        administration.restore(tmp_path / "new", None, backup)


def test_check_names_lost_bytes(tmp_path: Path) -> None:
    store, blobs = opened(Settings(tmp_path).url), Blobs(tmp_path / "frames")
    filled(store, tmp_path / "site")
    with blobs.receiving() as part:
        part.add(b"abc")
        path = blobs.keep(part)
        sha256 = part.sha256
    arrived(store, sha256, NOW)
    store.close()
    assert administration.check(tmp_path, None)["exit_code"] == 0
    path.write_bytes(b"abd")
    found = administration.check(tmp_path, None)
    assert (found["exit_code"], len(found["wrong"])) == (5, 1)
    assert sha256 in found["wrong"][0]


def test_an_older_program_refuses_a_newer_schema_by_name(tmp_path: Path) -> None:
    opened(Settings(tmp_path).url).close()
    store = Store(Settings(tmp_path).url)
    with store.write() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '9999'"))
    store.close()
    with pytest.raises(InputError, match=r"schema '9999' of a newer siloscope.*restore a backup"):
        opened(Settings(tmp_path).url)


def test_a_network_file_system_is_refused(tmp_path: Path) -> None:
    mounts = tmp_path / "mounts"
    mounts.write_text(
        f"/dev/sda / ext4 rw 0 0\nnas:/x {tmp_path}/far nfs4 rw 0 0\nnas:/y {tmp_path}/a\\040b cifs rw 0 0\n"
    )
    assert kind_of(tmp_path / "near", mounts) == "ext4"
    refuse_network(tmp_path / "near", mounts)
    for name in ("far", "a b"):
        with pytest.raises(UsageError, match="network file system"):
            refuse_network(tmp_path / name / "data", mounts)


def test_two_services_do_not_share_a_folder(tmp_path: Path) -> None:
    lock = Lock(tmp_path / "lock")
    with pytest.raises(UsageError, match="another service"):
        Lock(tmp_path / "lock")
    lock.release()
    Lock(tmp_path / "lock").release()


class SmallDisk(Blobs):
    """A disk for so many files."""

    def __init__(self, folder: Path, whole: int = 10) -> None:
        super().__init__(folder)
        self.whole = whole

    def free(self) -> tuple[int, int]:
        return self.whole - len(list(self.hashes())), self.whole


def kept(store: Store, blobs: Blobs, text_: bytes, captured: int, state: str = frames.MEASURED) -> str:
    with blobs.receiving() as part:
        part.add(text_)
        blobs.keep(part)
        sha256 = part.sha256
    return arrived(store, sha256, captured, state)


def keeper(store: Store, blobs: Blobs, reserve: int = 0) -> Keeper:
    return Keeper(store, blobs, Limits(reserve=reserve, reserve_fraction=1.0), Retention(), SetClock(NOW))


def there(store: Store, key: str) -> bool:
    with store.read() as connection:
        return bool(frames.get(connection, key).kept)


def test_old_frames_go_but_for_one_a_day_and_readings_stay(store: Store, tmp_path: Path) -> None:
    filled(store, tmp_path / "site")
    blobs = Blobs(tmp_path / "frames")
    day = (NOW // DAY - 40) * DAY
    old = [kept(store, blobs, f"old{k}".encode(), day + k * HOUR) for k in range(4)]
    waiting = kept(store, blobs, b"waiting", day + 5 * HOUR, frames.GATHERING)
    young = kept(store, blobs, b"young", NOW - DAY)
    gone = keeper(store, blobs).keep()
    assert gone.by_age == 3
    assert [there(store, key) for key in (*old, waiting, young)] == [True, False, False, False, True, True]
    assert len(list(blobs.hashes())) == 3
    with store.read() as connection:
        assert len(readings.page(connection, "silo7", readings.Span(), None, 100)) == 48
        assert set(aging.kept_hashes(connection)) == set(blobs.hashes())


def test_a_nearly_full_disk_loses_its_oldest_frames_first(store: Store, tmp_path: Path) -> None:
    filled(store, tmp_path / "site")
    blobs = SmallDisk(tmp_path / "frames")
    keys = [kept(store, blobs, f"frame{k}".encode(), NOW - (9 - k) * HOUR) for k in range(9)]
    waiting = kept(store, blobs, b"waiting", NOW - 20 * HOUR, frames.QUEUED)
    gone = keeper(store, blobs, reserve=2).keep()
    assert gone.for_room == 9
    assert not any(there(store, key) for key in keys)
    assert there(store, waiting)


def test_the_newest_evidence_stays_and_the_reserve_is_free_again(store: Store, tmp_path: Path) -> None:
    """Whatever their age, the oldest go, and no more than the room needs."""
    filled(store, tmp_path / "site")
    blobs = SmallDisk(tmp_path / "frames", 200)
    keys = [kept(store, blobs, f"frame{k}".encode(), NOW - (140 - k) * SECOND) for k in range(140)]
    gone = keeper(store, blobs, reserve=60).keep()
    assert (gone.by_age, gone.for_room) == (0, 50)
    assert [there(store, key) for key in keys] == [False] * 50 + [True] * 90
    assert blobs.free()[0] >= 60
    with store.read() as connection:
        assert len(readings.page(connection, "silo7", readings.Span(), None, 100)) == 48


def test_a_disk_without_room_is_told_on_the_page(tmp_path: Path) -> None:
    """The page asks anew when the log says so."""
    service = farm.make(tmp_path)
    with farm.listening(service) as address:
        client = Client(address)
        assert client.get("/api/v1/site")["disk_short"] is False
        service.blobs.free = lambda: (1, 1000)  # type: ignore[method-assign]
        service.start()
        changed = eventually(
            lambda: [one for one in client.pages("/api/v1/changes", {}) if one["kind"] == "site"], seconds=30
        )
        assert [one["subject"] for one in changed] == ["disk"]
        assert client.get("/api/v1/site")["disk_short"] is True


def test_two_processes_and_many_readers_never_find_it_locked(tmp_path: Path) -> None:
    """Each process has its own write lock; the file's own has to do between them."""
    url = Settings(tmp_path).url
    stores = [opened(url) for _ in range(2)]
    filled(stores[0], tmp_path / "site")
    stop, failed = threading.Event(), []

    def write(store: Store, name: str) -> None:
        for k in range(40):
            with store.write() as connection:
                before = places.fact(connection, "count") or 0
                places.set_fact(connection, "count", before + 1)
                places.put(connection, "place", f"{name}{k}", {"kind": "site", "name": name}, NOW)

    def read(store: Store) -> None:
        while not stop.is_set():
            with store.read() as connection:
                readings.page(connection, "silo7", readings.Span(), None, 100)

    def guarded(work: Any, *told: Any) -> None:
        try:
            work(*told)
        except Exception as error:
            failed.append(error)

    writers = [threading.Thread(target=guarded, args=(write, stores[k % 2], f"w{k}")) for k in range(6)]
    readers = [threading.Thread(target=guarded, args=(read, store)) for store in stores]
    for thread in (*writers, *readers):
        thread.start()
    for thread in writers:
        thread.join()
    stop.set()
    for thread in readers:
        thread.join()
    with stores[0].read() as connection:
        assert (failed, places.fact(connection, "count")) == ([], 240)
    for store in stores:
        store.close()


def test_bytes_that_two_cameras_sent_stay_while_one_frame_needs_them(store: Store, tmp_path: Path) -> None:
    filled(store, tmp_path / "site")
    blobs = Blobs(tmp_path / "frames")
    with store.write() as connection:
        places.put(connection, "camera", "cam8", {"silo": "silo7"}, NOW)
    day = (NOW // DAY - 40) * DAY
    kept(store, blobs, b"first", day)
    kept(store, blobs, b"same", day + HOUR)
    sha256 = max(blobs.hashes(), key=lambda one: blobs.path(one).read_bytes() == b"same")
    other = frames.Arrival("cam8", sha256, NOW, NOW, "good", "png", 4)
    Recorder(store).record(other, lambda: True)
    assert keeper(store, blobs).keep().by_age == 1
    assert blobs.intact(sha256)


def test_a_frame_whose_bytes_were_lost_is_taken_again(store: Store, tmp_path: Path) -> None:
    filled(store, tmp_path / "site")
    key = arrived(store, "a" * 64, NOW, frames.FAILED)
    with store.write() as connection:
        frames.settle(connection, key, "silo7", frames.FAILED, NOW, kept=False)
    again = frames.Arrival("cam7", "a" * 64, NOW, NOW, "good", "png", 3)
    assert Recorder(store).record(again, lambda: True) == (key, True)
    assert frames.claim(store, NOW).id == key


def test_ids_rise_with_time() -> None:
    made: list[Any] = []
    for _ in range(3):
        made.append(new_id())
        time.sleep(0.002)
    assert made == sorted(made)
    assert all(len(key) == 36 and key[14] == "7" for key in made)
