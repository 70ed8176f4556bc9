"""How far the measured volume is off on unseen silos, how true its deviation is, and how long `measure` takes.

    python -m benchmarks.content --write

Every silo is `siloscope.simulation.scenarios.random_scene` with the Astra S's error. It is calibrated from five frames
of an earlier discharge; then Gaussian, funnel, mound and tilted feed is measured at 75, 45 and 20 % level. Errors are
in % of the silo's capacity.
"""

from __future__ import annotations

import io
import statistics
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from benchmarks import trials
from benchmarks.trials import DIAMETER, KNOWN, Knowledge
from PIL import Image

import siloscope
from siloscope import sensors
from siloscope.sensors import SensorProfile
from siloscope.simulation import ASTRA_S, Feed, Scene, SimulatedFrame
from siloscope.simulation.scenarios import random_scene, scenario

SHAPES = ("gaussian", "funnel", "mound", "tilted")
LEVELS = (0.75, 0.45, 0.20)
EARLIER = (0.7, 0.5, 0.35, 0.2, 0.05)
"""Levels of the discharge that the silo is calibrated from."""
LUMPY = "profile known, lumpy feed"
GOALS = {KNOWN.name: (0.3, 1.5), DIAMETER.name: (0.6, 2.5)}
"""Median and worst error, % of the capacity."""
REPEAT = 15
"""Runs of which the median is the time."""


@dataclass(frozen=True)
class Reading:
    """One frame's volume beside its truth, in % of the capacity; NaN without a volume."""

    seed: int
    shape: str
    level: float
    error: float
    std: float
    why: str
    """Why there is no volume; empty where there is one."""


def main() -> None:
    """Prints the tables; with --write puts them into the manual."""
    options = trials.arguments(__doc__, silos=24, first=6000)
    seeds = range(options.first, options.first + options.silos)
    found: dict[str, list[Reading]] = {}
    for name, known, extra in ((KNOWN.name, KNOWN, ""), (DIAMETER.name, DIAMETER, ""), (LUMPY, KNOWN, "+lumpy")):
        work = partial(silo, known=known, extra=extra)
        each = trials.each(list(seeds), work, options.jobs, name)
        found[name] = [reading for readings in each for reading in readings]
    if options.list:
        print("\n".join(line(reading) for readings in found.values() for reading in readings))
    manual = trials.ROOT / "docs"
    page = manual / "content.md"
    text = "\n\n".join([accuracy(found), *(missing(name, readings) for name, readings in found.items())])
    trials.publish("accuracy", text, options.write, "benchmarks.content", page)
    trials.publish("levels", by_level(found[KNOWN.name]), options.write, "benchmarks.content", page)
    trials.publish("times", times(seeds), options.write, "benchmarks.content", page)
    trials.publish("practice", practice(), options.write, "benchmarks.content", manual / "measuring.md")


def silo(seed: int, known: Knowledge, extra: str) -> list[Reading]:
    """All readings of one silo; `extra` is what the feed has beside its shape."""
    scene = random_scene(seed, sensor=ASTRA_S)
    calibration = calibrated(scene, known)
    draw = np.random.default_rng(seed)
    pairs = [(shape + extra, level) for shape in SHAPES for level in LEVELS]
    return [reading(seed, content(scene, shape, level, draw), calibration) for shape, level in pairs]


def calibrated(scene: Scene, known: Knowledge) -> siloscope.Calibration:
    """What five frames of an earlier discharge tell."""
    earlier = [replace(scene, feed=Feed("gaussian", at), seed=scene.seed + 100 + i) for i, at in enumerate(EARLIER)]
    diameter = 2.0 * scene.silo.radius if known.diameter else None
    return siloscope.calibrate(
        [s.render().frame() for s in earlier], sensor=known.profile, diameter=diameter, bottom="cone"
    )


