"""What the paper leaves open in its six steps, tried out: how each choice changes the axis, and what tells walls apart.

    python -m benchmarks.choices [--unseen N] [--only TABLE] [--write]

With --write the tables go into docs/design/choices-shape-tensor.md. Each choice is changed alone, the others stay as
they are; nothing is refused, so that bad choices show. The table "real" needs the genuine recordings of the tests in
the folder that SILOSCOPE_REALDATA names.
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import statistics
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks import trials
from numpy.typing import NDArray

import siloscope
from siloscope import SiloPose
from siloscope.errors import InputError
from siloscope.estimation import steps
from siloscope.estimation.region import frame_points
from siloscope.simulation import ASTRA_S, PERFECT, Feed, Scene, SimulatedFrame
from siloscope.simulation.metrics import pc_average_distance
from siloscope.simulation.scenarios import random_scene, scenario

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "design" / "choices-shape-tensor.md"

CHOICES: dict[str, tuple[str, float, Sequence[float]]] = {
    "grid": ("voxel side, m", steps.GRID, (0.03, 0.04, 0.05, 0.07, 0.1)),
    "neighbours": ("neighbours k", steps.NEIGHBOURS, (12, 20, 30, 45, 70)),
    "share": ("share of the curved points", steps.SHARE, (0.1, 0.3, 0.5, 0.7, 0.9, 1.0)),
    "agreement": ("agreement, deviations", steps.AGREEMENT, (1.0, 1.5, 2.0, 3.0, np.inf)),
    "partners": ("partners s", steps.PARTNERS, (10, 30, 100, 300)),
}
"""Argument of `steps.run`: its name for people, the default, and what is tried."""

PLANES = (375, 750, 1500, 3000)

OTHERS = ("flat-wall", "room-corner", "square-shaft", "sphere", "brim-full", "noise")


@dataclass(frozen=True, eq=False)
class Seen:
    """A frame with its points."""

    frame: SimulatedFrame
    points: NDArray[np.float64]

    @classmethod
    def of(cls, scene: Scene) -> Seen:
        """Renders it."""
        frame = scene.render(threads=2)
        return cls(frame, frame_points(frame.frame()).reshape(-1, 3))

    def off(self, pose: SiloPose) -> float:
        """PC average distance, mm."""
        truth = self.frame.scene.pose
        return 1e3 * pc_average_distance(pose, truth, self.frame.depth, self.frame.camera, stride=trials.POINT_STRIDE)


def main() -> None:
    """Prints the tables, and with --write puts them into the page."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--unseen", type=int, default=8, help="unseen silos beside the paper's three")
    parser.add_argument("--write", action="store_true", help="write the tables into the page")
    parser.add_argument("--only", choices=("choices", "planes", "evidence", "real"), help="one table; else all")
    options = parser.parse_args()
    perfect, perturbed = ([Seen.of(s) for s in silos(sensor, options.unseen)] for sensor in (PERFECT, ASTRA_S))
    made = {
        "choices": lambda: choices(perfect, perturbed),
        "planes": lambda: planes(perfect[:3], perturbed[:3]),
        "evidence": lambda: evidence([*perfect, *perturbed, *feeds(options.unseen)]),
        "real": real,
    }
    for name in [options.only] if options.only else made:
        publish(name, made[name](), options.write)


def silos(sensor: Any, unseen: int) -> list[Scene]:
    """The paper's three and others."""
    paper = [replace(scenario(name), sensor=sensor) for name in ("silo1", "silo2", "silo3")]
    return paper + [random_scene(500 + seed, sensor=sensor) for seed in range(unseen)]


def feeds(unseen: int) -> Iterator[Seen]:
    """Silos with more feed in them, perturbed."""
    for shape in ("funnel", "tilted", "mound"):
        for seed in range(unseen):
            yield Seen.of(random_scene(600 + seed, Feed(shape, 0.4), sensor=ASTRA_S))


def choices(perfect: Sequence[Seen], perturbed: Sequence[Seen]) -> str:
    """Every choice changed alone."""
    head = ("choice", "value", "perfect, median mm", "worst", "perturbed, median mm", "worst", "no axis")
    rows = [
        row(
            name,
            value,
            [tried(seen, argument, value) for seen in (perfect, perturbed)],
            value == default,
        )
        for argument, (name, default, values) in CHOICES.items()
        for value in values
    ]
    return trials.table(head, rows)


def tried(frames: Iterable[Seen], argument: str, value: float) -> tuple[list[float], int]:
    """Distances in mm, and how many frames gave none."""
    setting: dict[str, Any] = {argument: value}
    poses = [(seen, pose_by_steps(seen, **setting)) for seen in frames]
    distances = [seen.off(pose) for seen, pose in poses if pose is not None]
    return distances, len(poses) - len(distances)


