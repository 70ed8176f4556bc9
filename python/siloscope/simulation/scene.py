"""A silo, what is in it, and the frames that a camera takes of it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from numbers import Integral
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.errors import UsageError
from siloscope.simulation import metrics
from siloscope.simulation.checked import checked
from siloscope.simulation.content import Content, content_of
from siloscope.simulation.defects import Defects
from siloscope.simulation.feed import Feed
from siloscope.simulation.sensor_model import PERFECT, SensorModel
from siloscope.simulation.silo import Silo
from siloscope.types.camera import Camera
from siloscope.types.estimate import Ratios
from siloscope.types.frame import Frame
from siloscope.types.pose import SiloPose

ASTRA = Camera(width=640, height=480, fx=570.3, fy=570.3, cx=319.5, cy=239.5)
"""The Orbbec Astra as the reconstructed scenarios use it."""

LARGEST_FRAME = 1 << 24
"""Pixels."""


class FlatPixels(NamedTuple):
    """Exact depth (H*W,), labels (H*W,) and normals (H*W, 3), as the core reads them."""

    depth: NDArray[np.float64]
    labels: NDArray[np.uint8]
    normals: NDArray[np.float64]


class MeasuredPixels(NamedTuple):
    """Measured depth (H*W,), and which pixels are false returns."""

    depth: NDArray[np.float64]
    false_returns: NDArray[np.bool_]


WORLDS = ("silo", "wall", "corner", "shaft", "sphere", "noise", "nothing")
"""What a scene can show; all but the first are no silos, to see whether they are taken for one."""


@dataclass(frozen=True)
class Scene:
    """A silo, what is in it, and the camera that looks at it.

    The camera sits at (t_x, t_y, 0) of the silo frame and looks as `pose` says.
    """

    silo: Silo
    pose: SiloPose
    camera: Camera = ASTRA
    feed: Feed | None = field(default_factory=Feed)
    sensor: SensorModel = PERFECT
    defects: Defects | None = None
    seed: int = 0
    """Draws the sensor's noise."""
    world: str = "silo"
    """One of `WORLDS`. Other worlds take their size from `silo` and hold no feed and no defects: "wall" is one wall
    across the axis at the cone's vertex, "corner" a floor and two walls, "shaft" a square shaft on a pyramid, "sphere"
    the inside of one, "noise" has a random depth in every pixel, "nothing" none."""

    told: Camera | None = None
    """What is told of the camera; None where that is the truth, `camera`."""

    def __post_init__(self) -> None:
        for name, kind in _PARTS.items():
            if not isinstance(getattr(self, name), kind):
                raise UsageError(f"{name} of a scene can't be {getattr(self, name)!r}; see the class of that name")
        if self.world not in WORLDS:
            raise UsageError(f"unknown world '{self.world}'; known are {', '.join(WORLDS)}")
        if not isinstance(self.seed, Integral) or not 0 <= self.seed < 2**64:
            raise UsageError(f"seed must be a whole number between 0 and 2^64 - 1, got {self.seed!r}")

    def render(self, threads: int = 1) -> SimulatedFrame:
        """Casts every pixel's ray and measures it. The result does not depend on the number of threads.

        Raises
        ------
        UsageError
            Where a number is outside its bounds, or the camera is buried in feed or outside the silo.
        """
        shape = (self.camera.height, self.camera.width)
        if shape[0] * shape[1] > LARGEST_FRAME:
            raise UsageError(f"a frame of {shape[1]} x {shape[0]} pixels is too large; simulate at most 16 megapixels")
        exact = checked(_core.render_scene, self, threads)
        seen = self._measure(FlatPixels(exact.depth, exact.labels, exact.normals), threads)
        return SimulatedFrame(
            scene=self,
            depth=exact.depth.reshape(shape),
            labels=exact.labels.reshape(shape),
            normals=exact.normals.reshape(*shape, 3),
            measured=seen.depth.reshape(shape),
            false_returns=seen.false_returns.reshape(shape),
        )

    def _measure(self, exact: FlatPixels, threads: int) -> MeasuredPixels | _core.MeasuredPixels:
        """What the sensor measures of exact pixels."""
        if self.sensor.perfect:
            return MeasuredPixels(exact.depth.copy(), np.zeros(exact.depth.shape, np.bool_))
        return checked(_core.measure_depth, self.sensor, self.camera, exact, self.seed, threads)

    def to_dict(self) -> dict[str, Any]:
        """Plain data with the fields' names."""
        return {
            "silo": asdict(self.silo),
            "pose": asdict(self.pose),
            "camera": self.camera.to_dict(),
            "feed": None if self.feed is None else asdict(self.feed),
            "sensor": {name: _plain(value) for name, value in asdict(self.sensor).items()},
            "defects": None if self.defects is None else asdict(self.defects),
            "seed": self.seed,
            "world": self.world,
            **({"told": self.told.to_dict()} if self.told else {}),
        }


