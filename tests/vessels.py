"""Frames of the independent oracle's vessels with what is known about them, for the tests of the content."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

import siloscope
from oracle import kinds, volumes
from oracle.clutter import Bar
from oracle.drawing import Draw
from oracle.feed import Feed
from oracle.scenes import Scene, Vessel
from oracle.sensors import Sensor
from oracle.solids import Solid
from oracle.walls import Courses, Round, Wall
from siloscope import sensors
from siloscope.sensors import SensorProfile
from siloscope.types.floor import Floor


def bar(start: tuple[float, float, float], end: tuple[float, float, float], diameter: float) -> Bar:
    """A round bar; places in the silo frame."""
    return Bar(start, end, diameter / 2.0)


@dataclass(frozen=True)
class Seen:
    """A scene, what it shows, and its truth by quadrature. m³."""

    scene: Scene

    @classmethod
    def draw(cls, kind: str, seed: int, width: int = 320) -> Seen:
        """A scene of a kind, told its camera exactly."""
        drawn = kinds.draw(kind, seed, width)
        return cls(replace(drawn, told=drawn.camera))

    @classmethod
    def draw_all(cls, kind: str, seed: int, width: int, sensor: Sensor) -> Seen:
        """A scene of a kind with wall and camera drawn from their priors: out of round, in courses, intrinsics off."""
        drawn = kinds.draw(kind, seed, width)
        d, vessel = Draw((seed, 1818)), drawn.vessel
        assert vessel is not None
        radius, rim, top = vessel.wall.radius, vessel.bottom.rim, vessel.top
        step = d.between(0.001, 0.004)
        courses = Courses((top + 0.35 * (rim - top), top + 0.7 * (rim - top)), (0.0, step, -step))
        wall = Wall(radius, (Round(2, radius * d.log(0.0005, 0.005), d.angle()), courses))
        return cls(replace(drawn, vessel=replace(vessel, wall=wall), sensor=sensor))

    @property
    def vessel(self) -> Vessel:
        """The vessel."""
        assert self.scene.vessel is not None
        return self.scene.vessel

    @property
    def top(self) -> float:
        """z of the upper edge."""
        return self.vessel.top

    @cached_property
    def camera(self) -> siloscope.Camera:
        """As the product is told it."""
        c = self.scene.told
        return siloscope.Camera(c.width, c.height, c.fx, c.fy, c.cx, c.cy)

    @cached_property
    def frame(self) -> siloscope.Frame:
        """What the sensor measures."""
        return siloscope.Frame(depth=self.scene.shoot().reading, camera=self.camera)

    @cached_property
    def profile(self) -> SensorProfile:
        """The sensor's own bias and noise."""
        return sensors.load(self.scene.sensor.profile)

    def calibration(self, floor: Floor | None = None, std: float = 5e-4) -> siloscope.Calibration:
        """Pose and radius as they are, with a standard deviation; the bottom was never seen."""
        p, radius = self.scene.pose, self.vessel.wall.radius
        bias = self.profile.bias
        values = np.array([p.r_x, p.r_y, p.t_x, p.t_y, radius, np.nan, np.nan, *bias, 0.0, 0.0])
        covariance = np.diag([std**2] * 5 + [0.0] * 7)
        return siloscope.Calibration(
            "ok",
            pose=siloscope.SiloPose(*values[:4]),
            covariance=covariance[:4, :4],
            silo=siloscope.SiloGeometry(radius=radius),
            silo_std=siloscope.SiloGeometry(radius=std),
            parameters=values,
            parameter_covariance=covariance,
            config={"sensor": self.profile.to_dict()},
            floor=floor or Floor(),
        )

    def with_feed(self, feed: Feed | None) -> Seen:
        """The same vessel and camera with another feed."""
        return Seen(replace(self.scene, feed=feed))

    def again(self, number: int) -> Seen:
        """The same at another moment: other noise."""
        return Seen(replace(self.scene, seed=(*self.scene.seed, number)))

    def with_things(self, things: tuple[Solid, ...]) -> Seen:
        """The same with things hanging in it."""
        return Seen(replace(self.scene, things=things))

    @cached_property
    def ullage(self) -> float:
        """Free volume up to the upper edge."""
        return volumes.ullage(self.vessel, self.scene.feed)

    @cached_property
    def content(self) -> float:
        """Volume of the feed."""
        return volumes.content(self.vessel, self.scene.feed)

    @cached_property
    def capacity(self) -> float:
        """Volume of the empty vessel up to its upper edge."""
        return volumes.ullage(self.vessel, None)
