"""The farm's silos: what they are, what is in them, and what is wrong with their cameras."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from siloscope.simulation import ASTRA_S, Feed, Scene, SensorModel, Silo, content_of
from siloscope.simulation.scenarios import looking_at
from siloscope.types.camera import Camera

CAMERA = Camera(width=320, height=240, fx=285.15, fy=285.15, cx=159.5, cy=119.5)
"""A low-cost depth camera at half its resolution."""

SENSOR = "orbbec-astra-s"

UNIT = 0.001
"""Metres per raw unit of its frames."""

LEVELS = 41
"""Levels at which the volume is worked out."""

SENSOR_MODEL = replace(ASTRA_S, unit=UNIT, dropout=0.02, max_incidence=math.radians(83.0), max_range=8.0)


@dataclass(frozen=True)
class FarmSilo:
    """A silo of the farm."""

    id: str
    name: str
    place: str
    product: str
    silo: Silo
    feed: Feed
    at: tuple[float, float]
    """Where its camera hangs, m."""
    daily: float
    """Use, as a fraction of the capacity a day."""
    seed: int
    fault: str | None = None
    """"dirty" (a film on the lens for the last days), "moved" (the camera was knocked today), "silent" (no frame since
    yesterday)."""

    @property
    def camera(self) -> str:
        """Its camera's id."""
        return f"cam-{self.id}"

    @cached_property
    def _levels(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        levels = np.linspace(0.0, 1.0, LEVELS)
        volumes = [content_of(self.silo, replace(self.feed, level=float(level))).volume for level in levels]
        return levels, np.maximum.accumulate(np.array(volumes))

    @property
    def full(self) -> float:
        """Volume at which it is called full, m³."""
        return float(0.97 * self._levels[1][-1])

    def level(self, volume: float) -> float:
        """Level of the feed at a volume, as `Feed` has it."""
        levels, volumes = self._levels
        return float(np.interp(volume, volumes, levels))

    def scene(self, volume: float, seed: int, *, moved: bool = False, sensor: SensorModel = SENSOR_MODEL) -> Scene:
        """What the camera looks at."""
        pose = looking_at(self.silo, *self.at, miss=(0.03, -0.02))
        if moved:
            pose = replace(pose, r_x=pose.r_x + 0.05, r_y=pose.r_y - 0.04)
        return Scene(self.silo, pose, CAMERA, replace(self.feed, level=self.level(volume)), sensor, seed=seed)


def _silo(radius: float, cylinder: float, cone: float) -> Silo:
    return Silo(radius, cylinder, cone, outlet_radius=0.12, top=-0.2)


_FUNNEL, _MOUND, _STEEP = Feed("funnel", angle=0.5), Feed("mound", angle=0.4), Feed("funnel+lumpy", angle=0.55)
_TILTED, _HEAP, _CRATER = Feed("funnel+tilted", angle=0.45), Feed("gaussian"), Feed("crater+lumpy")

SILOS = (
    FarmSilo("north-1", "North 1", "north", "wheat", _silo(1.25, 2.6, 1.9), _FUNNEL, (0.6, -0.2), 0.09, 1),
    FarmSilo("north-2", "North 2", "north", "barley", _silo(1.40, 3.0, 2.1), _MOUND, (0.7, 0.2), 0.07, 2, "dirty"),
    FarmSilo("north-3", "North 3", "north", "pellets", _silo(1.10, 2.2, 1.8), _TILTED, (-0.5, 0.3), 0.12, 3, "moved"),
    FarmSilo("south-1", "South 1", "south", "maize", _silo(1.50, 3.2, 2.3), _HEAP, (0.8, 0.1), 0.06, 4, "silent"),
    FarmSilo("south-2", "South 2", "south", "ground-maize", _silo(1.05, 2.0, 1.7), _CRATER, (0.45, -0.35), 0.14, 5),
    FarmSilo("south-3", "South 3", "south", "soybean-meal", _silo(1.30, 2.8, 2.0), _STEEP, (-0.65, -0.15), 0.08, 6),
)
