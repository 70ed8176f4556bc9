"""Is a volume ever sure and wrong? Vessels with other bottoms than a coaxial cone, by feeds and levels.

    python -m benchmarks.vessels --seeds 0:5 --bottoms flat_empty,oblique,two_stage,pyramid

Vessels, feeds and exact volumes are the tests' independent oracle. Known is

- alone: one frame with its camera and profile;
- nothing: the calibration of an earlier discharge, which was told nothing of the bottom;
- told: pose and radius with a deviation of 0.5 mm and mrad, and the vessel file of the maker's lengths;
- tare: the same with one frame of the empty vessel in place of the file;
- learned: the same with a discharge, a refill and a discharge in place of the file.

With `--fused`, told and tare rest on the calibration of the earlier discharge as well. With `--drawn`, walls are out of
round and in courses, and cameras are off what is told of them, as they are drawn from their priors; the vessel file
then has the mean radius. "wrong" is a stated volume off by more than 4 stated deviations and 1 % of the capacity.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from multiprocessing import get_context
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import siloscope
import vessels
from oracle import volumes
from oracle.feed import Feed, Tip
from oracle.sensors import ASTRA_S, D455
from test_content_floors import vessel_file

FEEDS = ("level", "tilted", "pile", "crater 35", "crater 48", "aside")
LEVELS = (0.15, 0.4, 0.65, 0.85)
"""Fractions of the height between the floor's lowest point and half a metre below the camera."""

CLEAR = 0.45
"""Least distance of feed from the camera, m."""

EARLIER = (0.75, 0.6, 0.45, 0.3, 0.15, 0.05)
"""Levels of the earlier discharge that is calibrated from."""

REFILLED = (0.03, 0.0, 0.7, 0.35, 0.03, 0.0)
"""Levels of the sequence that the floor is learned from."""

SENSORS = {"astra-s": ASTRA_S, "d455": D455}

KNOWN = ("alone", "nothing", "told", "tare", "learned")

FINENESS = 60
"""Of the quadrature of true volumes, which is then right to 0.01 % of the capacity."""


@dataclass(frozen=True)
class Case:
    """What is asked of a vessel."""

    bottom: str
    seed: int
    known: tuple[str, ...]
    width: int
    sensor: str
    fused: bool
    drawn: bool
    every: int


@dataclass(frozen=True)
class Answer:
    """One reading beside its truth; errors in % of the capacity."""

    known: str
    bottom: str
    seed: int
    feed: str
    reason: str | None
    coverage: float | None
    volume: float | None
    volume_std: float
    ullage: float | None
    ullage_std: float


@dataclass(frozen=True)
class Truth:
    """True volumes of a frame, m³."""

    capacity: float
    ullage: float