def pose_by_steps(seen: Seen, **setting: Any) -> SiloPose | None:
    """The steps' pose, if they can be finished."""
    try:
        return steps.run(seen.points, **setting).pose
    except InputError:
        return None


def row(name: str, value: float, results: Sequence[tuple[list[float], int]], default: bool) -> Any:
    """A line of the table; the default stands out."""
    numbers = [f"{pick(result[0]):.2f}" for result in results for pick in (statistics.median, max)]
    none = sum(result[1] for result in results)
    cells = (name, "all" if value == np.inf else f"{value:g}", *numbers, str(none))
    return tuple(f"**{cell}**" for cell in cells) if default else cells


def planes(perfect: Sequence[Seen], perturbed: Sequence[Seen]) -> str:
    """How many walls lend their planes in step 5, by the tests' oracle."""
    sys.path.insert(0, str(ROOT / "tests"))
    import reference

    kinds = ((frames, kind) for frames, kind in ((perfect, "perfect"), (perturbed, "perturbed")))
    head = ("planes", *(f"Silo{i}, {kind}" for frames, kind in kinds for i in range(1, len(frames) + 1)))
    found = [(seen, steps.run(seen.points)) for seen in (*perfect, *perturbed)]
    rows = []
    for count in PLANES:
        cells = []
        for seen, by_step in found:
            walls, X = by_step.walls, by_step.axis.X
            met = reference.axis_points(by_step.points[walls], by_step.normals[walls], X, planes=count)
            cells.append(f"{seen.off(SiloPose.from_axis(X, steps.axis_point(met, X))):.2f}")
        rows.append((count, *cells))
    return trials.table(head, rows)


def evidence(frames: Sequence[Seen]) -> str:
    """What is measured on silos, and on what is none, beside the limits in the core."""
    limits = core_limits()
    head = ("", "of points", "of candidates", "around", "along", "miss", "turn", "bend", "answer")
    least = (f"≥ {limits[name]}" for name in ("MIN_FRACTION", "MIN_KEPT_FRACTION", "MIN_AROUND"))
    most = (f"≤ {limits[name]}" for name in ("MAX_ALONG", "MISS", "TURN", "MAX_BEND"))
    rows: list[tuple[str, ...]] = [("limit", *least, *most, "")]
    answered = [seen for seen in frames if answer(seen) == "ok"]
    measured = np.array([measures(seen) for seen in answered])
    for name, percent in (("lowest", 0), ("median", 50), ("highest", 100)):
        values = np.percentile(measured, percent, axis=0)
        rows.append((f"silos, {name}", *written(values), f"{len(answered)} of {len(frames)} answered"))
    refused = [(kind(seen), seen) for seen in frames if seen not in answered]
    shams = [
        (name, Seen.of(replace(scenario(name), sensor=sensor))) for name in OTHERS for sensor in (PERFECT, ASTRA_S)
    ]
    named = [(f"{name}, perturbed" if seen.frame.scene.sensor == ASTRA_S else name, seen) for name, seen in shams]
    rows += [(name, *written(measures(seen)), answer(seen)) for name, seen in (*refused, *named)]
    return trials.table(head, rows)


def kind(seen: Seen) -> str:
    """What is in a silo."""
    scene = seen.frame.scene
    feed = "empty" if scene.feed is None else f"{scene.feed.shape} feed at {100 * scene.feed.level:.0f} %"
    return f"silo {scene.silo.height:.1f} m deep, {feed}"


def answer(seen: Seen) -> str:
    """What `locate` says of it."""
    estimate = siloscope.locate(seen.frame.frame(), method="shape-tensor")
    return estimate.reason or estimate.status


def written(values: Iterable[float]) -> list[str]:
    """Cells; a dash for what there is not."""
    return ["–" if np.isnan(value) else f"{value:.3f}" for value in values]


