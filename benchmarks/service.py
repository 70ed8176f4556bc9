"""How fast the service takes frames and measures them, beside what the machine can do at that moment.

    python benchmarks/service.py

Intake: durable posts of 300 kB a second by several clients, beside the same writes made plainly (file, fsync, rename,
fsync of the folder, and an SQLite commit with `synchronous=FULL`) by as many threads. Measuring: frames a second of one
worker from the queue to the committed reading, beside the decoding of the same PNG files. Rounds alternate, so that
what else runs on the machine counts for both; medians are printed, and the median of the rounds' ratios.
"""

from __future__ import annotations

import argparse
import hashlib
import http.client
import os
import random
import sqlite3
import statistics
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

MAGIC = b"\x89PNG\r\n\x1a\n"
SIZE = 300_000


def bodies(count: int, seed: int) -> list[bytes]:
    """Different files that begin as frames do."""
    draw = random.Random(seed)
    return [MAGIC + draw.randbytes(SIZE) for _ in range(count)]


def rate(work: Callable[[bytes], None], clients: int, some: list[bytes]) -> float:
    """Items a second, `clients` at a time."""
    start = time.perf_counter()
    with ThreadPoolExecutor(clients) as pool:
        list(pool.map(work, some))
    return len(some) / (time.perf_counter() - start)


class Plain:
    """The same promise without a service."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir()
        self.lock = threading.Lock()
        self.database = sqlite3.connect(folder / "plain.db", check_same_thread=False, isolation_level=None)
        for word in ("PRAGMA journal_mode=WAL", "PRAGMA synchronous=FULL", "CREATE TABLE frame (sha256 TEXT)"):
            self.database.execute(word)

    def keep(self, body: bytes) -> None:
        """Puts bytes on the disk, and a row."""
        sha256 = hashlib.sha256(body).hexdigest()
        part = self.folder / f"{sha256}.part"
        handle = os.open(part, os.O_WRONLY | os.O_CREAT)
        os.write(handle, body)
        os.fsync(handle)
        os.close(handle)
        os.replace(part, self.folder / sha256)
        handle = os.open(self.folder, os.O_RDONLY)
        os.fsync(handle)
        os.close(handle)
        with self.lock:
            self.database.execute("INSERT INTO frame VALUES (?)", (sha256,))


class Poster:
    """Clients with a kept connection each."""

    def __init__(self, root: str, token: str) -> None:
        self.host, self.token, self.local = root.removeprefix("http://"), token, threading.local()

    def post(self, body: bytes) -> None:
        """Sends a frame; anything but 201 is a fault."""
        if not hasattr(self.local, "line"):
            self.local.line = http.client.HTTPConnection(self.host, timeout=120)
        headers = {"Authorization": f"Bearer {self.token}", "Content-SHA256": hashlib.sha256(body).hexdigest()}
        self.local.line.request("POST", "/api/v1/cameras/cam7/frames", body, headers)
        answer = self.local.line.getresponse()
        answer.read()
        if answer.status != 201:
            raise RuntimeError(f"answered {answer.status}")


def intake(folder: Path, rounds: int, count: int) -> None:
    """Prints posts a second."""
    from monitor.servers import serving, write_site

    site = write_site(folder / "site", calibrated=False)
    with serving(folder / "data", site, "--workers", "0") as server:
        token = server.token("camera", "cam7")
        plain = Plain(folder / "plain")
        for clients in (4, 8):
            posts, writes = [], []
            for turn in range(rounds):
                some, others = (bodies(count, 1000 * clients + 2 * turn + k) for k in (0, 1))
                poster = Poster(server.root, token)
                writes.append(rate(plain.keep, clients, others))
                posts.append(rate(poster.post, clients, some))
            told("posts", clients, posts, "plain writes", writes)


def measuring(folder: Path, rounds: int, count: int) -> None:
    """Prints readings a second of a worker."""
    from monitor.servers import eventually, frame_bytes, serving, write_site
    from siloscope.io import open as open_frames

    files = [frame_bytes(0.3 + 0.4 * k / count, k) for k in range(count)]
    (folder / "frame.png").write_bytes(files[0])
    site = write_site(folder / "site")
    readings, decoded = [], []
    for turn in range(rounds):
        with serving(folder / f"data{turn}", site, "--workers", "0") as server:
            poster = Poster(server.root, server.token("camera", "cam7"))
            for body in files:
                poster.post(body)
        with serving(folder / f"data{turn}", site) as server:
            queued = "/api/v1/frames?state=queued&count=1000"
            eventually(lambda: len(server.get(queued).json["items"]) < count - 5, 120)  # noqa: B023
            start, left = time.perf_counter(), len(server.get(queued).json["items"])
            eventually(lambda: not server.get("/api/v1/site").json["frames_queued"], 600)
            readings.append(left / (time.perf_counter() - start))
        start = time.perf_counter()
        for body in files:
            (folder / "frame.png").write_bytes(body)
            with open_frames(folder / "frame.png", depth_unit=0.001) as source:
                next(iter(source))
        decoded.append(count / (time.perf_counter() - start))
    told("readings", 1, readings, "decoded files", decoded)


def told(name: str, clients: int, ours: list[float], other: str, theirs: list[float]) -> None:
    """One line."""
    a, b = statistics.median(ours), statistics.median(theirs)
    ratio = statistics.median(x / y for x, y in zip(ours, theirs, strict=True))
    print(f"{name:9} {clients} at a time {a:6.1f}/s, {other} {b:6.1f}/s, ratio {ratio:.2f}", flush=True)


def main() -> None:
    """Prints both."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--posts", type=int, default=200)
    parser.add_argument("--frames", type=int, default=100)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="siloscope-service-") as folder:
        intake(Path(folder), given.rounds, given.posts)
        measuring(Path(folder), given.rounds, given.frames)


if __name__ == "__main__":
    main()