def main() -> None:
    """Prints a table for each kind of knowledge."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", default="0:3", help="first and last vessel, FIRST:END")
    parser.add_argument("--bottoms", default="flat_empty,oblique,two_stage,pyramid")
    parser.add_argument("--known", default="nothing,told,tare", help=f"of {', '.join(KNOWN)}")
    parser.add_argument("--width", type=int, default=320, help="pixels")
    parser.add_argument("--sensor", choices=SENSORS, default="astra-s")
    parser.add_argument("--fused", action="store_true", help="told and tare rest on a fused calibration")
    parser.add_argument("--drawn", action="store_true", help="draw walls and cameras from their priors")
    parser.add_argument("--every", type=int, default=1, help="take one feed of so many")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--worst", type=int, default=0, help="list so many of the worst readings")
    chosen = parser.parse_args()
    first, end = (int(part) for part in chosen.seeds.split(":"))
    settings = (tuple(chosen.known.split(",")), chosen.width, chosen.sensor, chosen.fused, chosen.drawn, chosen.every)
    cases = [Case(bottom, seed, *settings) for bottom in chosen.bottoms.split(",") for seed in range(first, end)]
    if chosen.workers == 1:
        found = list(map(answers, cases))
    else:
        with ProcessPoolExecutor(chosen.workers, get_context("spawn")) as pool:
            found = list(pool.map(answers, cases))
    _print([*chain.from_iterable(found)], chosen.worst)


def _print(found: list[Answer], worst: int) -> None:
    groups: dict[tuple[str, str], list[Answer]] = defaultdict(list)
    for answer in found:
        groups[answer.known, answer.bottom].append(answer)
    print("known | bottom | readings | volumes | median % | worst % | wrong | within 2 | ullages | median % | "
          "worst % | wrong | within 2 | empty read as empty")  # fmt: skip
    for (known, bottom), group in groups.items():
        print(" | ".join(row(known, bottom, group)))
        reasons = Counter(answer.reason for answer in group if answer.reason)
        if reasons:
            print(f"    without an answer: {', '.join(f'{n} × {reason}' for reason, n in reasons.most_common())}")
    for answer in sorted(found, key=lambda a: -abs(a.volume or a.ullage or 0.0))[:worst]:
        print(answer)


def answers(case: Case) -> list[Answer]:
    """All readings of one vessel."""
    try:
        empty = drawn(case)
    except RuntimeError:
        return []
    earlier = calibrated(empty) if case.fused or "nothing" in case.known else None
    silo = earlier if case.fused and earlier is not None else empty.calibration()
    tared = _tared(silo, empty) if "tare" in case.known and silo.ok else silo
    refilled = siloscope.learn_floor(silo, _refilled(empty)) if "learned" in case.known and silo.ok else silo
    capacity = volumes.ullage(empty.vessel, None, FINENESS)
    found = []
    with tempfile.TemporaryDirectory() as folder:
        file = vessel_file(empty, Path(folder) / "vessel.toml")
        for name, seen in _every(case, empty):
            readings = {
                "alone": partial(siloscope.measure, seen.frame, sensor=seen.profile, top=seen.top),
                "nothing": partial(siloscope.measure, seen.frame, earlier, top=seen.top),
                "told": partial(siloscope.measure, seen.frame, silo, vessel=file),
                "tare": partial(siloscope.measure, seen.frame, tared, top=seen.top),
                "learned": partial(siloscope.measure, seen.frame, refilled, top=seen.top),
            }
            truth = Truth(capacity, volumes.ullage(seen.vessel, seen.scene.feed, FINENESS))
            for known in case.known:
                used = {"alone": None, "nothing": earlier, "told": silo, "tare": tared, "learned": refilled}[known]
                if used is not None and not used.ok:
                    reason = f"calibration: {used.reason}"
                    found.append(Answer(known, case.bottom, case.seed, name, reason, None, None, 0.0, None, 0.0))
                else:
                    found.append(judged(known, case, name, truth, readings[known]()))
    return found


def _every(case: Case, empty: vessels.Seen) -> Iterator[tuple[str, vessels.Seen]]:
    yield "empty", empty.again(2)
    for number, (name, seen) in enumerate(feeds(empty, case.seed)):
        if number % case.every == case.seed % case.every:
            yield name, seen


def drawn(case: Case) -> vessels.Seen:
    """The empty vessel of a case."""
    sensor = SENSORS[case.sensor]
    if not case.drawn:
        seen = vessels.Seen.draw(case.bottom, case.seed, case.width)
        return vessels.Seen(replace(seen.scene, sensor=sensor)).with_feed(None)
    return vessels.Seen.draw_all(case.bottom, case.seed, case.width, sensor).with_feed(None)


def calibrated(empty: vessels.Seen) -> siloscope.Calibration:
    """The calibration of an earlier discharge."""
    vessel, draw = empty.vessel, np.random.default_rng((empty.scene.device, 81))
    low, radius = vessel.bottom.lowest, vessel.wall.radius
    frames = []
    for number, level in enumerate(EARLIER):
        z = low - level * (low - 0.9)
        made = replace(feed(FEEDS[(0, 1, 3)[number % 3]], z, radius, draw), waves=_waves(draw))
        if float(made.air(*empty.scene.pose.origin[:, None])[0]) > CLEAR:
            frames.append(empty.with_feed(made).again(number + 300).frame)
    return siloscope.calibrate(frames, sensor=empty.profile)


def _tared(silo: siloscope.Calibration, empty: vessels.Seen) -> siloscope.Calibration:
    """With one frame of the empty vessel; as it was where that shows too little of the floor."""
    try:
        return siloscope.tare(silo, [empty.again(1).frame])
    except siloscope.InputError:
        return silo


def _refilled(empty: vessels.Seen) -> list[siloscope.Frame]:
    low, draw = empty.vessel.bottom.lowest, np.random.default_rng((empty.scene.device, 82))
    made = [Feed(low - level * (low - 0.9), waves=_waves(draw)) if level else None for level in REFILLED]
    return [empty.with_feed(feed).again(number + 400).frame for number, feed in enumerate(made)]


def feeds(empty: vessels.Seen, seed: int) -> Iterator[tuple[str, vessels.Seen]]:
    """The vessel with every feed at every level that leaves the camera free, by name."""
    vessel, draw = empty.vessel, np.random.default_rng((seed, 18))
    radius, low = vessel.wall.radius, vessel.bottom.lowest
    for shape in FEEDS:
        for level in LEVELS:
            z = low - level * (low - 0.9)
            made = replace(feed(shape, z, radius, draw), waves=_waves(draw))
            if float(made.air(*empty.scene.pose.origin[:, None])[0]) > CLEAR:
                yield f"{shape} {level}", empty.with_feed(made).again(int(100 * level))


def feed(shape: str, z: float, radius: float, draw: np.random.Generator) -> Feed:
    """A surface about a height z."""
    azimuth = float(draw.uniform(0.0, 2.0 * math.pi))
    c, s = math.cos(azimuth), math.sin(azimuth)
    if shape == "level":
        return Feed(z)
    if shape == "tilted":
        return Feed(z, (0.2 * c, 0.2 * s))
    if shape == "pile":
        return Feed(z, tip=Tip(0.2 * radius * c, 0.2 * radius * s, z - 0.2 * radius, math.tan(0.45)))
    slope = math.tan(math.radians(48.0 if shape == "crater 48" else 35.0))
    aside = 0.35 if shape == "aside" else 0.0
    return Feed(z, tip=Tip(aside * radius * c, aside * radius * s, z + 0.5 * slope * radius, -slope, shape == "aside"))


def _waves(draw: np.random.Generator) -> tuple[tuple[float, float, float, float], ...]:
    (ax, ay), (bx, by) = draw.uniform(2.0, 8.0, (2, 2)).tolist()
    first, second = draw.uniform(0.0, 6.28, 2).tolist()
    return (0.006, ax, ay, first), (0.006, bx, by, second)


def judged(known: str, case: Case, feed: str, true: Truth, content: siloscope.Content) -> Answer:
    """A reading beside its truth."""
    percent = 100.0 / true.capacity

    def off(value: float | None, std: float | None, truth: float) -> tuple[float | None, float]:
        return (None, 0.0) if value is None or std is None else (percent * (value - truth), percent * std)

    volume, ullage = (
        off(content.volume, content.volume_std, true.capacity - true.ullage),
        off(content.ullage, content.ullage_std, true.ullage),
    )
    return Answer(known, case.bottom, case.seed, feed, content.reason, content.coverage, *volume, *ullage)


def row(known: str, bottom: str, group: list[Answer]) -> tuple[str, ...]:
    """Figures of a population."""
    volumes = [(a.volume, a.volume_std) for a in group if a.volume is not None]
    ullages = [(a.ullage, a.ullage_std) for a in group if a.ullage is not None]
    empty = [a for a in group if a.feed == "empty"]
    read = sum(a.volume is not None and abs(a.volume) <= 3.0 * a.volume_std for a in empty)
    return (known, bottom, str(len(group)), *_figures(volumes), *_figures(ullages), f"{read}/{len(empty)}")


def _figures(pairs: list[tuple[float, float]]) -> tuple[str, ...]:
    if not pairs:
        return ("0", "–", "–", "0", "–")
    error, std = np.abs(np.array(pairs)).T
    wrong = int(((error > 4.0 * std) & (error > 1.0)).sum())
    within = f"{100 * np.mean(error <= 2.0 * std):.0f} %"
    return str(len(pairs)), f"{np.median(error):.3f}", f"{error.max():.2f}", str(wrong), within


if __name__ == "__main__":
    main()
