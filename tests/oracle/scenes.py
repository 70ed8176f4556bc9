"""A vessel, what is in it, the camera that looks: one frame with its truth."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from .bottoms import Bottom, Flat, Pyramid, TwoStage
from .cameras import Intrinsics, Pose
from .feed import Feed
from .sensors import ASTRA_S, Faults, Sensor, measured
from .solids import CYLINDER, Array, Labels, Solid, labels
from .tracing import normals, trace
from .walls import Wall

HARDLY_ASIDE = 0.02
"""Share of the radius by which an outlet may be off the axis of what still counts as a coaxial cone."""

FAR = 40.0
"""Depth at which rays are given up, metres."""


@dataclass(frozen=True)
class Vessel:
    """A wall that ends at the bottom's rim; `top` is the z of its upper edge."""

    wall: Wall
    bottom: Bottom
    top: float

    @property
    def solids(self) -> tuple[Solid, ...]:
        """What bounds its air."""
        return (self.wall, self.bottom)

    @property
    def geometry(self) -> dict[str, float | None]:
        """What an estimate's `silo` should say, z in the silo frame; a flat floor has no apex."""
        return {"radius": self.wall.radius, "cylinder_bottom": self.bottom.rim, "apex": self.bottom.apex}

    @property
    def bottoms(self) -> tuple[str, ...]:
        """Names of the contract's kinds of bottom that are true; a cone whose outlet is hardly aside has two."""
        bottom = self.bottom
        if isinstance(bottom, Flat):
            return ("flat",)
        if isinstance(bottom, TwoStage):
            return ("two-stage",)
        if isinstance(bottom, Pyramid):
            return ("pyramid",)
        aside = math.hypot(*bottom.offset) / bottom.radius
        return ("cone",) if aside == 0.0 else ("oblique", "cone") if aside < HARDLY_ASIDE else ("oblique",)


@dataclass(frozen=True)
class Scene:
    """Everything that a frame depends on."""

    pose: Pose
    camera: Intrinsics
    told: Intrinsics
    """What the product is told of the camera."""
    vessel: Vessel | None
    """None where there is no silo."""
    feed: Feed | None = None
    things: tuple[Solid, ...] = ()
    """Clutter, or the whole world where there is no silo."""
    sensor: Sensor = ASTRA_S
    faults: Faults = field(default_factory=Faults)
    seed: tuple[int, ...] = (0,)
    device: int = 0

    @property
    def solids(self) -> tuple[Solid, ...]:
        """All that can be met."""
        parts: tuple[Solid, ...] = self.vessel.solids if self.vessel else ()
        return (*parts, *((self.feed,) if self.feed else ()), *self.things)

    def shrunk(self, factor: int) -> Scene:
        """The same seen with fewer pixels, for a quick look."""
        c = self.camera
        small = Intrinsics(
            c.width // factor,
            c.height // factor,
            c.fx / factor,
            c.fy / factor,
            (c.cx + 0.5) / factor - 0.5,
            (c.cy + 0.5) / factor - 0.5,
            c.k1,
        )
        return replace(self, camera=small)

    def exact(self) -> tuple[Array, Labels, Array]:
        """Depth (H, W), labels (H, W), and points (H, W, 3) in the silo frame, without any error."""
        rays = self.camera.rays() @ self.pose.rotation.T
        shape = rays.shape[:2]
        if not self.solids:
            return np.zeros(shape), np.zeros(shape, np.uint8), np.zeros(rays.shape)
        depth = trace(self.solids, self.pose.origin, rays, FAR)
        points = self.pose.origin + depth[..., None] * rays
        seen = depth > 0.0
        shown = np.zeros(shape, np.uint8)
        shown[seen] = labels(self.solids, *points[seen].T)
        return depth, shown, points

    def shoot(self) -> Shot:
        """One frame."""
        depth, shown, points = self.exact()
        return Shot(self, depth, shown, points, self.reading(depth, points))

    def reading(self, depth: Array, points: Array) -> Array:
        """What the sensor reads of exact depths (H, W) and their points (H, W, 3)."""
        cosine, deep = self._lighting(depth, points)
        return measured(self.sensor, self.faults, depth, cosine, deep, self.seed, self.device)

    def _lighting(self, depth: Array, points: Array) -> tuple[Array, Array]:
        """Cosine of incidence, and how deep in the vessel a place lies, 0 to 1; only where the sensor asks."""
        cosine, deep = np.ones(depth.shape), np.zeros(depth.shape)
        seen = depth > 0.0
        if not seen.any() or not (self.faults.multipath or self.sensor.incidence):
            return cosine, deep
        towards = points[seen] - self.pose.origin
        towards /= np.linalg.norm(towards, axis=1, keepdims=True)
        cosine[seen] = np.abs((normals(self.solids, points[seen]) * towards).sum(axis=1))
        depths = points[seen][:, 2]
        deep[seen] = np.clip(depths / max(float(np.quantile(depths, 0.99)), 0.1), 0.0, 1.0) ** 2
        return cosine, deep


@dataclass(frozen=True)
class Shot:
    """A frame with its truth. Arrays (H, W)."""

    scene: Scene
    depth: Array
    labels: Labels
    points: Array
    reading: Array

    def share(self, label: int) -> float:
        """Share of the pixels with a reading that show a label."""
        seen = self.reading > 0.0
        return float((self.labels[seen] == label).mean()) if seen.any() else 0.0

    @property
    def arc(self) -> float:
        """Degrees of the circle around the axis on which the wall is seen, in steps of 5."""
        seen = self.points[(self.labels == CYLINDER) & (self.depth > 0.0)]
        bins = np.floor(np.degrees(np.arctan2(seen[:, 1], seen[:, 0])) / 5.0).astype(int)
        _, counts = np.unique(bins, return_counts=True)
        return 5.0 * float((counts > 2e-4 * self.depth.size).sum())

    @property
    def tilt(self) -> float:
        """Degrees between the optical axis and gravity."""
        return math.degrees(math.acos(float(self.scene.pose.rotation[2, 2])))
