"""Table 4, Figs. 11 and 12: perturbed silos (section 3.2)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from siloscope.reproduction.discharges import perturbed
from siloscope.reproduction.evaluation import published
from siloscope.reproduction.evaluation.adjustments import Adjusted
from siloscope.reproduction.evaluation.chapter import Chapter, Verdict
from siloscope.reproduction.evaluation.fusing import columns, fusion, refusals
from siloscope.reproduction.evaluation.honesty import coverage, too_small, wrong_answers
from siloscope.reproduction.evaluation.pictures import clouds, curves
from siloscope.reproduction.evaluation.plan import Plan
from siloscope.reproduction.evaluation.series import LAST, Series
from siloscope.reproduction.evaluation.verdicts import holds, judged, listed, millimetres
from siloscope.reproduction.jobs import Job
from siloscope.reproduction.running import Results

INTRODUCTION = f"""
The same silos with the depth error of Eqs. 8 to 10 (Orbbec Astra S): a bias that grows with the squared depth, and
noise. As in the paper, the table has the mean of the last {LAST} estimates; the columns "fused" have the information
fusion of the whole discharge, which is what `siloscope calibrate` does. "Profile known" means that Eqs. 8 and 9 are
told to the program; "diameter known" that a tape's reading of the diameter is.
"""

UNSEEN_BIAS = """
A depth bias that is not told moves all points of a wall alike, so no disagreement within the frame shows it: the
deviations are those of the noise.
"""

EMPTYING = 0.35
"""Feed level from which on the paper's errors grow with the discharge."""


def jobs(plan: Plan) -> list[Job]:
    """A trial a step of every silo."""
    return [trial for silo in perturbed() for trial in silo.trials(plan.steps)]


def chapter(plan: Plan, results: Results) -> Chapter:
    """What came out."""
    series = [Series.of(silo, results, plan.steps) for silo in perturbed()]
    adjusted = Adjusted.of(series, columns())
    poses = {name: found["shape-tensor"] for name, found in adjusted.poses.items()}
    title = f"Table 4: perturbed silos, mean of the last {LAST} estimates, and fused"
    return Chapter(
        "Perturbed silos (section 3.2)",
        (
            INTRODUCTION,
            adjusted.table("table4", title, published.TABLE4, ""),
            refusals(series),
            coverage("table4-coverage", "Answers and honesty, perturbed silos", series),
            wrong_answers(series),
            too_small(series, UNSEEN_BIAS),
            curves("fig11", "Fig. 11: errors, shares and distances over the discharge.", series, "Perturbed silos"),
            clouds(
                "fig12",
                "Fig. 12: the last frame, adjusted with the true pose and by shape-tensor.",
                series,
                poses,
                "Perturbed silos, last frame",
            ),
        ),
        (*_distances(adjusted), _order(adjusted), _growth(series)),
    )


def _distances(adjusted: Adjusted) -> Iterator[Verdict]:
    for silo, paper in published.TABLE4.items():
        ours = adjusted.distance(silo, "shape-tensor")
        outcome = judged(ours, paper.distance)
        yield Verdict(
            f"Table 4, {silo}: PC average distance",
            millimetres(paper.distance),
            millimetres(ours),
            outcome,
            bias_explains(adjusted, silo),
        )


def bias_explains(adjusted: Adjusted, silo: str) -> str:
    """What knowing the sensor's bias changes, where it changes much."""
    shape, known, unknown = (
        adjusted.distance(silo, column) for column in ("shape-tensor", fusion("surface-profile"), fusion("surface"))
    )
    if shape is None or known is None or unknown is None:
        return ""
    if known < 0.2 * shape:
        return (
            "The depth bias bends the silo, and the six steps follow the bent one: with the bias known `surface`, "
            f"fused, comes to {millimetres(known)}; with nothing known it estimates the bend and comes to "
            f"{millimetres(unknown)}."
        )
    return ""


def _order(adjusted: Adjusted) -> Verdict:
    """ "Silo2 has the maximum error ... Silo3 worse than Silo1"."""
    found = {silo: adjusted.distance(silo, "shape-tensor") or np.nan for silo in published.TABLE4}
    ranking = sorted(found, key=lambda silo: -found[silo])
    paper = sorted(published.TABLE4, key=lambda silo: -published.TABLE4[silo].distance)
    return Verdict(
        "Silos by their error, the worst first",
        listed(paper),
        listed(ranking),
        holds(ranking == paper),
        "The worst is the deepest one, where the bias is largest." if ranking[0] == paper[0] else "",
    )


def _growth(series: list[Series]) -> Verdict:
    growing = [one.name for one in series if _grows(one)]
    return Verdict(
        "The distance grows while the silo empties, because farther points have more error",
        "yes",
        f"in {listed(growing)}",
        holds(len(growing) == len(series)),
        f"Compared: medians of the first and the last fifth of the steps below {100.0 * EMPTYING:.0f} % feed level."
        if len(growing) < len(series)
        else "",
    )


def _grows(series: Series) -> bool:
    """Whether the last fifth of the steps below `EMPTYING` is farther off than the first fifth of them."""
    distance = series.distance("shape-tensor")[series.level <= EMPTYING]
    distance = distance[np.isfinite(distance)]
    fifth = max(len(distance) // 5, 1)
    return bool(len(distance)) and float(np.median(distance[-fifth:])) > float(np.median(distance[:fifth]))
