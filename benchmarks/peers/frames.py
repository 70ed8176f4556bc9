"""The frames that all methods get: the evaluation's silos, with exact depths, noise, noise and bias, and as in use."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from siloscope.reproduction.discharges import EXACT
from siloscope.sensors import SensorProfile, load
from siloscope.simulation import ASTRA_S, PERFECT, Scene, SensorModel, Silo
from siloscope.simulation.metrics import LABELS
from siloscope.simulation.scenarios import scenario
from siloscope.simulation.stand_ins import REAL_PROFILE, real_silo
from siloscope.types.camera import Camera
from siloscope.types.pose import SiloPose

SILOS = ("silo1", "silo2", "silo3", "silo-r1", "silo-r2")
LEVELS = (0.1, 0.35)

NOISE_ONLY = replace(ASTRA_S, bias=(0.0, 0.0, 0.0))
"""Eq. 9 without Eq. 8."""

SENSORS: dict[str, tuple[SensorModel, SensorProfile]] = {
    "perfect": (PERFECT, EXACT),
    "noise": (NOISE_ONLY, replace(load("orbbec-astra-s"), bias=(0.0, 0.0, 0.0))),
    "noise and bias": (ASTRA_S, load("orbbec-astra-s")),
}
"""What the sensor does, and what may be known of it."""

IN_USE = "in use"
"""Stand-ins for real silos: wall defects, irregular feed, an Astra with everything that it does."""


@dataclass(frozen=True, eq=False)
class Shown:
    """A frame as a method gets it, with what only the referee and those told may look at."""

    name: str
    kind: str
    part: str
    """ "whole" or "walls": the latter without feed, by the true labels."""
    depth: NDArray[np.float32]
    camera: Camera
    silo: Silo
    pose: SiloPose
    profile: SensorProfile
    whole: NDArray[np.float32]
    """The whole frame, on which errors are measured."""

    def points(self) -> NDArray[np.float64]:
        """Points (N, 3) in the camera frame (Eqs. 1 and 2), as a user of these libraries computes them."""
        v, u = np.nonzero(self.depth > 0)
        z = self.depth[v, u].astype(np.float64)
        camera = self.camera
        return np.column_stack([z * (u - camera.cx) / camera.fx, z * (v - camera.cy) / camera.fy, z])

    def write(self, path: Path) -> None:
        """As the C++ programs read it."""
        camera = self.camera
        head = struct.pack(
            "=ii4d", camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy
        )  # fmt: skip
        path.write_bytes(head + np.ascontiguousarray(self.depth, np.float32).tobytes())


def scenes() -> Iterator[tuple[str, str, Scene, SensorProfile]]:
    """Name, kind, scene and profile of every frame."""
    for seed, name in enumerate(SILOS, start=70):
        for level in LEVELS:
            base = scenario(name)
            base = replace(base, feed=replace(base.feed, level=level), seed=seed)
            for kind, (sensor, profile) in SENSORS.items():
                yield f"{name}, {100 * level:g} %", kind, replace(base, sensor=sensor), profile
    for seed, name in enumerate(("silo-r1", "silo-r2"), start=80):
        for level in LEVELS:
            real = real_silo(name, seed)
            real = replace(real, feed=replace(real.feed, level=level))
            yield f"{name}, {100 * level:g} %", IN_USE, real, load(REAL_PROFILE)


def shown(name: str, kind: str, scene: Scene, profile: SensorProfile) -> list[Shown]:
    """A scene's frame as a whole and with its walls alone."""
    frame = scene.render()
    whole = frame.measured.astype(np.float32)
    wall = np.isin(frame.measured_labels, (LABELS["cylinder"], LABELS["cone"]))
    parts = {"whole": whole, "walls": np.where(wall, whole, np.float32(0))}
    known = (scene.camera, scene.silo, scene.pose, profile, whole)
    return [Shown(name, kind, part, depth, *known) for part, depth in parts.items()]