def content(scene: Scene, shape: str, level: float, draw: np.random.Generator) -> Scene:
    """The silo with feed whose angles are drawn."""
    angle, tilt, azimuth = draw.uniform(0.35, 0.6), draw.uniform(0.05, 0.4), draw.uniform(0.0, 6.28)
    feed = Feed(shape, level, angle=angle, tilt=tilt if "tilted" in shape else None, tilt_azimuth=azimuth)
    return replace(scene, feed=feed, seed=scene.seed + 1000 * int(100 * level))


def reading(seed: int, scene: Scene, calibration: siloscope.Calibration) -> Reading:
    """One frame measured."""
    feed = scene.feed
    assert feed is not None
    frame = scene.render()
    found = siloscope.measure(frame.frame(), calibration)
    if found.volume is None or found.volume_std is None:
        why = found.reason or f"{', '.join(found.missing)} never seen"
        return Reading(seed, feed.shape, feed.level, np.nan, np.nan, why)
    percent = 100.0 / scene.silo.capacity
    error = percent * (found.volume - frame.true_volume)
    return Reading(seed, feed.shape, feed.level, error, percent * found.volume_std, "")


def told(readings: Sequence[Reading]) -> tuple[np.ndarray, np.ndarray]:
    """Errors and deviations of the readings that have a volume."""
    pairs = np.array([(r.error, r.std) for r in readings if not r.why]).reshape(-1, 2)
    return pairs[:, 0], pairs[:, 1]


def accuracy(found: dict[str, list[Reading]]) -> str:
    """One line for each kind of knowledge."""
    head = ("", "readings", "with a volume", "median, %", "goal", "worst, %", "goal", "within 2 std", "goal")
    rows = []
    for name, readings in found.items():
        error, std = told(readings)
        median, worst = GOALS.get(name, ("–", "–"))
        within = f"{100 * np.mean(np.abs(error) <= 2 * std):.1f} %"
        figures = (f"{np.median(np.abs(error)):.4f}", median, f"{np.abs(error).max():.3f}", worst, within, "90–99 %")
        rows.append((name, len(readings), len(error), *figures))
    return trials.table(head, rows)


def missing(name: str, readings: Sequence[Reading]) -> str:
    """How many readings have no volume, and why."""
    causes = Counter(reading.why for reading in readings if reading.why)
    if not causes:
        return f"{name[0].upper()}{name[1:]}: every reading has a volume."
    listed = "; ".join(f"{count} × {why}" for why, count in causes.most_common())
    return f"{name[0].upper()}{name[1:]}, without a volume: {listed}."


def by_level(readings: Sequence[Reading]) -> str:
    """Error and stated deviation for shape and level."""
    head = ("median error (stated std), %", *(f"{100 * level:.0f} %" for level in LEVELS))
    rows = []
    for shape in SHAPES:
        cells = []
        for level in LEVELS:
            error, std = told([r for r in readings if r.shape == shape and r.level == level])
            cells.append(f"{np.median(np.abs(error)):.4f} ({np.median(std):.4f})" if len(error) else "none")
        rows.append((shape, *cells))
    return trials.table(head, rows)


UNBIASED = SensorProfile("unbiased", noise=sensors.load("orbbec-astra-s").noise)
"""The Astra S without its bias."""

PRACTICE: dict[str, Callable[[siloscope.Calibration, np.ndarray], tuple[siloscope.Calibration, np.ndarray]]] = {
    "all lengths and depths 1 % too long": lambda silo, depth: (moved(silo, scale=0.01), 1.01 * depth),
    "depths 5 mm too long, calibration right": lambda silo, depth: (silo, depth + 0.005 * (depth > 0.0)),
    "radius 5 mm too large": lambda silo, depth: (moved(silo, radius=0.005), depth),
    "cone's vertex 5 mm too low": lambda silo, depth: (moved(silo, apex=0.005), depth),
    "camera turned by 1 mrad": lambda silo, depth: (moved(silo, turn=0.001), depth),
    "camera shifted by 5 mm": lambda silo, depth: (moved(silo, shift=0.005), depth),
}
"""What may be wrong: a calibration and a depth image as they would then be."""


