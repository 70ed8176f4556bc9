"""The newcomer's first run: a simulated discharge, the axis found in every frame, and a report of it."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import siloscope
from siloscope.simulation import ASTRA_S, Feed, Scene, Silo, SimulatedFrame, discharge
from siloscope.simulation.metrics import pc_average_distance, transform_error
from siloscope.simulation.scenarios import looking_at
from siloscope.types.calibration import Calibration
from siloscope.types.content import Content
from siloscope.types.estimate import Estimate

METHODS = ("surface", "shape-tensor")
"""What is compared: the default method and the paper's six steps."""

SENSOR = "orbbec-astra-s"
"""The profile that the `surface` method is told; the simulated sensor has its bias and noise (Eqs. 8 and 9)."""

_SILO = Silo(radius=1.4, cylinder_height=3.6, cone_height=1.7, outlet_radius=0.15, top=-0.2)

SCENE = Scene(
    silo=_SILO,
    pose=looking_at(_SILO, 0.75, -0.25, miss=(0.03, -0.02)),
    feed=Feed("funnel+lumpy", level=0.3, angle=0.5),
    sensor=replace(ASTRA_S, unit=0.001, dropout=0.02, flying=0.5, max_incidence=math.radians(83.0), max_range=8.0),
    seed=7,
)
"""A farm silo for some 25 m³ with a camera hung up beside its axis, and a low-cost sensor as it really is: centimetres
of bias far away, noise, whole millimetres, holes, flying pixels."""


@dataclass(frozen=True)
class Step:
    """One frame of the discharge: what was simulated and what each method found."""

    seen: SimulatedFrame
    estimates: dict[str, Estimate]
    milliseconds: dict[str, float]
    """Time that each method took."""
    distances: dict[str, float]
    """PC average distance (Eq. 11) of each method, metres; NaN where refused."""

    @property
    def level(self) -> float:
        """Highest feed point over the vertex as a share of the silo's height."""
        return self.seen.scene.feed.level if self.seen.scene.feed else 0.0

    def error(self, method: str) -> NDArray[np.float64]:
        """Estimate minus truth of (r_x, r_y, t_x, t_y); NaN where refused."""
        pose = self.estimates[method].pose
        if pose is None:
            return np.full(4, np.nan)
        return np.array(list(transform_error(pose, self.seen.pose).to_dict().values()))

    def std(self, method: str) -> NDArray[np.float64]:
        """Stated standard deviations (4,); NaN where there are none."""
        covariance = self.estimates[method].covariance
        return np.full(4, np.nan) if covariance is None else np.sqrt(np.diag(covariance))

    def to_dict(self) -> dict[str, Any]:
        """Plain data: level, truth, and each method's estimate, error and PC average distance."""
        return {
            "level": self.level,
            "truth": self.seen.truth(),
            "methods": {
                name: {
                    "estimate": estimate.to_dict(),
                    "error": dict(zip(("r_x", "r_y", "t_x", "t_y"), self.error(name).tolist(), strict=True)),
                    "pc_average_distance_m": self.distances[name],
                    "milliseconds": self.milliseconds[name],
                }
                for name, estimate in self.estimates.items()
            },
        }


def scenes(steps: int) -> list[Scene]:
    """The discharge, from nearly full to empty."""
    return list(discharge(SCENE, steps, highest=0.95, lowest=0.03))


def locate_all(scenes: Iterable[Scene]) -> Iterator[Step]:
    """Simulates and locates the frames one by one."""
    for scene in scenes:
        yield _step(scene.render(threads=2))


def _step(seen: SimulatedFrame) -> Step:
    estimates, milliseconds = {}, {}
    for method in METHODS:
        start = time.perf_counter()
        estimates[method] = siloscope.locate(seen.frame(), method=method, sensor=_sensor(method))
        milliseconds[method] = 1e3 * (time.perf_counter() - start)
    return Step(seen, estimates, milliseconds, {name: _distance(seen, made) for name, made in estimates.items()})


def _distance(seen: SimulatedFrame, estimate: Estimate) -> float:
    """PC average distance, asked of every 20th point."""
    if estimate.pose is None:
        return math.nan
    return pc_average_distance(estimate.pose, seen.pose, seen.depth, seen.camera, stride=20, threads=2)


def _sensor(method: str) -> str | None:
    return SENSOR if method == "surface" else None


def fused(steps: Sequence[Step]) -> Calibration:
    """All frames of the discharge as one calibration of the silo."""
    return siloscope.calibrate([step.estimates["surface"] for step in steps], sensor=SENSOR, bottom="cone")


def measured(steps: Sequence[Step], calibration: Calibration) -> Iterator[Content]:
    """What each frame's silo holds, by the calibration that all frames gave; nothing without one."""
    if calibration.pose is not None:
        for step in steps:
            yield siloscope.measure(step.seen.frame(), calibration, product="wheat")


def half_empty(steps: Sequence[Step]) -> SimulatedFrame:
    """The frame whose level is nearest to that of `SCENE`: it shows wall, cone and feed."""
    level = SCENE.feed.level if SCENE.feed else 0.0
    return min(steps, key=lambda step: abs(step.level - level)).seen


def write_frame(seen: SimulatedFrame, directory: Path) -> None:
    """Writes a frame as a user would have it: ``frame.png`` in millimetres and ``camera.json``."""
    from siloscope.io import writers

    writers.write_png(directory / "frame.png", seen.raw(0.001))
    writers.write_camera(seen.camera, directory / "camera.json", depth_unit=0.001)
