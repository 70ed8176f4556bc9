"""A server in a process of its own, on a free port of this machine; sites for it; requests to it."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import silos
from siloscope.io import writers
from siloscope.monitor import administration
from siloscope.simulation import Feed

PATIENCE_S = 60.0


@dataclass
class Answer:
    """What came back."""

    status: int
    headers: dict[str, str]
    body: bytes

    @property
    def json(self) -> Any:
        return json.loads(self.body)


@dataclass
class Server:
    """A running `siloscope serve`."""

    data: Path
    site: Path | None = None
    options: tuple[str, ...] = ()
    env: dict[str, str] = field(default_factory=dict)
    root: str = ""
    module: tuple[str, ...] = ("siloscope",)
    process: subprocess.Popen[str] | None = None

    def start(self) -> Server:
        command = [sys.executable, "-m", *self.module, "serve", "--data", str(self.data), "--bind", "127.0.0.1:0"]
        command += [] if self.site is None else ["--site", str(self.site)]
        log = (self.data.parent / f"{self.data.name}.log").open("a")
        self.process = subprocess.Popen(
            [*command, *self.options], stdout=subprocess.PIPE, stderr=log, text=True, env=os.environ | self.env
        )
        self.root = self.process.stdout.readline().strip()
        assert self.root.startswith("http://127.0.0.1:"), self.log()
        eventually(lambda: self.get("/healthz").status == 200)
        return self

    def log(self) -> str:
        return (self.data.parent / f"{self.data.name}.log").read_text()

    def stop(self) -> int:
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(PATIENCE_S)

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()

    def token(self, role: str, camera: str | None = None) -> str:
        return str(administration.token(self.data, None, role, camera, None)["token"])

    def ask(
        self, method: str, path: str, body: bytes | None = None, token: str | None = None, **headers: str
    ) -> Answer:
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        if token is not None:
            named["Authorization"] = f"Bearer {token}"
        request = urllib.request.Request(self.root + path, body, named, method=method)
        try:
            with urllib.request.urlopen(request, timeout=PATIENCE_S) as answer:
                return Answer(answer.status, dict(answer.headers), answer.read())
        except urllib.error.HTTPError as error:
            return Answer(error.code, dict(error.headers), error.read())

    def get(self, path: str, token: str | None = None) -> Answer:
        return self.ask("GET", path, token=token)

    def send(self, method: str, path: str, document: Any, token: str | None = None, **headers: str) -> Answer:
        body = json.dumps(document).encode()
        return self.ask(method, path, body, token, Content_Type="application/json", **headers)

    def post(self, camera: str, body: bytes, token: str, **headers: str) -> Answer:
        headers = {"Content_SHA256": hashlib.sha256(body).hexdigest(), **headers}
        return self.ask("POST", f"/api/v1/cameras/{camera}/frames", body, token, **headers)

    def settled(self, frame: str) -> Any:
        """The frame once it is neither queued nor in work."""
        found = eventually(
            lambda: (f := self.get(f"/api/v1/frames/{frame}").json)["state"] not in ("queued", "measuring") and f
        )
        return found


@contextmanager
def serving(data: Path, site: Path | None = None, *options: str, **env: str) -> Iterator[Server]:
    """A server that ends with the block."""
    server = Server(data, site, options, env).start()
    try:
        yield server
    finally:
        if server.process.poll() is None:
            server.kill()


def monitor(data: Path, *arguments: str) -> str:
    """What `siloscope monitor` prints."""
    command = [sys.executable, "-m", "siloscope", "monitor", arguments[0], *arguments[1:], "--data", str(data)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def problem(answer: Answer) -> tuple[int, str]:
    """Status and slug of a refusal, which has the one shape that all have."""
    assert answer.headers["content-type"] == "application/problem+json"
    assert {"type", "title", "status", "detail"} <= set(answer.json)
    assert answer.json["status"] == answer.status
    return answer.status, str(answer.json["slug"])


def eventually(found: Callable[[], Any], seconds: float = PATIENCE_S) -> Any:
    """The first true value; fails when none comes."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        value = found()
        if value:
            return value
        time.sleep(0.05)
    raise AssertionError(f"not within {seconds} s")


def ago(**span: float) -> str:
    """A time before now, as a camera tells it."""
    seconds = span.get("seconds", 0) + 60 * span.get("minutes", 0) + 3600 * span.get("hours", 0)
    return datetime.fromtimestamp(time.time() - seconds, UTC).isoformat()


@cache
def frame_bytes(level: float, seed: int = 1) -> bytes:
    """A PNG of a silo filled to a level; of another seed another one."""
    frame = silos.noisy(silos.scene(Feed("funnel", level)), seed).render()
    return png(frame.raw(0.001))


def png(raw: np.ndarray[Any, np.dtype[np.uint16]]) -> bytes:
    """A depth image as a PNG file."""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        writers.write_png(Path(folder) / "frame.png", raw)
        return (Path(folder) / "frame.png").read_bytes()


def true_volume(level: float) -> float:
    """What `frame_bytes` shows."""
    return float(silos.scene(Feed("funnel", level)).render().true_volume)


def write_site(folder: Path, cameras: int = 1, *, calibrated: bool = True, more: str = "") -> Path:
    """SITE.toml of one silo with some cameras, their files beside it."""
    folder.mkdir(parents=True, exist_ok=True)
    scene = silos.noisy(silos.scene(Feed("funnel", 0.5)))
    silos.known(scene, 1e-3).save(folder / "silo7.json")
    writers.write_camera(scene.camera, folder / "camera.json", depth_unit=0.001)
    lines = ['[site]\nname = "Test"\nzone = "Europe/Madrid"\n[[place]]\nid = "farm"\n']
    lines += ['[[silo]]\nid = "silo7"\nplace = "farm"\nproduct = "wheat"\n']
    lines += ['calibration = "silo7.json"\n'] if calibrated else ['bottom = "cone"\n']
    for number in range(cameras):
        lines.append(
            f'[[camera]]\nid = "cam{number + 7}"\nsilo = "silo7"\nintrinsics = "camera.json"\n'
            'sensor = "orbbec-astra-s"\ndepth_unit = 0.001\n'
        )
    path = folder / "SITE.toml"
    path.write_text("".join(lines) + more)
    return path
