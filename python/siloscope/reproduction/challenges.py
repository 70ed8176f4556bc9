"""Experiments on the limitations that section 3.6 names."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from siloscope.reproduction.discharges import EXACT
from siloscope.reproduction.solvers import ALL, GROWN
from siloscope.reproduction.trials import Trial
from siloscope.sensors import SensorProfile, load
from siloscope.simulation import ASTRA, ASTRA_S, PERFECT, Feed, Scene, SensorModel, Silo, sensor_model
from siloscope.simulation.scenarios import LIDAR, LIDAR_NOISE, looking_at, scenario
from siloscope.types.pose import SiloPose

SILOS = ("Silo1", "Silo2", "Silo3")


def views(count: int) -> list[Trial]:
    """Perfect Silo1, a third full, from many places and under many angles: shares by pixels and by area."""
    draw = np.random.default_rng(36)
    scene = replace(scenario("silo1"), feed=Feed(level=0.35))
    return [
        Trial(replace(scene, pose=_view(scene.silo, draw)), EXACT, ("shape-tensor", "surface")) for _ in range(count)
    ]


def _view(silo: Silo, draw: np.random.Generator) -> SiloPose:
    distance, azimuth = silo.radius * draw.uniform(0.05, 0.85), draw.uniform(-math.pi, math.pi)
    miss = draw.uniform(-0.25, 0.25, 2)
    t_x, t_y = float(distance * math.cos(azimuth)), float(distance * math.sin(azimuth))
    return looking_at(silo, t_x, t_y, (float(miss[0]), float(miss[1])))


LEVELS = (0.2, 0.4)
"""Feed levels of the experiment on feed shapes."""


def feeds(silo: Silo) -> dict[str, Feed]:
    """Feed shapes by name; the last but one is a funnel as steep as the cone, which looks like wall."""
    steep = math.atan2(silo.cone_height, silo.radius)
    aside = (0.25 * silo.radius, -0.15 * silo.radius)
    return {
        "Gaussian (paper)": Feed(),
        "flat": Feed("flat"),
        "mound": Feed("mound"),
        "funnel": Feed("funnel"),
        "funnel aside": Feed("funnel", centre=aside),
        "tilted": Feed("tilted"),
        "lumpy": Feed("lumpy"),
        "rathole": Feed("rathole"),
        "funnel like the cone": Feed("funnel", angle=min(steep, 1.2)),
        "funnel aside, tilted, lumpy, rathole": Feed("funnel+tilted+lumpy+rathole", centre=aside),
    }


def complex_feed(shape: str, few: int = len(SILOS)) -> list[Trial]:
    """A feed shape in the perturbed silos at `LEVELS`; in a short run only `few` silos and levels."""
    profile, trials = load("orbbec-astra-s"), []
    for seed, name in enumerate(SILOS[:few], start=50):
        scene = replace(scenario(name), sensor=ASTRA_S, seed=seed)
        feed = feeds(scene.silo)[shape]
        trials += [Trial(replace(scene, feed=replace(feed, level=level)), profile) for level in LEVELS[:few]]
    return trials


SCALES = (1.0, 2.0, 4.0, 8.0)
"""Factors by which silo1 is enlarged: radius 1.25 to 10 m."""


@dataclass(frozen=True)
class Eye:
    """A sensor for large silos, and up to which scale its law makes sense."""

    sensor: SensorModel
    profile: SensorProfile
    most: float
    lidar: bool = False


def eyes() -> dict[str, Eye]:
    """Sensors by name."""
    lidar = SensorProfile("LiDAR, 10 mm", noise=(0.0, 0.01, 0.0, 0.0, 0.0, 2.0))
    return {
        "exact depths": Eye(PERFECT, EXACT, SCALES[-1]),
        "Astra S (Eqs. 8 to 10)": Eye(ASTRA_S, load("orbbec-astra-s"), 2.0),
        "D455, sees 10 m": Eye(sensor_model("d455", 3), load("realsense-d455"), 4.0),
        "LiDAR, 10 mm": Eye(LIDAR_NOISE, lidar, SCALES[-1], lidar=True),
    }


def large(eye: Eye, scale: float, count: int) -> list[Trial]:
    """Silo1 enlarged, as a sensor sees it; none beyond the sensor's `most`."""
    if scale > eye.most:
        return []
    scene = replace(enlarged(scenario("silo1"), scale), sensor=eye.sensor, camera=LIDAR if eye.lidar else ASTRA)
    return [Trial(replace(scene, seed=seed), eye.profile, (*ALL, GROWN.name)) for seed in range(count)]


def enlarged(scene: Scene, scale: float) -> Scene:
    """The scene with all its lengths scaled; angles stay."""
    silo, pose = scene.silo, scene.pose
    return replace(
        scene,
        silo=Silo(scale * silo.radius, scale * silo.cylinder_height, scale * silo.cone_height),
        pose=replace(pose, t_x=scale * pose.t_x, t_y=scale * pose.t_y),
    )
