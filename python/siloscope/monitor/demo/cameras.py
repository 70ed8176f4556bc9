"""The farm's cameras, in a process of their own: a frame a minute each, sent as any camera sends it."""

from __future__ import annotations

import os
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from siloscope.client import Client, ServiceError
from siloscope.io import writers
from siloscope.monitor.clock import MINUTE, SECOND, SystemClock
from siloscope.monitor.demo.history import History, history
from siloscope.monitor.demo.silos import SENSOR_MODEL, SILOS, UNIT, FarmSilo

EVERY = MINUTE

FILM = 0.75
"""Fraction of a dirty lens's pixels that show nothing."""


def run(root: str, tokens: dict[str, str], begin: int) -> None:
    """Sends frames until the service, whose child this is, ends."""
    told = {silo.id: history(silo, begin) for silo in SILOS}
    clients = {silo.id: Client(root, tokens[silo.camera]) for silo in SILOS}
    due = {silo.id: SystemClock().now() + k * EVERY // len(SILOS) // 6 for k, silo in enumerate(SILOS)}
    parent = os.getppid()
    with tempfile.TemporaryDirectory(prefix="siloscope-demo-") as folder:
        while os.getppid() == parent:
            now = SystemClock().now()
            for silo in (one for one in SILOS if one.fault != "silent" and due[one.id] <= now):
                due[silo.id] += EVERY
                send(clients[silo.id], silo, told[silo.id], now, Path(folder))
            time.sleep(0.5)


def send(client: Client, silo: FarmSilo, told: History, now: int, folder: Path) -> None:
    """One frame; one that can't be sent is lost, as a camera without a disk loses it."""
    path = folder / f"{silo.id}.png"
    writers.write_png(path, frame(silo, told.at(now), now // SECOND))
    try:
        client.send(silo.camera, path, captured=now / SECOND)
    except (ServiceError, OSError):
        return


def frame(silo: FarmSilo, volume: float, seed: int) -> np.ndarray[tuple[int, int], np.dtype[np.uint16]]:
    """Raw depth of what the camera sees."""
    sensor = replace(SENSOR_MODEL, dropout=FILM, dropout_length=25.0) if silo.fault == "dirty" else SENSOR_MODEL
    scene = silo.scene(volume, seed, moved=silo.fault == "moved", sensor=sensor)
    return scene.render().raw(UNIT)
