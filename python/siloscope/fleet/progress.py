"""How far a run is and what it costs: an account a process, a line for people, JSON, and a Prometheus text file."""

from __future__ import annotations

import json
import os
import socket
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from siloscope.fleet.naming import RunPaths
from siloscope.fleet.plan import document_bytes
from siloscope.fleet.store import Store
from siloscope.fleet.tasks import Outcome

SCHEMA = "siloscope.fleet-progress/1"

INTERVAL = 10.0
"""Seconds between two lines, and between two writings of the account."""


@dataclass
class Account:
    """What one driver or indexed worker has done in a run."""

    run: str
    shards_total: int
    shards_done: int
    """Measured and committed, those of earlier drivers too."""
    frames_total: int
    frames_left: int
    frames: Counter[str] = field(default_factory=Counter)
    """Measured here, by status."""
    tasks: Counter[str] = field(default_factory=Counter)
    """Done here, by kind."""
    failed: dict[str, str] = field(default_factory=dict)
    bytes_read: int = 0
    cpu_seconds: float = 0.0
    peak_bytes: int = 0
    started: float = field(default_factory=time.monotonic)
    name: str = field(default_factory=lambda: f"{socket.gethostname()}-{os.getpid()}-{time.time_ns()}")

    def add(self, outcome: Outcome) -> None:
        """Counts a committed task."""
        self.tasks[outcome.task.kind] += 1
        self.bytes_read += outcome.bytes_read
        self.cpu_seconds += outcome.cpu_seconds
        self.peak_bytes = max(self.peak_bytes, outcome.peak_bytes)
        if outcome.task.kind == "measure":
            self.shards_done += 1
            self.frames.update(outcome.counts)
            self.frames_left -= sum(outcome.counts.values())

    @property
    def seconds(self) -> float:
        """Since it was begun."""
        return time.monotonic() - self.started

    def to_dict(self) -> dict[str, Any]:
        """Plain data; ``seconds_left`` is null before a frame is measured."""
        measured = sum(self.frames.values())
        rate = measured / self.seconds if self.seconds > 0.0 else 0.0
        return {
            "schema": SCHEMA,
            "run": self.run,
            "shards": {"total": self.shards_total, "done": self.shards_done},
            "frames": {"total": self.frames_total, "left": self.frames_left, **self.frames},
            "tasks": dict(self.tasks),
            "failed": sorted(self.failed),
            "frames_per_second": rate,
            "bytes_read": self.bytes_read,
            "core_hours": self.cpu_seconds / 3600.0,
            "cpu_ms_per_frame": 1e3 * self.cpu_seconds / measured if measured else None,
            "peak_worker_bytes": self.peak_bytes,
            "seconds": self.seconds,
            "seconds_left": self.frames_left / rate if rate > 0.0 else None,
        }


class Reporter:
    """Tells an account every `INTERVAL` seconds and at the end."""

    def __init__(self, place: Store, say: Callable[[Account], None], metrics: Path | None) -> None:
        self.place, self.say, self.metrics = place, say, metrics
        self._next = time.monotonic() + INTERVAL

    def __call__(self, account: Account) -> None:
        """Tells it if it is time."""
        if time.monotonic() >= self._next:
            self.tell(account)

    def tell(self, account: Account) -> None:
        """Tells it now."""
        self._next = time.monotonic() + INTERVAL
        self.say(account)
        if account.tasks:
            name = f"{RunPaths(account.run).progress()}{account.name}.json"
            self.place.put(name, document_bytes(account.to_dict()))
        if self.metrics is not None:
            _replace(self.metrics, prometheus(account))


def costs(place: Store, run: str) -> dict[str, float]:
    """What all drivers and workers of a run have spent so far: ``core_hours`` and ``bytes_read``."""
    spent = {"core_hours": 0.0, "bytes_read": 0.0}
    for name in place.names(RunPaths(run).progress()):
        told = json.loads(place.get(name))
        for key in spent:
            spent[key] += float(told[key])
    return spent


def line(account: Account) -> str:
    """One line for people."""
    told = account.to_dict()
    left = told["seconds_left"]
    end = "" if left is None or not account.frames_left else f", {_duration(left)} to go"
    failed = f", {len(account.failed)} failed" if account.failed else ""
    return (
        f"{account.shards_done} of {account.shards_total} shards{failed}, {told['frames_per_second']:.0f} frames/s, "
        f"{account.bytes_read / 1e9:.2f} GB read, {told['core_hours']:.3f} core-hours{end}"
    )


def prometheus(account: Account) -> str:
    """The account in Prometheus' text format, for node_exporter's textfile collector."""
    told = account.to_dict()
    rows = (
        ("shards", "gauge", "Shards of the plan.", account.shards_total),
        ("shards_done", "gauge", "Shards that are measured and committed.", account.shards_done),
        ("shards_failed", "gauge", "Tasks that were given up.", len(account.failed)),
        ("frames_left", "gauge", "Frames that are not measured yet.", account.frames_left),
        ("frames_measured_total", "counter", "Frames measured by this process.", sum(account.frames.values())),
        ("read_bytes_total", "counter", "Bytes of frames read.", account.bytes_read),
        ("cpu_seconds_total", "counter", "CPU time of the tasks.", account.cpu_seconds),
        ("worker_peak_bytes", "gauge", "Largest resident size of a worker.", account.peak_bytes),
        ("frames_per_second", "gauge", "Mean rate since the start.", told["frames_per_second"]),
    )
    text = ""
    for name, kind, meaning, value in rows:
        full = f"siloscope_fleet_{name}"
        text += f'# HELP {full} {meaning}\n# TYPE {full} {kind}\n{full}{{run="{account.run}"}} {value}\n'
    return text


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {rest} s" if minutes else f"{rest} s"


def _replace(path: Path, text: str) -> None:
    beside = path.with_name(f".{path.name}.new")
    beside.write_text(text, "utf-8")
    beside.replace(path)
