"""The paper's silos by name, and silos nobody has seen."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from siloscope import sensors
from siloscope.errors import UsageError
from siloscope.simulation import ASTRA, PERFECT, Feed, Scene, SensorModel, Silo, sensor_model
from siloscope.types.camera import Camera
from siloscope.types.pose import SiloPose

SILO1 = Scene(Silo(1.25, 4.5, 1.0), SiloPose(0.0, -0.01454, 0.08, 0.0))
"""Small silo, short cone, camera next to the axis. Reconstructed: the values of Table 1 are lost."""

SILO2 = Scene(Silo(1.75, 6.0, 2.0), SiloPose(0.0, -0.16718, 1.35, 0.0))
"""Bigger silo, camera near the wall. Reconstructed: the values of Table 1 are lost."""

SILO3 = Scene(Silo(1.5, 1.9, 2.6), SiloPose(0.20, -0.24, 0.6, 0.5))
"""Short cylinder, large cone, camera turned both ways. Reconstructed: the values of Table 1 are lost."""

SILO_R1_PRINTED = Scene(Silo(1.18, 2.75, 2.0), SiloPose(0.013, 0.16, 0.7, -0.04))
"""Real silo R1, Table 2 as printed: with Eqs. 5–7 this camera looks away from the axis."""

SILO_R2_PRINTED = Scene(Silo(1.07, 1.4, 1.85), SiloPose(0.1, 0.1, 0.54, 0.01))
"""Real silo R2, Table 2 as printed."""


def _negated(scene: Scene) -> Scene:
    pose = scene.pose
    return replace(scene, pose=replace(pose, r_x=-pose.r_x, r_y=-pose.r_y))


def looking_at(silo: Silo, t_x: float, t_y: float, miss: tuple[float, float] = (0.0, 0.0)) -> SiloPose:
    """Pose of a camera at (t_x, t_y, 0) that looks at the cone's vertex, or past it by `miss` radians in r_x, r_y.

    The optical axis is the third column of Eq. 5, ``(cos r_x sin r_y, -sin r_x, cos r_x cos r_y)``.
    """
    apex = silo.top + silo.height
    r_x = math.asin(t_y / math.hypot(t_x, t_y, apex))
    return SiloPose(r_x + miss[0], math.atan2(-t_x, apex) + miss[1], t_x, t_y)


def _aimed(t: tuple[float, float], target: tuple[float, float, float]) -> SiloPose:
    """Pose of a camera at (t_x, t_y, 0) that looks at a point of the silo frame."""
    x, y, z = target[0] - t[0], target[1] - t[1], target[2]
    return SiloPose(-math.asin(y / math.hypot(x, y, z)), math.atan2(x, z), *t)


COMPARISON_SILO = Silo(0.78, 1.65, 1.7)
"""The empty silo of section 2.4.5."""


def _comparison(sensor: str, size: tuple[int, int], r_x: float, r_y: float, device: int) -> Scene:
    """Section 2.4.5: every sensor in its turn at the same place of the top edge, with the turn that its body needs.

    The paper gives the turns of D455 and L515 (Table 7) and no places; those, and the other turns, are reconstructed.
    """
    camera = sensors.load(sensor).camera(*size)
    if camera is None:
        raise UsageError(f"the profile '{sensor}' has no camera of {size[0]} x {size[1]} pixels")
    return Scene(COMPARISON_SILO, SiloPose(r_x, r_y, -0.62, 0.02), camera, None, sensor_model(sensor, device))


LIDAR = Camera(
    width=1024,
    height=768,
    fx=512 / math.tan(math.radians(35.0)),
    fy=384 / math.tan(math.radians(27.5)),
    cx=511.5,
    cy=383.5,
)
"""A LiDAR-like camera that sees 70° x 55°."""

LIDAR_NOISE = SensorModel(noise=(0.01, 0.0, 0.0))
"""10 mm at every depth."""


def big_silo(radius: float, cylinder_height: float, cone_height: float) -> Scene:
    """A silo of industrial size, seen by the LiDAR-like sensor from 0.6 radii off the axis."""
    silo = Silo(radius, cylinder_height, cone_height)
    return Scene(silo, looking_at(silo, 0.6 * radius, 0.1 * radius, (0.01, -0.02)), LIDAR, sensor=LIDAR_NOISE)


def _brim_full() -> Scene:
    return replace(SILO1, feed=Feed("mound", 0.92))


def _room(world: str) -> Scene:
    return replace(SILO2, feed=None, world=world)


def _corner() -> Scene:
    silo = SILO2.silo
    return replace(_room("corner"), pose=_aimed((0.0, 0.0), (silo.radius, silo.radius, silo.height)))


SCENARIOS: dict[str, Callable[[], Scene]] = {
    "silo1": lambda: SILO1,
    "silo2": lambda: SILO2,
    "silo3": lambda: SILO3,
    "silo-r1": lambda: _negated(SILO_R1_PRINTED),
    "silo-r2": lambda: _negated(SILO_R2_PRINTED),
    "silo-r1-printed": lambda: SILO_R1_PRINTED,
    "silo-r2-printed": lambda: SILO_R2_PRINTED,
    "comparison-astra": lambda: _comparison("orbbec-astra", (640, 480), 0.030, 0.310, 1),
    "comparison-d415": lambda: _comparison("realsense-d415", (1280, 720), 0.045, 0.290, 2),
    "comparison-d455": lambda: _comparison("realsense-d455", (848, 480), 0.07588, 0.31265, 3),
    "comparison-l515": lambda: _comparison("realsense-l515", (1024, 768), -0.01917, 0.30532, 4),
    "big-6m": lambda: big_silo(6.0, 11.0, 4.0),
    "big-9m": lambda: big_silo(9.0, 16.0, 6.0),
    "big-12m": lambda: big_silo(12.0, 22.0, 8.0),
    "brim-full": _brim_full,
    "flat-wall": lambda: _room("wall"),
    "room-corner": _corner,
    "square-shaft": lambda: _room("shaft"),
    "sphere": lambda: replace(_room("sphere"), pose=SiloPose(0.05, -0.1, 0.3, 0.1)),
    "noise": lambda: _room("noise"),
    "nothing": lambda: _room("nothing"),
}
"""Makers of scenes by name.

