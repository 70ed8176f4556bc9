"""Is the stated uncertainty true? Shares of errors within 2 stated standard deviations, over many unseen frames.

python -m benchmarks.coverage --write

The frames are of every kind of `benchmarks.kinds` in turn. "Sure and wrong" is a pose that is off by more than 4 stated
deviations and by more than 10 mm or 5 mrad.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from benchmarks import trials
from benchmarks.kinds import KINDS, Case, mixed
from benchmarks.trials import DIAMETER, KNOWN, NOTHING, Knowledge

from siloscope import Calibration, Estimate
from siloscope.simulation import Scene, discharge

QUANTITIES = ("r_x", "r_y", "t_x", "t_y", "radius", "cylinder_bottom", "apex")


def deviations(answer: Estimate | Calibration, scene: Scene) -> list[float]:
    """Error over stated standard deviation of `QUANTITIES`; NaN where not stated, infinite for what does not exist."""
    truth = {**{k: getattr(scene.pose, k) for k in QUANTITIES[:4]}, **scene.silo.geometry.to_dict()}
    stated = answer.to_dict()
    values, stds = {**stated, **stated["silo"]}, {**stated["std"], **stated["silo"]["std"]}
    return [_deviation(values[k], truth[k], stds[k]) for k in QUANTITIES]


def _deviation(value: float | None, truth: float | None, std: float | None) -> float:
    if value is None or not std:
        return float("nan")
    return float("inf") if truth is None else (value - truth) / std


@dataclass(frozen=True)
class Row:
    """One line of the table: what is known, and from how many frames of a discharge the answer comes."""

    name: str
    knowledge: Knowledge
    frames: int = 1

    def answer(self, case: Case) -> Estimate | Calibration:
        """The answer for a case."""
        known = self.knowledge.of(case.profile)
        if self.frames == 1:
            return known.locate(case.scene.render())
        if case.scene.feed is None:
            return known.calibrate([trials.again(case.scene, i) for i in range(self.frames)])
        return known.calibrate(list(discharge(case.scene, self.frames, 0.55, 0.05)))


ROWS = (
    Row("one frame, profile known", KNOWN),
    Row("one frame, diameter known", DIAMETER),
    Row("one frame, nothing known", NOTHING),
    Row("calibrated from 6, profile known", KNOWN, 6),
    Row("calibrated from 6, diameter known", DIAMETER, 6),
    Row("calibrated from 6, nothing known", NOTHING, 6),
    Row("calibrated from 40, profile known", KNOWN, 40),
    Row("calibrated from 40, nothing known", NOTHING, 40),
)
HEAD = ("answers", "refused", *QUANTITIES, "beyond 4 std", "sure and wrong")

Answers = Sequence[tuple[Case, Estimate | Calibration]]


def main() -> None:
    """Prints the tables; with --list what is wrong or beyond 4; with --write puts them into the manual."""
    options = trials.arguments(__doc__, frames=160, sequences=48, first=1008, row=-1)
    lines, kinds = [], []
    for row in ROWS if options.row < 0 else (ROWS[options.row],):
        count = options.frames if row.frames == 1 else options.sequences
        cases = mixed(range(options.first, options.first + count))
        answers = list(zip(cases, trials.each(cases, row.answer, options.jobs, row.name), strict=True))
        if options.list:
            print("\n".join(listed(answers)), flush=True)
        lines.append((row.name, *cells(answers)))
        if row == ROWS[0]:
            kinds = [(kind, *cells([a for a in answers if a[0].kind == kind])) for kind in KINDS]
    text = trials.table(("within 2 std, %", *HEAD), lines)
    trials.publish("coverage", text, options.write and options.row < 0, "benchmarks.coverage")
    if kinds:
        text = trials.table((f"{ROWS[0].name}, by kind", *HEAD), kinds)
        trials.publish("coverage by kind", text, options.write, "benchmarks.coverage")


def cells(answers: Answers) -> tuple[object, ...]:
    """The figures of some answers under `HEAD`."""
    given = [(case, answer) for case, answer in answers if answer.ok]
    found = np.array([deviations(answer, case.scene) for case, answer in given]).reshape(-1, len(QUANTITIES))
    wrong = sum(trials.sure_and_wrong(answer, case.scene) for case, answer in given)
    return (len(given), len(answers) - len(given), *map(_share, found.T), _worst(found), wrong)


def listed(answers: Answers) -> list[str]:
    """Lines about the answers that are wrong or beyond 4."""
    lines = []
    for case, answer in answers:
        z = deviations(answer, case.scene) if answer.ok else [0.0]
        if np.nanmax(np.abs(z)) > 4.0:
            lines.append(f"  {case.kind} {case.scene.seed}: {np.round(z, 1)}")
    return lines


def _share(values: np.ndarray) -> str:
    seen = values[~np.isnan(values)]
    return f"{100 * np.mean(np.abs(seen) <= 2.0):.0f}" if len(seen) else "—"


def _worst(found: np.ndarray) -> int:
    """Answers of which anything is off by more than 4 standard deviations."""
    return int((np.nanmax(np.abs(found), axis=1) > 4.0).sum()) if len(found) else 0


if __name__ == "__main__":
    main()
