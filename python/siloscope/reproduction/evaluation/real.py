"""Table 5, Figs. 13 and 15: stand-ins for the real silos (section 3.3)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from siloscope.reproduction.discharges import PRINTED, real
from siloscope.reproduction.evaluation import published
from siloscope.reproduction.evaluation.adjustments import Adjusted
from siloscope.reproduction.evaluation.chapter import Chapter, Verdict
from siloscope.reproduction.evaluation.fusing import columns, refusals
from siloscope.reproduction.evaluation.honesty import answered, coverage, too_small, wrong_answers
from siloscope.reproduction.evaluation.pictures import clouds, curves
from siloscope.reproduction.evaluation.plan import Plan
from siloscope.reproduction.evaluation.series import LAST, Series
from siloscope.reproduction.evaluation.verdicts import judged, millimetres
from siloscope.reproduction.jobs import Job
from siloscope.reproduction.running import Results

INTRODUCTION = f"""
The paper's recordings are not public. These rows are **stand-ins**: simulated silos with Table 2's geometry and pose,
an Orbbec Astra (noise and bias of its profile, one device's own bias, 1 mm steps, lost patches, flying pixels, dust), a
wall that is out of round, with seams, dents and stuck feed, and irregular feed that slides between frames. They show
what the methods do in such a silo; they can't show what the paper's camera saw.

With Eqs. 5 to 7 as printed, Table 2's rotations make cameras that look away from the axis. "SiloR1" and "SiloR2" have
the rotations negated, so that the cameras look at it; "as printed" has them as they stand, with every {PRINTED}th step.
"""

UNSEEN_SHAPE = """
A wall that is out of round or dented, feed stuck to it and the device's own bias are the same in every frame and alike
over large parts of the wall. The deviations know the noise and what disagrees within a frame, and a fusion of many such
frames is as sure as its frames are alike; it is not nearer for that.
"""


def jobs(plan: Plan) -> list[Job]:
    """A trial a step of every stand-in."""
    return [trial for silo in real() for trial in silo.trials(plan.steps)]


def chapter(plan: Plan, results: Results) -> Chapter:
    """What came out."""
    series = [_marked(Series.of(silo, results, plan.steps)) for silo in real()]
    adjusted = Adjusted.of(series, columns())
    poses = {name: found["shape-tensor"] for name, found in adjusted.poses.items()}
    paper = {f"{name} (stand-in)": row for name, row in published.TABLE5.items()}
    title = f"Table 5: stand-ins for the real silos, mean of the last {LAST} estimates, and fused"
    return Chapter(
        "Real silos (section 3.3): stand-ins",
        (
            INTRODUCTION,
            adjusted.table("table5", title, paper, "The paper's SiloR2 rotations are probably in rad, not mrad."),
            refusals(series),
            coverage("table5-coverage", "Answers and honesty, stand-ins", series),
            wrong_answers(series),
            too_small(series, UNSEEN_SHAPE),
            curves(
                "fig13", "Fig. 13: errors, shares and distances over the discharge (stand-ins).", series, "Stand-ins"
            ),
            clouds(
                "fig15",
                "Fig. 15: the last frame, adjusted with the true pose and by shape-tensor.",
                series,
                poses,
                "Stand-ins, last frame",
            ),
        ),
        tuple(_distances(adjusted, paper, series)),
    )


def _marked(series: Series) -> Series:
    """Says stand-in wherever the name is shown."""
    name = series.name
    marked = f"{name} (stand-in)"
    return replace(series, discharge=replace(series.discharge, name=marked))


def _distances(
    adjusted: Adjusted, paper: dict[str, published.Adjustment], series: Sequence[Series]
) -> Iterator[Verdict]:
    by_name = {one.name: one for one in series}
    for silo, row in paper.items():
        ours = adjusted.distance(silo, "shape-tensor")
        yield Verdict(
            f"Table 5, {silo}: PC average distance",
            millimetres(row.distance),
            millimetres(ours),
            judged(ours, row.distance),
            f"A stand-in is another silo than the paper's. {answered(by_name[silo], 'shape-tensor')}",
        )
