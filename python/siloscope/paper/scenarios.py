"""The paper's silos by name, and silos nobody has seen."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from siloscope.camera import Camera
from siloscope.errors import UsageError
from siloscope.pose import SiloPose
from siloscope.scene import ASTRA, PERFECT, Feed, Scene, SensorModel, Silo

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


SCENARIOS: dict[str, Scene] = {
    "silo1": SILO1,
    "silo2": SILO2,
    "silo3": SILO3,
    "silo-r1": _negated(SILO_R1_PRINTED),
    "silo-r2": _negated(SILO_R2_PRINTED),
    "silo-r1-printed": SILO_R1_PRINTED,
    "silo-r2-printed": SILO_R2_PRINTED,
}
"""Scenes by name, with the Gaussian feed at 10 % and a perfect sensor; silo1–3 are reconstructed."""


def scenario(name: str) -> Scene:
    """The scene of a name in `SCENARIOS`; raises `UsageError` for an unknown one."""
    if name not in SCENARIOS:
        raise UsageError(f"unknown scenario '{name}'; known are {', '.join(SCENARIOS)}")
    return SCENARIOS[name]


def looking_at(silo: Silo, t_x: float, t_y: float, miss: tuple[float, float] = (0.0, 0.0)) -> SiloPose:
    """Pose of a camera at (t_x, t_y, 0) that looks at the cone's vertex, or past it by `miss` radians in r_x, r_y.

    The optical axis is the third column of Eq. 5, ``(cos r_x sin r_y, -sin r_x, cos r_x cos r_y)``.
    """
    apex = silo.top + silo.height
    r_x = math.asin(t_y / math.hypot(t_x, t_y, apex))
    return SiloPose(r_x + miss[0], math.atan2(-t_x, apex) + miss[1], t_x, t_y)


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
