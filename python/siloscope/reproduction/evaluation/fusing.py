"""Columns of Tables 4 and 5: the paper's mean of the last estimates, and the information fusion of all."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from siloscope.calibrate import calibrate
from siloscope.reproduction.evaluation.adjustments import Column
from siloscope.reproduction.evaluation.series import LAST, Series
from siloscope.reproduction.evaluation.verdicts import listed
from siloscope.reproduction.solvers import SOLVERS, SURFACE
from siloscope.types.calibration import Calibration
from siloscope.types.pose import SiloPose


def columns() -> list[Column]:
    """Mean of the last estimates of every method, then the fusion of each kind of `surface`."""
    means = [Column(name, solver.heading, partial(_mean, solver=name)) for name, solver in SOLVERS.items()]
    fusions = [
        Column(fusion(name), f"fused: {SOLVERS[name].heading}", partial(_fused, solver=name)) for name in SURFACE
    ]
    return [*means, *fusions]


def fusion(solver: str) -> str:
    """Key of the column that fuses a method's estimates."""
    return f"fused-{solver}"


def _mean(series: Series, *, solver: str) -> SiloPose | None:
    return series.mean_of_last(solver, LAST)


def refusals(series: Sequence[Series]) -> str:
    """A sentence on fusions that are refused."""
    found = [(one.name, SOLVERS[name].heading, _calibration(one, name)) for one in series for name in SURFACE]
    told = [f"`{heading}` in {silo} ({fused.reason})" for silo, heading, fused in found if fused.pose is None]
    return f"Fusions that are refused, and why: {listed(told)}."


def _fused(series: Series, *, solver: str) -> SiloPose | None:
    return _calibration(series, solver).pose


def _calibration(series: Series, solver: str) -> Calibration:
    return calibrate([answer.estimate() for answer in series.answers(solver)])
