"""Are clouds' deviations true, and the same for any number of points? Clouds of sensors and of surveys.

python -m benchmarks.clouds --write

The frames are of every kind of `benchmarks.kinds` in turn, written as the clouds that their camera's software makes
with what it is told of the camera. An organised cloud keeps its pixels. An unorganised one is turned about the
optical axis and drawn at random, so that its rays are no camera's. A survey's cloud has true points with 3 mm of
noise, its origin in no sensor's place. "Ratio" is the deviation of the pose by 40,000 points over that by 100,000 of
the same cloud; with few points, by 1,500 over 3,000.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from benchmarks import trials
from benchmarks.coverage import HEAD, cells
from benchmarks.kinds import Case, mixed
from numpy.typing import NDArray

import siloscope
from siloscope import Estimate, SiloPose
from siloscope.simulation import PERFECT

ROLL = 0.3
"""Turn of an unorganised cloud about the optical axis, rad."""
SURVEY_NOISE = 0.003
"""Noise of a survey's points along each axis, m."""
STATION = np.array([0.3, -0.2, -0.4])
"""Origin of a survey's points in the camera's frame, m."""

Points = NDArray[np.float64]
Cloud = Callable[[Case, int], tuple[Points, SiloPose]]


@dataclass(frozen=True)
class Row:
    """A line of the table: how a cloud is made, of how many points, and what is told beside it."""

    name: str
    cloud: Cloud
    known: bool
    settings: tuple[tuple[str, Any], ...] = ()
    counts: tuple[int, ...] = (40_000, 100_000)
    """Points; an organised cloud has all of them."""

    def answer(self, case: Case, count: int) -> tuple[Case, Estimate]:
        """The case with its true pose in the cloud's frame, and the answer."""
        points, pose = self.cloud(case, count)
        sensor = case.profile if self.known else None
        estimate = siloscope.locate(points, sensor=sensor, **dict(self.settings))
        return replace(case, scene=replace(case.scene, pose=pose)), estimate


def organised(case: Case, _: int) -> tuple[Points, SiloPose]:
    """Points (H, W, 3) of a frame, with the rays that the camera is told to have."""
    frame = case.scene.render()
    depth = np.nan_to_num(np.asarray(frame.measured, np.float64))
    rays = (case.scene.told or case.scene.camera).rays()
    return np.dstack([rays * depth[..., None], depth]), case.scene.pose


def unorganised(case: Case, count: int) -> tuple[Points, SiloPose]:
    """So many of a frame's points, turned about the optical axis and in any order."""
    points, pose = organised(case, count)
    cos, sin = math.cos(ROLL), math.sin(ROLL)
    rolled = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    drawn = _drawn(points[points[..., 2] > 0.0], count, case.scene.seed)
    return drawn @ rolled.T, _moved(pose, rolled, np.zeros(3))


def survey(case: Case, count: int) -> tuple[Points, SiloPose]:
    """True points with noise, whose origin is no sensor's place."""
    depth = np.asarray(replace(case.scene, sensor=PERFECT).render().depth, np.float64)
    points = np.dstack([case.scene.camera.rays() * depth[..., None], depth])
    drawn = _drawn(points[np.isfinite(depth) & (depth > 0.0)], count, case.scene.seed) - STATION
    noise = np.random.default_rng((case.scene.seed, 3)).normal(0.0, SURVEY_NOISE, drawn.shape)
    return drawn + noise, _moved(case.scene.pose, np.eye(3), -STATION)


def _drawn(points: Points, count: int, seed: int) -> Points:
    """So many points, the first ones of one order."""
    order = np.random.default_rng((seed, 1)).permutation(len(points))
    return points[order[:count]]


def _moved(pose: SiloPose, turn: Points, by: Points) -> SiloPose:
    return SiloPose.from_axis(turn @ pose.axis_direction, turn @ pose.axis_point + by)


GRID, ALL = (("grid", 0.05),), (0,)
ROWS = (
    Row("organised, profile known", organised, True, counts=ALL),
    Row("organised, nothing known", organised, False, counts=ALL),
    Row("organised, --grid 0.05, profile known", organised, True, GRID, ALL),
    Row("unorganised, profile known", unorganised, True),
    Row("unorganised, nothing known", unorganised, False),
    Row("3,000 points, profile known", unorganised, True, counts=(1_500, 3_000)),
    Row("3,000 points, nothing known", unorganised, False, counts=(1_500, 3_000)),
    Row("survey, nothing known", survey, False),
)


def ratio(small: Estimate, large: Estimate) -> float:
    """Deviation of the pose by the smaller cloud over that by the larger; NaN where either is refused."""
    if small.covariance is None or large.covariance is None:
        return math.nan
    std = [np.sqrt(np.diag(estimate.covariance)) for estimate in (small, large) if estimate.covariance is not None]
    return float(np.exp(np.mean(np.log(std[0] / std[1]))))


def main() -> None:
    """Prints the table; with --write puts it into the manual."""
    options = trials.arguments(__doc__, frames=64, first=7008, row=-1)
    lines = []
    for row in ROWS if options.row < 0 else (ROWS[options.row],):
        cases = mixed(range(options.first, options.first + options.frames))
        both = [_answers(row, cases, count, options.jobs) for count in row.counts]
        ratios = [ratio(few[1], many[1]) for few, many in zip(both[0], both[-1], strict=True)]
        told = [value for value in ratios if not math.isnan(value)] if len(both) > 1 else []
        span = f"{np.median(told):.2f} ({min(told):.2f}–{max(told):.2f})" if told else "—"
        lines.append((row.name, *cells(both[-1]), span))
        if options.list:
            print("\n".join(_listed(both[-1])), flush=True)
    head = ("clouds, within 2 std, %", *HEAD, "ratio, median (least–most)")
    trials.publish("clouds", trials.table(head, lines), options.write and options.row < 0, "benchmarks.clouds")


def _answers(row: Row, cases: list[Case], count: int, jobs: int) -> list[tuple[Case, Estimate]]:
    return list(trials.each(cases, lambda case: row.answer(case, count), jobs, f"{row.name}, {count}"))


def _listed(answers: list[tuple[Case, Estimate]]) -> list[str]:
    return [
        f"  {case.kind} {case.scene.seed}: {estimate.reason or 'answered'}"
        + (" wrong and sure" if estimate.ok and trials.sure_and_wrong(estimate, case.scene) else "")
        for case, estimate in answers
    ]


if __name__ == "__main__":
    main()
