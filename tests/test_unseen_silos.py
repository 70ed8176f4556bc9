"""Populations of silos that the surface fit has not seen: few answers are surely wrong, most frames are answered.

Each kind holds frames that an earlier fit got wrong, and others drawn like them. The law is that of the kind, not of a
frame: another fit may lose one and win another.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

import siloscope
from siloscope import Camera
from siloscope.reproduction.discharges import real
from siloscope.simulation import ASTRA_S, Defects, Feed, Scene, Silo, defects, sensor_model
from siloscope.simulation.scenarios import random_scene

POSE = ("r_x", "r_y", "t_x", "t_y")
GEOMETRY = ("radius", "cylinder_bottom", "apex")
SURE = 4.0
"""An error of more stated deviations than this, and of more than 10 mm or 5 mrad, is surely wrong."""


@dataclass(frozen=True)
class Kind:
    """Frames of one kind, what is known of their sensor, and what is asked of them."""

    scenes: Callable[[], list[Scene]]
    answered: float
    """Least fraction of the frames with an answer."""
    typical: float
    """Bound of the median error of the axis' position, mm."""
    sensor: str | None = "orbbec-astra-s"
    diameter: bool = False
    gravity: bool = False
    """Whether gravity is told: frames that show a hopper alone, as many of the kind do, are refused without."""
    intrinsics: str | None = None
    """"exact" tells what is true of all: left open, a principal point is 2 mm on the walls, and more than a bound."""


@dataclass(frozen=True)
class Verdict:
    """An answer beside the truth."""

    errors: dict[str, float]
    """Of what is stated: metres and radians."""
    stds: dict[str, float]

    def wrong(self, names: Iterable[str]) -> list[str]:
        """What is surely wrong."""
        found = []
        for name in (name for name in names if name in self.errors):
            error, least = abs(self.errors[name]), 5e-3 if name.startswith("r_") else 1e-2
            if error > SURE * self.stds[name] and error > least:
                found.append(name)
        return found

    @property
    def position(self) -> float:
        """Error of the axis' position, mm."""
        return 1e3 * max(abs(self.errors["t_x"]), abs(self.errors["t_y"]))


def judged(scene: Scene, kind: Kind) -> Verdict | None:
    """The answer for a scene; None where it is refused."""
    diameter = 2.0 * scene.silo.radius if kind.diameter else None
    gravity = scene.pose.axis_direction if kind.gravity else None
    frame = scene.render(threads=2).frame()
    told: Any = {"sensor": kind.sensor, "diameter": diameter, "gravity": gravity, "intrinsics": kind.intrinsics}
    found = siloscope.locate(frame, **told).to_dict()
    if found["status"] != "ok":
        return None
    stated, stds = {**found["silo"], **found}, {**found["silo"]["std"], **found["std"]}
    truth = {**scene.silo.geometry.to_dict(), **{name: getattr(scene.pose, name) for name in POSE}}
    seen = [name for name in truth if stated[name] is not None]
    return Verdict({name: stated[name] - truth[name] for name in seen}, {name: stds[name] for name in seen})


def silo(seed: int, shape: str, level: float, wall: str = "", sensor: Any = ASTRA_S) -> Scene:
    """An unseen silo with feed, whose wall has defects."""
    scene = random_scene(seed, Feed(shape, level, seed=seed), sensor=sensor)
    return replace(scene, defects=defects(wall, seed)) if wall else scene


def drawn(seeds: range, shapes: tuple[str, ...], low: float, high: float, wall: str = "") -> list[Scene]:
    """Silos with levels drawn between two."""
    levels = [float(np.random.default_rng((seed, 5)).uniform(low, high)) for seed in seeds]
    return [silo(seed, shapes[seed % len(shapes)], level, wall) for seed, level in zip(seeds, levels, strict=True)]


def filmed(seed: int, feed: Feed, bands: Any, sensor: Any = ASTRA_S, miss: float = 0.06, **more: Any) -> Scene:
    """A silo with feed stuck to its wall in bands."""
    stuck = Defects(film_bands=bands, seed=seed, **more)
    return replace(random_scene(seed, replace(feed, seed=seed), sensor=sensor, miss=miss), defects=stuck)