_PARTS = {
    "silo": Silo,
    "pose": SiloPose,
    "camera": Camera,
    "feed": Feed | None,
    "sensor": SensorModel,
    "defects": Defects | None,
    "told": Camera | None,
}


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and math.isinf(value) else value


@dataclass(frozen=True, eq=False)
class SimulatedFrame:
    """A frame with its truth. Arrays are (H, W); metres, camera frame.

    Attributes
    ----------
    depth : float64
        Exact depth z, 0 where nothing is hit.
    labels : uint8
        What each pixel shows (`siloscope.simulation.metrics.LABELS`).
    normals : float64 (H, W, 3)
        Unit normals towards the camera; 0 where nothing is hit.
    measured : float64
        Depth after the sensor model, 0 where there is no measurement.
    false_returns : bool
        Pixels that show dust or fly between two surfaces.
    """

    scene: Scene
    depth: NDArray[np.float64]
    labels: NDArray[np.uint8]
    normals: NDArray[np.float64]
    measured: NDArray[np.float64]
    false_returns: NDArray[np.bool_]

    @property
    def pose(self) -> SiloPose:
        """The true pose."""
        return self.scene.pose

    @property
    def camera(self) -> Camera:
        """The camera."""
        return self.scene.camera

    @property
    def measured_labels(self) -> NDArray[np.uint8]:
        """Labels of what was measured: 0 where nothing was, 4 for false returns."""
        labels = np.where(self.false_returns, np.uint8(metrics.LABELS["other"]), self.labels)
        return np.where(self.measured > 0, labels, np.uint8(0))

    @cached_property
    def content(self) -> Content:
        """The feed's volume and heights."""
        return content_of(self.scene.silo, self.scene.feed if self.scene.world == "silo" else None)

    @property
    def true_volume(self) -> float:
        """Feed inside cylinder and cone, m³."""
        return self.content.volume

    @property
    def fill_fraction(self) -> float:
        """Feed volume as a share of the silo's capacity."""
        return self.true_volume / self.scene.silo.capacity

    @property
    def pixel_ratios(self) -> Ratios:
        """Shares of cylinder, cone and feed among the pixels with depth (section 2.4.4)."""
        return metrics.pixel_ratios(self.measured_labels)

    @property
    def area_ratios(self) -> Ratios:
        """The same shares by true surface area."""
        return metrics.area_ratios(self.measured_labels, self.depth, self.normals, self.camera)

    def measured_again(self, seed: int, sensor: SensorModel | None = None, threads: int = 1) -> SimulatedFrame:
        """The same exact frame with other noise, or through another sensor; far quicker than rendering it again."""
        scene = replace(self.scene, seed=seed, sensor=sensor or self.scene.sensor)
        shape = self.depth.shape
        exact = FlatPixels(self.depth.ravel(), self.labels.ravel(), self.normals.reshape(-1, 3))
        seen = scene._measure(exact, threads)
        measured, false_returns = seen.depth.reshape(shape), seen.false_returns.reshape(shape)
        return replace(self, scene=scene, measured=measured, false_returns=false_returns)

    def raw(self, unit: float | None = None) -> NDArray[np.uint16]:
        """Measured depth in raw units of `unit` metres (default: the sensor's, else 1 mm); 0 where there is none."""
        metres = unit or self.scene.sensor.unit or 1e-3
        counts = np.rint(self.measured / metres)
        return np.where(counts < 65535, counts, 0).astype(np.uint16)

    def frame(self) -> Frame:
        """The measured depth as a `Frame` in metres, with the camera that is told."""
        return Frame(depth=self.measured, camera=self.scene.told or self.camera, source="simulated frame")

    def truth(self) -> dict[str, Any]:
        """Plain data: pose, geometry, content and ratios."""
        scene = self.scene
        return {
            "world": scene.world,
            **asdict(scene.pose),
            "T_silo_camera": scene.pose.T_silo_camera.tolist(),
            "silo": scene.silo.geometry.to_dict() if scene.world == "silo" else None,
            "feed": None if scene.feed is None else asdict(scene.feed),
            "seed": scene.seed,
            "content": self.content.to_dict(),
            "volume_m3": self.true_volume,
            "capacity_m3": scene.silo.capacity,
            "fill_fraction": self.fill_fraction,
            "ratios": {"pixels": self.pixel_ratios.to_dict(), "area": self.area_ratios.to_dict()},
        }


def discharge(scene: Scene, steps: int, highest: float = 0.9, lowest: float = 0.0) -> Iterator[Scene]:
    """Scenes of a discharge (section 2.4.1): the feed level falls evenly from `highest` to `lowest` in `steps` steps.

    Every scene draws its own noise.
    """
    if steps < 1 or scene.feed is None:
        raise UsageError("a discharge needs feed and at least 1 step")
    for step, level in enumerate(np.linspace(highest, lowest, steps)):
        feed = replace(scene.feed, level=float(level))
        yield replace(scene, feed=feed, seed=(scene.seed * 1_000_003 + step) % 2**64)
