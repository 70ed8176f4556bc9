"""A discharge as arrays over its steps, and what is read off them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from siloscope.reproduction.discharges import Discharge
from siloscope.reproduction.evaluation.published import Adjustment
from siloscope.reproduction.running import Results
from siloscope.reproduction.trials import STRIDE, Answer, Observation
from siloscope.simulation import metrics
from siloscope.types.pose import SiloPose

Numbers = NDArray[np.float64]
LAST = 10
"""Estimates that the paper averages."""


@dataclass(frozen=True)
class Series:
    """A discharge and its observations, in order."""

    discharge: Discharge
    observations: tuple[Observation, ...]

    @classmethod
    def of(cls, discharge: Discharge, results: Results, steps: int | None) -> Series:
        """The finished trials of a discharge."""
        trials = discharge.trials(steps)
        return cls(discharge, tuple(Observation.of(trial, results[trial]) for trial in trials))

    @property
    def name(self) -> str:
        """The silo's name."""
        return self.discharge.name

    @property
    def truth(self) -> SiloPose:
        """The true pose."""
        return self.discharge.scene.pose

    @cached_property
    def level(self) -> Numbers:
        """Feed level of each step, (N,)."""
        return np.array([seen.level for seen in self.observations])

    @cached_property
    def pixels(self) -> Numbers:
        """Shares of cylinder, cone and feed by pixels, (N, 3)."""
        return np.array([list(seen.pixels.to_dict().values()) for seen in self.observations])

    @cached_property
    def area(self) -> Numbers:
        """The same by area, (N, 3)."""
        return np.array([list(seen.area.to_dict().values()) for seen in self.observations])

    def answers(self, solver: str) -> list[Answer]:
        """What a method said at each step."""
        return [seen.answers[solver] for seen in self.observations]

    def answered(self, solver: str) -> list[Answer]:
        """Those that are no refusals."""
        return [answer for answer in self.answers(solver) if answer.pose is not None]

    def error(self, solver: str) -> Numbers:
        """Errors of r_x, r_y, t_x, t_y at each step, (N, 4), NaN where refused."""
        return np.array([_error(answer.pose, self.truth) for answer in self.answers(solver)])

    def std(self, solver: str) -> Numbers:
        """Stated standard deviations, (N, 4), NaN where there are none."""
        return np.array([_std(answer.covariance) for answer in self.answers(solver)])

    def distance(self, solver: str) -> Numbers:
        """PC average distance at each step, m, (N,), NaN where refused."""
        return np.array(
            [np.nan if answer.distance is None else answer.distance for answer in self.answers(solver)]
        )  # fmt: skip

    def last(self, solver: str) -> SiloPose | None:
        """The last estimate (Table 3)."""
        answered = self.answered(solver)
        return answered[-1].pose if answered else None

    def mean_of_last(self, solver: str, count: int = LAST) -> SiloPose | None:
        """Mean of the last estimates (Tables 4 and 5)."""
        poses = [answer.pose for answer in self.answered(solver)[-count:] if answer.pose is not None]
        return _mean(poses) if poses else None

    def adjustments(self, poses: Sequence[SiloPose | None]) -> list[Adjustment | None]:
        """Errors of poses and their distance on the last frame, in the paper's units."""
        frame = self.observations[-1].scene.render()
        found = [pose for pose in poses if pose is not None]
        distances = metrics.pc_average_distances(found, self.truth, frame.measured, frame.camera, stride=STRIDE)
        rest = iter(distances)
        return [None if pose is None else _adjustment(pose, self.truth, next(rest)) for pose in poses]

    def settled(self, solver: str, limit: float) -> float | None:
        """Feed level from which on the distance stays below a limit (m); None where it never does."""
        beyond = np.flatnonzero(~(self.distance(solver) < limit))
        first = int(beyond[-1]) + 1 if len(beyond) else 0
        return float(self.level[first]) if first < len(self.level) else None


def _error(pose: SiloPose | None, truth: SiloPose) -> list[float]:
    if pose is None:
        return [np.nan] * 4
    return list(metrics.transform_error(pose, truth).to_dict().values())


def _std(covariance: Numbers | None) -> Numbers:
    return np.full(4, np.nan) if covariance is None else np.sqrt(np.diag(covariance))


def _mean(poses: Sequence[SiloPose]) -> SiloPose:
    r_x, r_y, t_x, t_y = np.mean([(p.r_x, p.r_y, p.t_x, p.t_y) for p in poses], axis=0)
    return SiloPose(float(r_x), float(r_y), float(t_x), float(t_y))


def _adjustment(pose: SiloPose, truth: SiloPose, distance: float) -> Adjustment:
    error = metrics.transform_error(pose, truth)
    return Adjustment(1e3 * error.t_x, 1e3 * error.t_y, 1e3 * error.r_x, 1e3 * error.r_y, 1e3 * distance)