def measures(seen: Seen) -> list[float]:
    """The measures of the core's `Evidence`, from the intermediates."""
    try:
        found = steps.run(seen.points)
    except InputError:
        return [float("nan")] * 7
    walls, turn = found.walls, found.pose.T_silo_camera[:3, :3]
    p, N, E1 = found.pose.to_silo(found.points[walls]), found.normals[walls] @ turn.T, found.candidates.E1
    E = E1[found.axis.agreeing]
    spread = np.linalg.eigvalsh(E.T @ E / len(E))
    rho, across = np.hypot(p[:, 0], p[:, 1]), np.hypot(N[:, 0], N[:, 1])
    outwards = (N[:, 0] * p[:, 0] + N[:, 1] * p[:, 1]) / rho
    miss = np.abs(p[:, 0] * N[:, 1] - p[:, 1] * N[:, 0]) / (rho * across)
    k1, k2 = found.tensors.k1[walls], found.tensors.k2[walls]
    bent, straight = (np.where((np.abs(k1) >= np.abs(k2)) == first, k1, k2) for first in (True, False))
    bend, sharp = straight * rho, bent * rho / np.cos(np.arctan(N[:, 2] / outwards))
    shares = [len(walls) / len(found.points), len(walls) / len(found.candidates.index)]
    return [*shares, spread[1] / spread[2], spread[0] / spread[1], *(float(np.median(x)) for x in (miss, sharp, bend))]


def real() -> str:
    """Genuine recordings by grid and k: degrees from the known axis, or why there is no answer."""
    recordings = {
        "mug, outside, 39 mm radius": (mug(), MUG_AXIS, (0.002, 0.003, 0.005)),
        "pot, inside, 84 mm radius": (pot(), POT_AXIS, (0.004, 0.005, 0.006)),
        "tank, outside, 7.6 m radius": (tank(), (0.0, 0.0, 1.0), (0.05, 0.2, 0.5)),
    }
    counts = (30, 60, 120)
    rows = [
        (name, f"{1e3 * grid:g}", *(tilt(points, axis, grid, k) for k in counts))
        for name, (points, axis, grids) in recordings.items()
        for grid in grids
    ]
    return trials.table(("recording", "grid, mm", *(f"k = {k}" for k in counts)), rows)


def tilt(points: NDArray[np.float64], axis: Sequence[float], grid: float, k: int) -> str:
    """Degrees between the located and the known axis."""
    estimate = siloscope.locate(points, method="shape-tensor", grid=grid, neighbours=k)
    if estimate.pose is None:
        return str(estimate.reason)
    across = np.linalg.norm(np.cross(estimate.pose.axis_direction, axis)) / np.linalg.norm(axis)
    return f"{np.degrees(np.arcsin(across)):.2f}°"


MUG_AXIS, MUG_PLACE = (-0.0135876, 0.834831, 0.550338), (0.054, 0.100, 0.788)
TABLE, TABLE_OFFSET = (0.0161902, -0.837667, -0.545941), 0.528862
"""What PCL publishes for its mug and the table below it."""

POT_AXIS, INNER_WALL = (0.0014, -0.8243, -0.5661), 43
"""Normal of the pot's table, and the label of the pot's inner wall."""


def mug() -> NDArray[np.float64]:
    """What stands on the table within 15 cm."""
    points = recording("pcl_mug_cylinder", "table_scene_mug_stereo_textured.pcd").points.reshape(-1, 3).astype(float)
    above = points @ np.array(TABLE) + TABLE_OFFSET
    near = np.linalg.norm(points - np.array(MUG_PLACE), axis=1) < 0.15
    mug: NDArray[np.float64] = points[near & (above > 0.005) & (above < 0.13)]
    return mug


def pot() -> NDArray[np.float64]:
    """Its inner wall."""
    frame = recording("mosd_kinect_cylindric", "learn36.pcd")
    inside: NDArray[np.float64] = frame.points[frame.labels == INNER_WALL].astype(float)
    return inside


def tank() -> NDArray[np.float64]:
    """The whole survey."""
    points: NDArray[np.float64] = recording("tank_total_station", "scan.csv").points.reshape(-1, 3).astype(float)
    return points


def recording(*parts: str) -> Any:
    """The only frame of a file."""
    with siloscope.open(Path(os.environ["SILOSCOPE_REALDATA"]).joinpath(*parts)) as frames:
        return frames[0]


def core_limits() -> dict[str, str]:
    """The limits as the core states them."""
    text = (ROOT / "crates" / "siloscope" / "src" / "shape_tensor" / "diagnostics.rs").read_text()
    return {
        name: value.replace("..", " to ") for name, value in re.findall(r"^const (\w+): [^=]+ = (.+);$", text, re.M)
    }


def publish(name: str, text: str, write: bool) -> None:
    """Prints a table, and puts it between its marks in the page with the command that made it."""
    print(text)
    if write:
        command = shlex.join(["python", "-m", "benchmarks.choices", *sys.argv[1:]])
        before, rest = PAGE.read_text().split(f"<!-- {name} -->")
        after = rest.split(f"<!-- end of {name} -->")[1]
        made = f"<!-- {name} -->\n{text}\n\nMade by `{command}`.\n<!-- end of {name} -->"
        PAGE.write_text(before + made + after)


if __name__ == "__main__":
    main()