silo1–3 are reconstructed, silo-r1 and silo-r2 are those of Table 2 with the rotations negated (so that the cameras look
at the axis) and "printed" without; all have the Gaussian feed at 10 % and a perfect sensor. comparison-* are the four
sensors of section 2.4.5, big-* silos of industrial size. The rest shows no wall to go by and must be refused.
"""


def scenario(name: str) -> Scene:
    """The scene of a name in `SCENARIOS`, also as the paper writes it ("SiloR1"); raises `UsageError` for others."""
    plain = {known.replace("-", ""): make for known, make in SCENARIOS.items()}
    make = plain.get(name.lower().replace("-", ""))
    if make is None:
        raise UsageError(f"unknown scenario '{name}'; known are {', '.join(SCENARIOS)}")
    return make()


def random_scene(
    seed: int, feed: Feed | None = None, *, sensor: SensorModel = PERFECT, camera: Camera = ASTRA, miss: float = 0.06
) -> Scene:
    """A realistic silo that nobody has seen before; the same seed gives the same scene.

    Radius 0.9–2.2 m, cylinder 1–6 m, cone 0.8–2.5 m; the camera hangs up to 0.4 m below the top edge at 0.1–0.85 of
    the radius and looks at the cone's vertex with a miss of at most `miss` radians in each angle. The feed defaults to
    the paper's at 10 %.
    """
    draw = np.random.default_rng(seed)
    radius, cylinder, cone = draw.uniform((0.9, 1.0, 0.8), (2.2, 6.0, 2.5))
    silo = Silo(float(radius), float(cylinder), float(cone), top=-float(draw.uniform(0.0, 0.4)))
    distance, azimuth = radius * draw.uniform(0.1, 0.85), draw.uniform(-math.pi, math.pi)
    misses = draw.uniform(-miss, miss, 2)
    t_x, t_y = distance * math.cos(azimuth), distance * math.sin(azimuth)
    pose = looking_at(silo, float(t_x), float(t_y), (float(misses[0]), float(misses[1])))
    return Scene(silo, pose, camera, Feed() if feed is None else feed, sensor, seed=seed)


def random_big_scene(seed: int, feed: Feed | None = None) -> Scene:
    """A silo of 6–12 m radius and 15–30 m depth that nobody has seen before, with the LiDAR-like sensor."""
    draw = np.random.default_rng((seed, 7))
    radius, depth, share = (float(x) for x in draw.uniform((6.0, 15.0, 0.2), (12.0, 30.0, 0.35)))
    silo = Silo(radius, depth * (1 - share), depth * share, top=-float(draw.uniform(0.0, 0.5)))
    distance, azimuth = radius * draw.uniform(0.2, 0.85), draw.uniform(-math.pi, math.pi)
    misses = draw.uniform(-0.06, 0.06, 2)
    t_x, t_y = float(distance * math.cos(azimuth)), float(distance * math.sin(azimuth))
    pose = looking_at(silo, t_x, t_y, (float(misses[0]), float(misses[1])))
    return Scene(silo, pose, LIDAR, Feed() if feed is None else feed, LIDAR_NOISE, seed=seed)