def drawn_film(seed: int, sensor: Any = ASTRA_S, miss: float = 0.06) -> Scene:
    """One to three bands, 0.3 to 1.1 m wide, 10 to 70 mm thick."""
    draw = np.random.default_rng((seed, 6))
    shape = ("gaussian", "rathole+lumpy+tilted", "gaussian+tilted")[seed % 3]
    height = random_scene(seed).silo.cylinder_height
    count = 1 + seed % 3
    tops, widths = draw.uniform(0.0, 0.8 * height, count), draw.uniform(0.3, 1.1, count)
    ends = np.minimum(tops + widths, height)
    bands = tuple(zip(tops.tolist(), ends.tolist(), draw.uniform(0.01, 0.07, count).tolist(), strict=True))
    lobes, azimuth = int(draw.integers(0, 4)), float(draw.uniform(0.0, 6.28))
    feed = Feed(shape, float(draw.uniform(0.05, 0.45)))
    return filmed(seed, feed, bands, sensor, miss, film_lobes=lobes, film_azimuth=azimuth)


def worn_funnels() -> list[Scene]:
    wall = "seams,dents,oval,ladder,cables"
    hard = [silo(1086, "funnel", 0.28722, wall), silo(1016, "funnel", 0.4913, wall)]
    return hard + drawn(range(1080, 1086), ("funnel",), 0.25, 0.5, wall)


def corrugated() -> list[Scene]:
    hard = [silo(7116, "funnel", 0.1404, "corrugated"), silo(7140, "gaussian", 0.2115, "corrugated")]
    return hard + drawn(range(7110, 7116), ("funnel", "gaussian"), 0.12, 0.24, "corrugated")


def stuck_above_the_cone() -> list[Scene]:
    wall = "film,oval,dents"
    hard = [silo(7017, "mound", 0.1133, wall), silo(7073, "gaussian+tilted", 0.1702, wall)]
    return hard + drawn(range(7010, 7016), ("mound", "gaussian+tilted"), 0.1, 0.2, wall)


def stuck_to_much_of_the_view() -> list[Scene]:
    """Of these ten, 1056 and 3032 show next to no cylinder and a cone as flat as feed lies."""
    wall = "film,auger,dents,oval"
    levels = {7077: 0.3356, 3017: 0.1697, 3012: 0.324}
    hard = [silo(seed, "mound", level, wall) for seed, level in levels.items()]
    hard += [silo(3028, "mound", 0.3, "film,oval"), silo(1056, "funnel", 0.2966, wall)]
    return hard + drawn(range(3030, 3035), ("mound",), 0.15, 0.35, wall)


def stuck_in_bands() -> list[Scene]:
    gaussian, rathole, tilted = Feed("gaussian", 0.04644), Feed("rathole+lumpy+tilted", 0.34146), "gaussian+tilted"
    uneven = {"dents": 12, "ovality": 0.00431, "ovality_azimuth": 1.9722, "film_azimuth": 5.0235}
    three = ((0.3675, 1.2766, 0.0401), (2.5316, 3.5797, 0.0159), (3.2089, 3.4127, 0.0599))
    two = ((1.8724, 2.5526, 0.0332), (1.8574, 2.9584, 0.0649))
    other = ((5.1085, 6.234, 0.0562), (2.7928, 3.8515, 0.0734))
    most = ((3.4563, 4.022, 0.01426), (0.02899, 0.69804, 0.04807), (3.3819, 4.1317, 0.0411))
    hard = [
        filmed(168, rathole, two, film_lobes=3, film_azimuth=4.6982),
        filmed(376, replace(rathole, level=0.22652), three, film_lobes=2, film_azimuth=4.1738),
        filmed(28, gaussian, ((5.9099, 6.6881, 0.026),)),
        filmed(363, replace(gaussian, level=0.16987), other, film_azimuth=1.6877),
        filmed(255, Feed(tilted, 0.49124), most, **uneven),
    ]
    return hard + [drawn_film(seed) for seed in range(5000, 5006)]


def stuck_before_a_wide_sensor() -> list[Scene]:
    """The sensor's scale is known to 1.25 %, 6 mm of the position: the diameter settles it."""
    bands = ((1.5427, 2.1783, 0.0196), (1.895, 2.6401, 0.0599))
    feed, seen = Feed("gaussian", 0.12369), sensor_model("azure-kinect", 394)
    hard = [filmed(394, feed, bands, seen, 0.2, film_azimuth=5.244)]
    return hard + [drawn_film(seed, sensor_model("azure-kinect", seed), 0.2) for seed in range(388, 394)]


def feed_below_a_cone() -> list[Scene]:
    flaws: dict[str, Any] = {"incidence_gain": 0.05, "flying": 0.5, "dropout": 0.05, "unit": 0.001, "correlation": 0.3}
    levels = {7046: 0.226395, 7040: 0.2, 7041: 0.25, 7042: 0.18, 7043: 0.22, 7044: 0.24, 7045: 0.26, 7047: 0.21}
    sensors = {seed: replace(sensor_model("orbbec-astra", seed), **flaws) for seed in levels}
    return [silo(seed, "funnel", level, "oval,auger", sensors[seed]) for seed, level in levels.items()]


