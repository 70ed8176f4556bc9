"""Scenes of every kind that the simulator knows, for the benchmarks: a kind and a seed give one scene.

All cameras but those of "exact" are off what is told of them as a calibration's are. Scenes of a tracer that shares
nothing with the simulator are in `benchmarks.populations`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from siloscope.simulation import ASTRA, ASTRA_S, Defects, Feed, Scene, defects, sensor_model, true_camera
from siloscope.simulation.scenarios import looking_at, random_scene

SHAPES = ("gaussian", "funnel", "mound", "gaussian+tilted", "rathole+lumpy+tilted")
AZURE = "azure-kinect"


@dataclass(frozen=True)
class Case:
    """A scene, and the profile that a user would name."""

    kind: str
    scene: Scene
    profile: str = "orbbec-astra-s"


def _feed(seed: int, draw: np.random.Generator) -> Feed:
    return Feed(SHAPES[seed % len(SHAPES)], float(draw.uniform(0.05, 0.55)), seed=seed)


def _plain(seed: int, draw: np.random.Generator) -> Scene:
    return random_scene(seed, _feed(seed, draw), sensor=ASTRA_S)


def _walled(names: str) -> Callable[[int, np.random.Generator], Scene]:
    """A plain silo whose wall has defects."""

    def make(seed: int, draw: np.random.Generator) -> Scene:
        return replace(_plain(seed, draw), defects=defects(names, seed))

    return make


def _bent(seed: int, draw: np.random.Generator) -> Scene:
    bend = Defects(bend=float(draw.uniform(0.002, 0.008)), bend_azimuth=float(draw.uniform(-3.1, 3.1)))
    return replace(_plain(seed, draw), defects=bend)


def _cake(seed: int, draw: np.random.Generator, lobes: int = 0) -> Scene:
    """Feed sticks to the lower part of the wall: all round, or on one side."""
    scene = _plain(seed, draw)
    height = scene.silo.cylinder_height
    band = (
        float(height * draw.uniform(0.2, 0.5)),
        float(height * draw.uniform(0.7, 1.0)),
        float(draw.uniform(0.01, 0.05)),
    )
    film = Defects(film_bands=(band,), film_lobes=lobes, film_azimuth=float(draw.uniform(-3.1, 3.1)))
    return replace(scene, defects=film)


def _build_up(seed: int, draw: np.random.Generator) -> Scene:
    return _cake(seed, draw, lobes=1)


def _bottom(seed: int, draw: np.random.Generator, feed: Feed | None, **bottom: Any) -> Scene:
    """A plain silo on another bottom; the camera looks at its lowest place."""
    scene = random_scene(seed, feed, sensor=ASTRA_S)
    silo = replace(scene.silo, **bottom)
    pose = scene.pose
    miss = draw.uniform(-0.06, 0.06, 2)
    pose = looking_at(silo, pose.t_x, pose.t_y, (float(miss[0]), float(miss[1])))
    return replace(scene, silo=silo, pose=pose, feed=feed)


def _low(seed: int, draw: np.random.Generator) -> Feed | None:
    """Feed that leaves some of the bottom in view, or none."""
    return None if seed % 2 else Feed("flat+lumpy", float(draw.uniform(0.02, 0.15)), lump_height=0.01, seed=seed)


def _oblique(seed: int, draw: np.random.Generator) -> Scene:
    radius = random_scene(seed).silo.radius
    aside, azimuth = radius * math.exp(draw.uniform(math.log(0.02), math.log(0.5))), draw.uniform(-3.1, 3.1)
    offset = (float(aside * math.cos(azimuth)), float(aside * math.sin(azimuth)))
    return _bottom(seed, draw, _low(seed, draw), bottom="oblique", outlet_offset=offset)


def _two_stage(seed: int, draw: np.random.Generator) -> Scene:
    silo = random_scene(seed).silo
    waist = {
        "waist_radius": silo.radius * draw.uniform(0.4, 0.7),
        "waist_depth": silo.cone_height * draw.uniform(0.2, 0.4),
    }
    return _bottom(seed, draw, _low(seed, draw), bottom="two-stage", **waist)


def _pyramid(seed: int, draw: np.random.Generator) -> Scene:
    return _bottom(seed, draw, _low(seed, draw), bottom="pyramid", bottom_azimuth=float(draw.uniform(-3.1, 3.1)))


def _flat(seed: int, draw: np.random.Generator) -> Scene:
    return _bottom(seed, draw, None, bottom="flat", cone_height=0.0)


def _ring(seed: int, draw: np.random.Generator) -> Scene:
    """Dead feed along the wall of a flat floor, its lowest place bare or at the floor."""
    silo = random_scene(seed).silo
    angle = float(draw.uniform(0.4, 0.62))
    level = silo.radius * math.tan(angle) * float(draw.uniform(0.65, 1.0)) / silo.cylinder_height
    return _bottom(seed, draw, Feed("funnel", min(level, 0.6), angle, seed=seed), bottom="flat", cone_height=0.0)


def _crater(seed: int, draw: np.random.Generator) -> Scene:
    """A draw-down crater of 30 to 50 degrees in a flat-bottom bin."""
    silo = random_scene(seed).silo
    aside, azimuth = silo.radius * draw.uniform(0.0, 0.4), draw.uniform(-3.1, 3.1)
    feed = Feed(
        "crater",
        float(draw.uniform(0.2, 0.55)),
        math.radians(draw.uniform(30.0, 50.0)),
        centre=(float(aside * math.cos(azimuth)), float(aside * math.sin(azimuth))),
        crater_depth=float(silo.radius * draw.uniform(0.3, 1.0)),
        seed=seed,
    )
    return _bottom(seed, draw, feed, bottom="flat", cone_height=0.0)


def _courses(seed: int, draw: np.random.Generator) -> Scene:
    scene = _plain(seed, draw)
    silo = scene.silo
    edges = np.arange(1, 5) * draw.uniform(0.8, 1.4)
    steps = [
        (float(e), float(silo.radius + draw.uniform(-0.01, 0.01))) for e in edges if e < silo.cylinder_height - 0.3
    ]
    return replace(scene, silo=replace(silo, courses=tuple(steps)))


def _multipath(seed: int, draw: np.random.Generator) -> Scene:
    sensor = replace(sensor_model(AZURE, seed), multipath=float(draw.uniform(0.05, 0.2)), max_range=12.0)
    return replace(_plain(seed, draw), sensor=sensor)


def _warped(seed: int, draw: np.random.Generator) -> Scene:
    """A sensor with a lasting warp that no profile knows, 1 mm at 1 m."""
    return replace(_plain(seed, draw), sensor=replace(ASTRA_S, warp=0.001, warp_seed=seed))


KINDS: dict[str, Callable[[int, np.random.Generator], Scene]] = {
    "exact": _plain,
    "plain": _plain,
    "real wall": _walled("seams,dents,oval,ladder,cables"),
    "corrugated": _walled("corrugated"),
    "bent": _bent,
    "courses": _courses,
    "build-up": _build_up,
    "cake": _cake,
    "oblique": _oblique,
    "two-stage": _two_stage,
    "pyramid": _pyramid,
    "flat": _flat,
    "ring": _ring,
    "crater": _crater,
    "multipath": _multipath,
    "warped": _warped,
}


def case(kind: str, seed: int) -> Case:
    """The scene of a kind and seed."""
    scene = KINDS[kind](seed, np.random.default_rng((seed, 11)))
    profile = AZURE if kind == "multipath" else "orbbec-astra-s"
    if kind != "exact":
        scene = replace(scene, camera=true_camera(ASTRA, "calibrated", seed), told=ASTRA)
    return Case(kind, scene, profile)


def mixed(seeds: range) -> list[Case]:
    """One scene a seed, the kinds in turn."""
    names = list(KINDS)
    return [case(names[seed % len(names)], seed) for seed in seeds]
