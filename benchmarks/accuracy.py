"""How far off the answers are: PC average distance (Eq. 11) over the paper's silos, unseen ones, and every other kind.

python -m benchmarks.accuracy --write
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from benchmarks import trials
from benchmarks.kinds import KINDS, case
from benchmarks.trials import DIAMETER, KNOWN, LIDAR_PROFILE, NOTHING, Knowledge

from siloscope.simulation import Feed, Scene

GAUSSIAN = Feed("gaussian", 0.1)


@dataclass(frozen=True)
class Row:
    """One line of the table: which frames, what is known, and what must be reached (median and worst, mm)."""

    name: str
    feed: Feed
    knowledge: Knowledge
    median: float
    worst: float
    perturbed: bool = True
    big: bool = False
    kind: str | None = None
    """Of `benchmarks.kinds`."""

    def scenes(self, seeds: range) -> list[tuple[str, Scene]]:
        """Its scenes, with their names."""
        if self.kind:
            return [(f"unseen {seed}", case(self.kind, seed).scene) for seed in seeds]
        if self.big:
            return trials.big_silos(seeds, self.feed)
        return trials.silos(seeds, self.feed, perturbed=self.perturbed)


NAN = float("nan")
"""No goal is set."""


def _known(kind: str) -> Knowledge:
    return KNOWN.of(case(kind, 0).profile)


EXACT, EXACT_DIAMETER, EXACT_NOTHING = (replace(one, exact=True) for one in (KNOWN, DIAMETER, NOTHING))
"""With the intrinsics told as exact, as those of the scenes without a kind are."""

LIDAR = Knowledge("profile known", LIDAR_PROFILE, exact=True)

RATHOLE = Feed("rathole+lumpy+tilted", 0.3)

ROWS = (
    Row("perfect", GAUSSIAN, EXACT_NOTHING, 0.05, 0.15, perturbed=False),
    Row("perturbed, profile known", GAUSSIAN, EXACT, 0.15, 0.6),
    Row("the same, funnel feed at 45 %", Feed("funnel", 0.45), EXACT, 0.6, 3.0),
    Row(
        "the same, off-centre rathole in lumpy tilted feed, 30 %",
        Feed("rathole+lumpy+tilted", 0.3),
        EXACT,
        0.6,
        3.0,
    ),
    Row("perturbed, profile unknown, diameter known", GAUSSIAN, EXACT_DIAMETER, 2.0, 6.0),
    Row("perturbed, nothing known", GAUSSIAN, EXACT_NOTHING, 12.0, 30.0),
    Row("radius 6–12 m, LiDAR-like", GAUSSIAN, LIDAR, 1.0, 5.0, big=True),
    *(Row(f"{kind}, profile known", GAUSSIAN, _known(kind), NAN, NAN, kind=kind) for kind in KINDS if kind != "exact"),
)


def measured(row: Row, scene: Scene) -> tuple[float, str | None, bool]:
    """PC average distance in mm, the reason of a refusal, and whether the answer is sure and wrong."""
    frame = scene.render()
    estimate = row.knowledge.locate(frame)
    return trials.distance(frame, estimate), estimate.reason, estimate.ok and trials.sure_and_wrong(estimate, scene)


def main() -> None:
    """Prints the table, and with --list every frame; with --write puts it into the manual."""
    options = trials.arguments(__doc__, silos=30, first=100, row=-1)
    seeds = range(options.first, options.first + options.silos)
    lines = []
    for row in ROWS if options.row < 0 else (ROWS[options.row],):
        scenes = row.scenes(seeds)
        found = list(trials.each([s for _, s in scenes], partial(measured, row), options.jobs, row.name))
        for (name, _), (gap, reason, _) in zip(scenes, found, strict=True):
            if options.list or reason or gap > row.worst:
                print(f"  {name}: {reason or f'{gap:.3f} mm'}")
        gaps = np.array([gap for gap, reason, _ in found if reason is None])
        refused = len(found) - len(gaps)
        numbers = (_figure(gaps, np.median), _goal(row.median), _figure(gaps, np.max), _goal(row.worst))
        lines.append((row.name, len(found), *numbers, refused, sum(wrong for _, _, wrong in found)))
    head = ("frames", "silos", "median, mm", "goal", "worst, mm", "goal", "refused", "sure and wrong")
    trials.publish("accuracy", trials.table(head, lines), options.write, "benchmarks.accuracy")


def _figure(gaps: np.ndarray, of: Callable[[np.ndarray], float]) -> str:
    return f"{of(gaps):.3f}" if len(gaps) else "–"


def _goal(value: float) -> str:
    return f"{value:g}" if value == value else "–"


if __name__ == "__main__":
    main()
