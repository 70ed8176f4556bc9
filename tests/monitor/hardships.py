"""Kills, power cuts and full disks under senders that repeat what was not acknowledged; and what is lost then.

`python -m monitor.hardships` (make monitor-proof) does it at length and prints the figures.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import http.client
import json
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from monitor.servers import Server, write_site

MAGIC = b"\x89PNG\r\n\x1a\n"

CLIENTS = 4

UP_S = (0.2, 3.0)
"""Between a start, which takes longer, and a kill, s."""


@dataclass
class Senders:
    """Clients that send frames without end, each one again until it is acknowledged."""

    size: int
    token: str
    root: str = ""
    acknowledged: list[tuple[str, str]] = field(default_factory=list)
    """Frame and hash."""
    refused: list[int] = field(default_factory=list)
    requests: int = 0

    def __post_init__(self) -> None:
        self._stop = threading.Event()
        self._threads = [threading.Thread(target=self._run, args=(k,), daemon=True) for k in range(CLIENTS)]

    def __enter__(self) -> Senders:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        for thread in self._threads:
            thread.join(30)

    def _run(self, number: int) -> None:
        draw = random.Random(number)
        while not self._stop.is_set():
            body = MAGIC + draw.randbytes(self.size)
            sha256 = hashlib.sha256(body).hexdigest()
            while not self._stop.is_set() and not self._once(body, sha256):
                time.sleep(0.05)

    def _once(self, body: bytes, sha256: str) -> bool:
        headers = {"Authorization": f"Bearer {self.token}", "Content-SHA256": sha256}
        request = urllib.request.Request(f"{self.root}/api/v1/cameras/cam7/frames", body, headers)
        self.requests += 1
        try:
            with urllib.request.urlopen(request, timeout=10) as answer:
                self.acknowledged.append((json.load(answer)["frame"], sha256))
            return True
        except urllib.error.HTTPError as error:
            self.refused.append(error.code)
            return False
        except (OSError, ValueError, http.client.HTTPException):
            return False


def lost(data: Path, acknowledged: list[tuple[str, str]]) -> int:
    """Acknowledged frames whose row or bytes are not there as they were sent."""
    with contextlib.closing(sqlite3.connect(data / "siloscope.db")) as connection:
        assert connection.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        rows = dict(connection.execute("SELECT id, sha256 FROM frame").fetchall())
    gone = 0
    for frame, sha256 in acknowledged:
        path = data / "frames" / sha256[:2] / sha256
        good = path.exists() and hashlib.sha256(path.read_bytes()).hexdigest() == sha256
        gone += rows.get(frame) != sha256 or not good
    return gone


@contextlib.contextmanager
def patched_server(data: Path, site: Path, careless: str | None) -> Iterator[Server]:
    """A server without workers; a careless one breaks its word in a named way, to see that these tests notice."""
    server = Server(data, site, ("--workers", "0"))
    if careless is not None:
        server.module = ("monitor.careless", careless)
    server.env = {"PYTHONPATH": str(Path(__file__).parents[1])}
    try:
        yield server
    finally:
        if server.process is not None and server.process.poll() is None:
            server.process.send_signal(signal.SIGCONT)
            server.kill()


@dataclass(frozen=True)
class Result:
    """What a hardship cost."""

    times: int
    requests: int
    acknowledged: int
    lost: int
    refused: tuple[int, ...] = ()


def kills(folder: Path, times: int, *, size: int = 20_000, careless: str | None = None, least: int = 0) -> Result:
    """Kill -9 at random moments; goes on until enough frames were acknowledged."""
    data, site, draw = folder / "data", write_site(folder / "site", calibrated=False), random.Random(5)
    with patched_server(data, site, careless) as server:
        server.start()
        senders = Senders(size, server.token("camera", "cam7"), server.root)
        with senders:
            done = 0
            while done < times or len(senders.acknowledged) < least:
                time.sleep(draw.uniform(*UP_S))
                server.kill()
                done += 1
                server.site = None  # it is applied already
                server.start()
                senders.root = server.root
            time.sleep(0.3)
        assert list((data / "frames" / "incoming").iterdir()) == []
        server.kill()
    return Result(done, senders.requests, len(senders.acknowledged), lost(data, senders.acknowledged))


def power_cuts(folder: Path, times: int, *, size: int = 20_000, careless: str | None = None) -> Result:
    """The disk as it is at a random moment, without what is not written yet, mounted anew; its journal is replayed."""
    image, mount, replayed = folder / "disk.img", folder / "mount", folder / "replayed"
    mount.mkdir(parents=True)
    replayed.mkdir()
    total, gone, requests, draw = 0, 0, 0, random.Random(6)
    for _ in range(times):
        _make_disk(image, mount)
        try:
            with patched_server(mount / "data", write_site(folder / "site", calibrated=False), careless) as server:
                server.start()
                senders = Senders(size, server.token("camera", "cam7"), server.root)
                with senders:
                    time.sleep(draw.uniform(0.5, 2.0))
                    server.process.send_signal(signal.SIGSTOP)
                    kept = list(senders.acknowledged)
                    shutil.copyfile(image, folder / "cut.img")
                    server.process.send_signal(signal.SIGCONT)
                server.kill()
        finally:
            subprocess.run(["umount", str(mount)], check=True)
        subprocess.run(["mount", "-o", "loop", str(folder / "cut.img"), str(replayed)], check=True)
        try:
            total, gone, requests = (
                total + len(kept),
                gone + _lost_or_all(replayed / "data", kept),
                requests + senders.requests,
            )
        finally:
            subprocess.run(["umount", str(replayed)], check=True)
    return Result(times, requests, total, gone)


def _lost_or_all(data: Path, kept: list[tuple[str, str]]) -> int:
    """All of them where not even the database can be read."""
    try:
        return lost(data, kept)
    except (sqlite3.DatabaseError, AssertionError):
        return len(kept)


def _make_disk(image: Path, mount: Path) -> None:
    with image.open("wb") as file:
        file.truncate(96 << 20)
    subprocess.run(["mkfs.ext4", "-q", "-F", str(image)], check=True)
    subprocess.run(["mount", "-o", "loop", str(image), str(mount)], check=True)


def full_disk(folder: Path, megabytes: int = 24) -> tuple[Result, int]:
    """A disk that fills up and has room again; what was acknowledged before and after, and what was then."""
    mount = folder / "small"
    mount.mkdir(parents=True)
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={megabytes}m", "tmpfs", str(mount)], check=True)
    try:
        ballast = mount / "ballast"
        ballast.write_bytes(bytes(8 << 20))
        with patched_server(mount / "data", write_site(folder / "site", calibrated=False), None) as server:
            server.start()
            senders = Senders(200_000, server.token("camera", "cam7"), server.root)
            with senders:
                _until(lambda: len(senders.refused) > 20)
                stray = list((mount / "data" / "frames" / "incoming").iterdir())
                ballast.unlink()
                before = len(senders.acknowledged)
                _until(lambda: len(senders.acknowledged) > before + 10)
            assert len(stray) <= CLIENTS
            server.kill()
        acknowledged = senders.acknowledged
        counts = Result(
            1, senders.requests, len(acknowledged), lost(mount / "data", acknowledged), tuple(senders.refused)
        )
        return counts, before
    finally:
        subprocess.run(["umount", str(mount)], check=True)


def _until(true: object, seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not true():  # type: ignore[operator]
        assert time.monotonic() < end
        time.sleep(0.05)


def may_mount() -> bool:
    """Whether this machine lets the test make disks."""
    if os.geteuid() != 0 or shutil.which("mkfs.ext4") is None:
        return False
    with tempfile.TemporaryDirectory(prefix="siloscope-disk-") as folder:
        image, mount = Path(folder) / "disk.img", Path(folder) / "mount"
        mount.mkdir()
        try:
            _make_disk(image, mount)
        except (OSError, subprocess.CalledProcessError):
            return False
        subprocess.run(["umount", str(mount)], check=True)
        return True


def main() -> int:
    """The long run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--frames", type=int, default=10_000)
    parser.add_argument("--cuts", type=int, default=20)
    told = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="siloscope-proof-") as folder:
        place = Path(folder)
        found = {"kills": kills(place / "kills", told.kills, least=told.frames)}
        print(found["kills"], flush=True)
        if may_mount():
            found["cuts"] = power_cuts(place / "cuts", told.cuts)
            print(found["cuts"], flush=True)
            control = power_cuts(place / "control", 3, careless="no-flush")
            print(f"control without flushes: {control}", flush=True)
            found["full"], before = full_disk(place / "full")
            print(f"full disk, {before} acknowledged before there was room again: {found['full']}", flush=True)
        return 1 if any(one.lost for one in found.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