def funnels_below_an_auger() -> list[Scene]:
    seeds = (302, 308, 313, 335, *range(320, 326))
    return [silo(seed, "funnel", 0.3 + 0.01 * (seed % 30), "auger") for seed in seeds]


def tilted_funnels() -> list[Scene]:
    shape, wall = "funnel+lumpy+tilted", "dents,ladder"
    camera = Camera(width=640, height=480, fx=534.168, fy=532.621, cx=319.211, cy=247.076)
    pose = siloscope.SiloPose(-0.06874, -0.08974, 1.036, -0.27126)
    hard = Scene(Silo(1.6647, 5.7223, 1.8844, top=-0.1622), pose, camera, Feed(shape, 0.3892, seed=3077), ASTRA_S)
    others = drawn(range(3070, 3077), (shape,), 0.3, 0.45, wall)
    return [replace(hard, seed=3077, defects=defects(wall, 3077)), *others]


def little_of_the_cone() -> list[Scene]:
    hard = [replace(random_scene(206, Feed("gaussian", 0.6), sensor=ASTRA_S), seed=1), silo(3025, "gaussian", 0.48983)]
    return hard + drawn(range(3017, 3025), ("gaussian",), 0.45, 0.6)


def little_of_the_wall() -> list[Scene]:
    (printed,) = (one for one in real() if one.name == "SiloR1 as printed")
    recorded = [trial.scene for trial in printed.trials()[28:37:2]]
    hard = [random_scene(229, Feed("gaussian+tilted", 0.667), sensor=ASTRA_S)]
    return recorded + hard + drawn(range(220, 229), ("gaussian+tilted", "mound", "flat", "funnel"), 0.4, 0.7)


KINDS = {
    "worn funnels": Kind(worn_funnels, 0.7, 1.0, gravity=True),
    "corrugated, nothing known": Kind(corrugated, 0.9, 20.0, None, gravity=True),
    "feed stuck above the cone": Kind(stuck_above_the_cone, 0.8, 1.0, gravity=True),
    "feed stuck to much of the view": Kind(stuck_to_much_of_the_view, 0.7, 1.0, gravity=True, intrinsics="exact"),
    "feed stuck in bands": Kind(stuck_in_bands, 0.8, 1.0),
    "feed stuck before a wide sensor": Kind(stuck_before_a_wide_sensor, 0.8, 2.0, "azure-kinect", diameter=True),
    "feed below a cone, diameter known": Kind(feed_below_a_cone, 0.6, 15.0, None, diameter=True),
    "funnels below an auger": Kind(funnels_below_an_auger, 0.6, 1.0),
    "tilted funnels": Kind(tilted_funnels, 0.7, 1.0),
    "little of the cone": Kind(little_of_the_cone, 0.5, 1.0),
    "little of the wall, nothing known": Kind(little_of_the_wall, 0.3, 25.0, None),
}


@functools.cache
def verdicts(name: str) -> list[Verdict | None]:
    """Of all frames of a kind."""
    return [judged(scene, KINDS[name]) for scene in KINDS[name].scenes()]


def answers(name: str) -> list[Verdict]:
    """Of the frames of a kind that have one."""
    return [verdict for verdict in verdicts(name) if verdict is not None]


@pytest.mark.parametrize("name", KINDS)
def test_most_frames_are_answered_and_near_the_truth(name: str) -> None:
    kind, found = KINDS[name], answers(name)
    assert len(found) >= kind.answered * len(verdicts(name))
    assert np.median([verdict.position for verdict in found]) < kind.typical


@pytest.mark.parametrize("names", [POSE, GEOMETRY], ids=["pose", "geometry"])
@pytest.mark.parametrize("name", KINDS)
def test_at_most_one_answer_of_a_kind_is_surely_wrong(name: str, names: tuple[str, ...]) -> None:
    wrong = [verdict.wrong(names) for verdict in answers(name) if verdict.wrong(names)]
    assert len(wrong) <= 1, wrong


def test_hardly_any_answer_is_surely_wrong() -> None:
    found = [verdict for name in KINDS for verdict in answers(name)]
    assert sum(bool(verdict.wrong(POSE)) for verdict in found) <= 0.01 * len(found)
    assert sum(bool(verdict.wrong(GEOMETRY)) for verdict in found) <= 0.03 * len(found)


def test_stated_deviations_cover_the_errors() -> None:
    ratios = np.array(
        [abs(v.errors[name]) / v.stds[name] for kind in KINDS for v in answers(kind) for name in (*POSE, *GEOMETRY)
         if name in v.errors]
    )  # fmt: skip
    assert np.mean(ratios < 2.0) > 0.95
    assert np.mean(ratios < 3.0) > 0.97
