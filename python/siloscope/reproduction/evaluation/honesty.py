"""Whether refusals and stated standard deviations tell the truth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from siloscope.reproduction.evaluation.series import Series
from siloscope.reproduction.evaluation.tables import Cell, Table
from siloscope.reproduction.evaluation.verdicts import listed
from siloscope.reproduction.solvers import SOLVERS


def coverage(name: str, title: str, series: Sequence[Series]) -> Table:
    """Answers, wrong answers, and the share of errors within two stated standard deviations, of all four parameters."""
    head = ("silo", "method", "frames", *WHAT)
    rows = [(one.name, SOLVERS[name].heading, len(one.level), *_cells(one, name)) for one in series for name in SOLVERS]
    note = "Honest standard deviations cover about 95 % of the errors; more means that they are cautious."
    return Table(name, title, head, tuple(rows), note)


FAR = 0.1
"""Distance from which on an answer is a wrong one that should have been refused, m."""

WHAT = ("answered %", f"over {1e3 * FAR:g} mm", "covered %")


def _cells(series: Series, solver: str) -> tuple[Cell, ...]:
    answered = 100.0 * len(series.answered(solver)) / len(series.level)
    share = covered(series, solver)
    return answered, wrong(series, solver), None if share is None else 100.0 * share


def wrong(series: Series, solver: str) -> int:
    """Number of answers that are far off."""
    return int(np.count_nonzero(series.distance(solver) > FAR))


def wrong_answers(series: Sequence[Series]) -> str:
    """A sentence on answers that should have been refusals."""
    counts = {SOLVERS[name].heading: sum(wrong(one, name) for one in series) for name in SOLVERS}
    told = [f"{count} of `{name}`" for name, count in counts.items() if count]
    frames = sum(len(one.level) for one in series)
    return (
        f"Of {frames} frames, these were answered more than {1e3 * FAR:g} mm off instead of refused: {listed(told)}. "
        "A mean of the last estimates would take them along, a fusion can leave them out."
    )


ENOUGH = 0.8
"""Share of covered errors below which the stated deviations are called too small."""


def too_small(series: Sequence[Series], why: str) -> str:
    """A sentence on stated deviations that are too small, and why they are."""
    short = {one.name: [SOLVERS[name].heading for name in SOLVERS if _is_short(one, name)] for one in series}
    told = [f"{listed([f'`{name}`' for name in names])} in {silo}" for silo, names in short.items() if names]
    if not told:
        return f"Nowhere are fewer than {100.0 * ENOUGH:g} % covered."
    return f"Too small, with fewer than {100.0 * ENOUGH:g} % covered, are the deviations of {'; '.join(told)}. {why}"


def _is_short(series: Series, solver: str) -> bool:
    share = covered(series, solver)
    return share is not None and share < ENOUGH


def answered(series: Series, solver: str) -> str:
    """In how many frames there was an answer at all."""
    return f"Answered in {len(series.answered(solver))} of {len(series.level)} frames, refused in the others."


def covered(series: Series, solver: str) -> float | None:
    """Share of errors within two standard deviations; None where nothing was answered."""
    ratio = np.abs(series.error(solver)) / series.std(solver)
    known = np.isfinite(ratio)
    return float(np.mean(ratio[known] <= 2.0)) if known.any() else None
