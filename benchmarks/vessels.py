"""Is a volume ever sure and wrong? Vessels with other bottoms than a coaxial cone, by feeds and levels.

    python -m benchmarks.vessels --seeds 0:5 --bottoms flat_empty,oblique,two_stage,pyramid

Vessels, feeds and exact volumes are the tests' independent oracle. Known is

- nothing: one frame with its camera and profile; the program finds the wall and has to tell what is under the feed;
- told: pose and radius with a deviation of 0.5 mm and mrad, and the vessel file of the maker's lengths;
- tare: the same with one frame of the empty vessel in place of the file.

"wrong" is a stated volume off by more than 4 stated deviations and 1 % of the capacity.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import siloscope
import vessels
from oracle.feed import Feed, Tip
from test_content_floors import vessel_file

FEEDS = ("level", "tilted", "pile", "crater 35", "crater 48", "aside")
LEVELS = (0.15, 0.4, 0.65, 0.85)
"""Fractions of the height between the floor's lowest point and half a metre below the camera."""

CLEAR = 0.45
"""Least distance of feed from the camera, m."""


@dataclass(frozen=True)
class Answer:
    """One reading beside its truth; errors in % of the capacity."""

    known: str
    bottom: str
    volume: float | None
    deviations: float
    ullage: float | None
    ullage_deviations: float
    empty: bool


def main() -> None:
    """Prints a table for each kind of knowledge."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", default="0:3", help="first and last vessel, FIRST:END")
    parser.add_argument("--bottoms", default="flat_empty,oblique,two_stage,pyramid")
    parser.add_argument("--known", default="nothing,told,tare")
    parser.add_argument("--width", type=int, default=320)
    chosen = parser.parse_args()
    first, end = (int(part) for part in chosen.seeds.split(":"))
    found: dict[tuple[str, str], list[Answer]] = defaultdict(list)
    for bottom in chosen.bottoms.split(","):
        for seed in range(first, end):
            for answer in answers(bottom, seed, chosen.width, chosen.known.split(",")):
                found[answer.known, bottom].append(answer)
    print("known | bottom | readings | volumes | wrong | median % | worst % | within 2 | ullages | median % | "
          "worst % | wrong | within 2 | empty read as empty")  # fmt: skip
    for (known, bottom), group in found.items():
        print(" | ".join(row(known, bottom, group)))


def answers(bottom: str, seed: int, width: int, known: list[str]) -> Iterator[Answer]:
    """All readings of one vessel."""
    try:
        empty = vessels.Seen.draw(bottom, seed, width).with_feed(None)
    except RuntimeError:
        return
    silo = empty.calibration()
    tared = siloscope.tare(silo, [empty.again(1).frame]) if "tare" in known else silo
    with tempfile.TemporaryDirectory() as folder:
        file = vessel_file(empty, Path(folder) / "vessel.toml")
        for seen in (empty.again(2), *feeds(empty, seed)):
            readings = {
                "nothing": partial(siloscope.measure, seen.frame, sensor="orbbec-astra-s", top=seen.top),
                "told": partial(siloscope.measure, seen.frame, silo, vessel=file),
                "tare": partial(siloscope.measure, seen.frame, tared, top=seen.top),
            }
            for name in known:
                yield judged(name, bottom, seen, readings[name]())


def feeds(empty: vessels.Seen, seed: int) -> Iterator[vessels.Seen]:
    """The vessel with every feed at every level that leaves the camera free."""
    vessel, draw = empty.vessel, np.random.default_rng((seed, 18))
    radius, low = vessel.wall.radius, vessel.bottom.lowest
    for shape in FEEDS:
        for level in LEVELS:
            z = low - level * (low - 0.9)
            made = replace(feed(shape, z, radius, draw), waves=_waves(draw))
            if float(made.air(*empty.scene.pose.origin[:, None])[0]) > CLEAR:
                yield empty.with_feed(made).again(int(100 * level))


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


def judged(known: str, bottom: str, seen: vessels.Seen, content: siloscope.Content) -> Answer:
    """A reading beside its truth."""
    percent = 100.0 / seen.capacity

    def off(value: float | None, std: float | None, truth: float) -> tuple[float | None, float]:
        if value is None or std is None:
            return None, math.nan
        return percent * (value - truth), (value - truth) / max(std, 1e-12)

    volume = off(content.volume, content.volume_std, seen.content)
    return Answer(known, bottom, *volume, *off(content.ullage, content.ullage_std, seen.ullage), not seen.scene.feed)


def row(known: str, bottom: str, group: list[Answer]) -> tuple[str, ...]:
    """Figures of a population."""
    volumes = [(a.volume, a.deviations) for a in group if a.volume is not None]
    ullages = [(a.ullage, a.ullage_deviations) for a in group if a.ullage is not None]
    empty = [a for a in group if a.empty]
    read = sum(a.volume is not None and abs(a.deviations) <= 3.0 for a in empty)
    return (known, bottom, str(len(group)), *_figures(volumes, True), *_figures(ullages, False), f"{read}/{len(empty)}")


def _figures(pairs: list[tuple[float, float]], wrong_first: bool) -> tuple[str, ...]:
    if not pairs:
        return ("0", "0", "–", "–", "–")
    error, z = np.array(pairs).T
    wrong = str(int(((np.abs(z) > 4.0) & (np.abs(error) > 1.0)).sum()))
    middle = (f"{np.median(np.abs(error)):.3f}", f"{np.abs(error).max():.2f}")
    within = f"{100 * np.mean(np.abs(z) <= 2.0):.0f} %"
    return (str(len(pairs)), wrong, *middle, within) if wrong_first else (str(len(pairs)), *middle, wrong, within)


if __name__ == "__main__":
    main()
