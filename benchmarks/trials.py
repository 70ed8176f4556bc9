"""What the accuracy benchmarks share: frames of many silos, how they are located, and tables for the manual."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

import siloscope
from siloscope import Calibration, Estimate
from siloscope.sensors import SensorProfile
from siloscope.simulation import ASTRA_S, PERFECT, Feed, Scene, SimulatedFrame, metrics
from siloscope.simulation.scenarios import random_big_scene, random_scene, scenario

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from oracle import judging

ROOT = Path(__file__).parents[1]
ACCURACY_PAGE = ROOT / "docs" / "accuracy.md"

LIDAR_PROFILE = SensorProfile("lidar-like", noise=(0.0, 0.01, 0.0, 0.0, 0.0, 2.0))
"""The profile of `siloscope.simulation.scenarios.LIDAR_NOISE`."""

POINT_STRIDE = 101
"""Every so many points of the adjusted cloud are asked for their PC average distance."""

T = TypeVar("T")
R = TypeVar("R")


@dataclass(frozen=True)
class Knowledge:
    """What the caller of `locate` knows about sensor and silo."""

    name: str
    profile: str | SensorProfile | None
    diameter: bool = False
    exact: bool = False
    """Whether the intrinsics are told to be exact."""

    def locate(self, frame: SimulatedFrame) -> Estimate:
        """The answer for a simulated frame."""
        return siloscope.locate(frame.frame(), **self._of(frame.scene))

    def calibrate(self, scenes: Sequence[Scene]) -> Calibration:
        """The calibration from simulated frames of one camera in one silo, one frame of each scene."""
        return siloscope.calibrate((scene.render().frame() for scene in scenes), **self._of(scenes[0]))

    def of(self, profile: str) -> Knowledge:
        """The same about another sensor; nothing where the sensor is not known."""
        return replace(self, profile=profile if self.profile else None)

    def _of(self, scene: Scene) -> dict[str, Any]:
        diameter = 2.0 * scene.silo.radius if self.diameter else None
        return {"sensor": self.profile, "diameter": diameter, "intrinsics": "exact" if self.exact else None}


KNOWN = Knowledge("profile known", "orbbec-astra-s")
DIAMETER = Knowledge("profile unknown, diameter known", None, diameter=True)
NOTHING = Knowledge("nothing known", None)


def silos(seeds: Iterable[int], feed: Feed, *, perturbed: bool = True) -> list[tuple[str, Scene]]:
    """The paper's three silos and unseen ones, with their names."""
    sensor = ASTRA_S if perturbed else PERFECT
    paper = [(n, replace(scenario(n), feed=feed, sensor=sensor, seed=1)) for n in ("silo1", "silo2", "silo3")]
    return paper + [(f"unseen {seed}", random_scene(seed, feed, sensor=sensor)) for seed in seeds]


def big_silos(seeds: Iterable[int], feed: Feed) -> list[tuple[str, Scene]]:
    """Silos of industrial size with the LiDAR-like sensor."""
    named = [(n, replace(scenario(n), feed=feed, seed=1)) for n in ("big-6m", "big-9m", "big-12m")]
    return named + [(f"unseen {seed}", random_big_scene(seed, feed)) for seed in seeds]


def distance(frame: SimulatedFrame, estimate: Estimate) -> float:
    """PC average distance (Eq. 11) over the exact cloud, mm; NaN where refused."""
    if estimate.pose is None:
        return float("nan")
    truth = frame.scene.pose
    return 1e3 * metrics.pc_average_distance(estimate.pose, truth, frame.depth, frame.camera, stride=POINT_STRIDE)


def each(items: Sequence[T], work: Callable[[T], R], jobs: int, label: str) -> Iterator[R]:
    """Work on each item in order, with a count on stderr."""
    with ThreadPoolExecutor(jobs) as pool:
        for number, result in enumerate(pool.map(work, items), 1):
            if sys.stderr.isatty() or number == len(items):
                print(f"\r{label}: {number}/{len(items)}", end="", file=sys.stderr)
            yield result
    print(file=sys.stderr)


def arguments(description: str | None, **options: int) -> argparse.Namespace:
    """The options that all benchmarks have, and whole numbers of their own."""
    parser = argparse.ArgumentParser(description=(description or "").splitlines()[0])
    parser.add_argument("--jobs", type=int, default=1, help="frames at the same time")
    parser.add_argument("--write", action="store_true", help="write the tables into the manual")
    parser.add_argument("--list", action="store_true", help="list every frame")
    for name, default in options.items():
        parser.add_argument(f"--{name}", type=int, default=default)
    return parser.parse_args()


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A Markdown table, its first column on the left."""
    lines = [head, ["---"] + ["--:"] * (len(head) - 1), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)


def publish(name: str, text: str, write: bool, module: str, page: Path = ACCURACY_PAGE) -> None:
    """Prints a section, and puts it between its marks in a page of the manual with the command that made it."""
    print(text)
    if not write:
        return
    command = shlex.join(["python", "-m", module, *sys.argv[1:]])
    whole = page.read_text()
    start, end = f"<!-- {name} -->", f"<!-- end of {name} -->"
    before, after = whole.split(start)[0], whole.split(end)[1]
    page.write_text(f"{before}{start}\n{text}\n\nMade by `{command}`.\n{end}{after}")


def again(scene: Scene, number: int) -> Scene:
    """The scene with other noise."""
    return replace(scene, seed=(scene.seed * 1_000_003 + number) % 2**64)


def sure_and_wrong(answer: Estimate | Calibration, scene: Scene) -> bool:
    """Whether a given pose is off by more than 4 stated deviations, and by more than 10 mm or 5 mrad."""
    stated = answer.to_dict()
    return any(judging.sure_and_wrong(k, stated[k] - getattr(scene.pose, k), stated["std"][k]) for k in judging.POSE)


def pose_error(estimate: Estimate, scene: Scene) -> np.ndarray:
    """Error of (r_x, r_y, t_x, t_y)."""
    assert estimate.pose is not None
    names = ("r_x", "r_y", "t_x", "t_y")
    return np.array([getattr(estimate.pose, name) - getattr(scene.pose, name) for name in names])