def moved(
    silo: siloscope.Calibration, scale: float = 0.0, radius: float = 0.0, apex: float = 0.0, **pose: float
) -> siloscope.Calibration:
    """The calibration with a wrong scale, radius, vertex, turn (rad) or shift (m)."""
    assert silo.parameters is not None
    values = silo.parameters.copy()
    values[2:5] *= 1.0 + scale
    values[[0, 2, 4]] += (pose.get("turn", 0.0), pose.get("shift", 0.0), radius)
    bottom, vertex = (1.0 + scale) * (silo.silo.cylinder_bottom or 0.0), (1.0 + scale) * (silo.silo.apex or 0.0) + apex
    values[5] = values[4] / (vertex - bottom)
    values[6] = values[5] * vertex
    geometry = siloscope.SiloGeometry(values[4], bottom, vertex)
    return replace(silo, parameters=values, silo=geometry, pose=siloscope.SiloPose(*values[:4]))


def practice() -> str:
    """What single errors do to a reading."""
    rows = []
    scenes = [replace(scenario(name), feed=Feed("gaussian", 0.45)) for name in ("silo1", "silo2", "silo3")]
    known = [
        calibrated(scene, Knowledge("exact", SensorProfile("exact", noise=(5e-4, 0, 0, 0, 0, 1)))) for scene in scenes
    ]
    for name, wrong in PRACTICE.items():
        row = [name]
        for scene, silo in zip(scenes, known, strict=True):
            frame = scene.render()
            calibration, depth = wrong(silo, frame.depth)
            right = siloscope.measure(frame.depth, silo, frame.camera).volume
            off = siloscope.measure(depth, calibration, frame.camera).volume
            row.append("refused" if right is None or off is None else f"{100 * (off / right - 1):+.2f} %")
        rows.append(row)
    return trials.table(("error", "Silo1", "Silo2", "Silo3"), rows)


def times(seeds: Sequence[int]) -> str:
    """Processor time of `measure` on a depth array beside a PNG decode, one thread."""
    ratios: list[float] = []
    for seed in list(seeds)[:6]:
        scene = random_scene(seed, sensor=ASTRA_S)
        calibration = calibrated(scene, KNOWN)
        draw = np.random.default_rng(seed)
        ratios += [ratio(content(scene, shape, 0.45, draw).render(), calibration) for shape in SHAPES]
    text = f"`measure` on a depth array takes {statistics.median(ratios):.2f} PNG decodes of processor time"
    return f"{text} (median of {len(ratios)} frames; slowest {max(ratios):.2f}; goal 2)."


def ratio(frame: SimulatedFrame, calibration: siloscope.Calibration) -> float:
    """Time of `measure` over that of Pillow decoding the frame's 16-bit PNG."""
    buffer = io.BytesIO()
    Image.fromarray(frame.raw(0.001)).save(buffer, "PNG")
    depth = frame.measured.astype(np.float32)
    decode = milliseconds(lambda: np.asarray(Image.open(io.BytesIO(buffer.getvalue()))))
    return milliseconds(lambda: siloscope.measure(depth, calibration, frame.camera)) / decode


def milliseconds(run: Callable[[], object]) -> float:
    """Median processor time of a call."""
    spent = []
    for _ in range(REPEAT):
        start = time.process_time()
        run()
        spent.append(1e3 * (time.process_time() - start))
    return statistics.median(spent)


def line(reading: Reading) -> str:
    """One reading as text."""
    head = f"{reading.seed} {reading.shape:9s} {reading.level:.2f}"
    return f"{head} {reading.why}" if reading.why else f"{head} error {reading.error:+.4f} std {reading.std:.4f}"


if __name__ == "__main__":
    main()
