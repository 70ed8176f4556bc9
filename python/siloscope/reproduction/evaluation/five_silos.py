"""Fig. 17: PC average distance of all five silos over the normalised step (section 3.5)."""

from __future__ import annotations

from typing import Any

import numpy as np

from siloscope.reproduction.discharges import Discharge, perturbed, real
from siloscope.reproduction.evaluation import published
from siloscope.reproduction.evaluation.chapter import Chapter, Picture, Verdict
from siloscope.reproduction.evaluation.plan import Plan
from siloscope.reproduction.evaluation.series import Series
from siloscope.reproduction.evaluation.tables import Table
from siloscope.reproduction.evaluation.verdicts import holds, listed, millimetres
from siloscope.reproduction.jobs import Job
from siloscope.reproduction.running import Results
from siloscope.reproduction.solvers import ALL, SOLVERS

INTRODUCTION = """
The perturbed silos and the stand-ins for the real ones, one estimate a step, without averaging or fusion. The table has
the median over the second half of each discharge, where enough wall is seen.
"""


def silos() -> list[Discharge]:
    """The five silos."""
    return [*perturbed(), *(silo for silo in real() if "printed" not in silo.name)]


def jobs(plan: Plan) -> list[Job]:
    """The trials of Tables 4 and 5."""
    return [trial for silo in silos() for trial in silo.trials(plan.steps)]


def chapter(plan: Plan, results: Results) -> Chapter:
    """What came out."""
    series = [Series.of(silo, results, plan.steps) for silo in silos()]
    return Chapter("All five silos (section 3.5)", (INTRODUCTION, _table(series), _picture(series)), (_bounds(series),))


def _table(series: list[Series]) -> Table:
    head = ("silo", *(f"{SOLVERS[name].heading}, mm" for name in ALL))
    rows = [(_name(one), *(_late(one, name) for name in ALL)) for one in series]
    return Table("fig17", "Fig. 17: median distance in the second half of the discharge", head, tuple(rows))


def _name(series: Series) -> str:
    return f"{series.name} (stand-in)" if "R" in series.name else series.name


def _late(series: Series, solver: str) -> float | None:
    """Median distance over the second half, mm."""
    distance = series.distance(solver)[len(series.level) // 2 :]
    return 1e3 * float(np.nanmedian(distance)) if np.isfinite(distance).any() else None


def _bounds(series: list[Series]) -> Verdict:
    late = {one.name: _late(one, "shape-tensor") for one in series}
    good = all(value is not None and value <= _bound(name) for name, value in late.items())
    beyond = [name for name, value in late.items() if value is None or value > _bound(name)]
    return Verdict(
        "Fig. 17: distances in almost all cases",
        f"under {published.FIG17_MOST:g} mm, Silo2 {published.FIG17_MOST_SILO2:g} mm",
        listed([f"{millimetres(value)} ({name})" for name, value in late.items()]),
        holds(good),
        f"Beyond the paper's bound: {listed(beyond)}; see the chapters on these silos." if beyond else "",
    )


def _bound(name: str) -> float:
    return published.FIG17_MOST_SILO2 if name == "Silo2" else published.FIG17_MOST


def _picture(series: list[Series]) -> Picture:
    def draw() -> Any:
        from siloscope.reproduction.evaluation import figures

        limits = {"paper": published.FIG17_MOST, "paper, Silo2": published.FIG17_MOST_SILO2}
        return figures.together(series, ("shape-tensor", "surface", "surface-profile"), limits)

    return Picture("fig17", "Fig. 17: PC average distance; the dashed lines are the paper's bounds.", draw)
