"""Columns of Tables 4 and 5: the paper's mean of the last estimates, and the information fusion of all."""

from __future__ import annotations

from functools import partial

from siloscope.calibrate import calibrate
from siloscope.paper.evaluation.adjustments import Column
from siloscope.paper.evaluation.series import LAST, Series
from siloscope.paper.solvers import SOLVERS, SURFACE
from siloscope.pose import SiloPose


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


def _fused(series: Series, *, solver: str) -> SiloPose | None:
    return calibrate([answer.estimate() for answer in series.answers(solver)]).pose
