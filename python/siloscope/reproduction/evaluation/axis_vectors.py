"""Fig. 14: the estimated vectors of step 4 for perfect silos and for stand-ins of real ones."""

from __future__ import annotations

from typing import Any

import numpy as np

from siloscope.reproduction.evaluation.chapter import Chapter, Picture, Verdict
from siloscope.reproduction.evaluation.plan import Plan
from siloscope.reproduction.evaluation.series import Numbers
from siloscope.reproduction.evaluation.tables import Cell, Table, number
from siloscope.reproduction.evaluation.verdicts import holds
from siloscope.reproduction.jobs import Job
from siloscope.reproduction.running import Results
from siloscope.reproduction.vectors import frames

INTRODUCTION = """
Step 4 takes the cross product of E1 at two candidate points for an estimate of the axis direction (Eq. 3); its
principal component is the answer. The paper shows that these vectors scatter more for real silos than for perfect ones.
"""


def jobs(plan: Plan) -> list[Job]:
    """A set of vectors a frame."""
    return list(frames().values())


def chapter(plan: Plan, results: Results) -> Chapter:
    """What came out."""
    found = {name: (_array(results[job]), job.scene.pose.axis_direction) for name, job in frames().items()}
    off = {name: _angles(*cloud) for name, cloud in found.items()}
    perfect = [float(np.median(angle)) for name, angle in off.items() if "stand-in" not in name]
    real = [float(np.median(angle)) for name, angle in off.items() if "stand-in" in name]
    return Chapter(
        "Estimated vectors (Fig. 14)",
        (INTRODUCTION, _table(off), _picture(found)),
        (_verdict(perfect, real),),
    )


def _array(result: dict[str, Any]) -> Numbers:
    return np.array(result["vectors"], float).reshape(-1, 3)


def _angles(vectors: Numbers, axis: Numbers) -> Numbers:
    """Angle of each vector from the true axis, degrees."""
    aside = np.linalg.norm(np.cross(vectors, axis), axis=1)
    turned: Numbers = np.degrees(np.arctan2(aside, np.abs(vectors @ axis)))
    return turned


def _table(off: dict[str, Numbers]) -> Table:
    head = ("frame", "pairs", "median, degrees", "nine tenths within, degrees")
    rows: list[tuple[Cell, ...]] = [
        (name, len(angle), float(np.median(angle)), float(np.percentile(angle, 90.0))) for name, angle in off.items()
    ]
    return Table("fig14", "Fig. 14: angle of the estimated vectors from the true axis", head, tuple(rows))


def _verdict(perfect: list[float], real: list[float]) -> Verdict:
    return Verdict(
        "Fig. 14: the vectors scatter much more in real silos than in perfect ones",
        "yes",
        f"medians of {_range(real)} (stand-ins) and {_range(perfect)} (perfect)",
        holds(min(real) > max(perfect)),
        "",
    )


def _range(values: list[float]) -> str:
    return f"{number(min(values))} to {number(max(values))} degrees"


def _picture(found: dict[str, tuple[Numbers, Numbers]]) -> Picture:
    def draw() -> Any:
        from siloscope.reproduction.evaluation import figures

        return figures.spread(found, "Estimated vectors, seen along the true axis (red cross)")

    return Picture("fig14", "Fig. 14: the estimated vectors, seen along the true axis.", draw)
