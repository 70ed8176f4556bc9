"""Is the stated uncertainty true? Shares of errors within 2 stated standard deviations, over many unseen frames.

python -m benchmarks.coverage --write
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from benchmarks import trials
from benchmarks.trials import DIAMETER, KNOWN, NOTHING, Knowledge

from siloscope import Calibration, Estimate
from siloscope.simulation import ASTRA_S, Defects, Feed, Scene, defects, discharge
from siloscope.simulation.scenarios import random_scene

SHAPES = ("gaussian", "funnel", "mound", "gaussian+tilted", "rathole+lumpy+tilted")
QUANTITIES = ("r_x", "r_y", "t_x", "t_y", "radius", "cylinder_bottom", "apex")
WALLS = "seams,dents,oval,ladder,cables"
LONG = 40
"""Frames of a long sequence, in which what frames share shows."""


def scene_of(seed: int, wall: Defects | None = None) -> Scene:
    """An unseen silo with an unseen feed."""
    draw = np.random.default_rng((seed, 11))
    feed = Feed(SHAPES[seed % len(SHAPES)], float(draw.uniform(0.05, 0.55)), seed=seed)
    return replace(random_scene(seed, feed, sensor=ASTRA_S), defects=wall)


def deviations(answer: Estimate | Calibration, scene: Scene) -> list[float]:
    """Error over stated standard deviation of `QUANTITIES`; NaN where not stated."""
    truth = {**{k: getattr(scene.pose, k) for k in QUANTITIES[:4]}, **scene.silo.geometry.to_dict()}
    stated = answer.to_dict()
    values, stds = {**stated, **stated["silo"]}, {**stated["std"], **stated["silo"]["std"]}
    return [float("nan") if values[k] is None or not stds[k] else (values[k] - truth[k]) / stds[k] for k in QUANTITIES]


@dataclass(frozen=True)
class Row:
    """One line of the table: what is looked at, with what knowledge."""

    name: str
    knowledge: Knowledge
    answer: Callable[[Knowledge, int], tuple[Estimate | Calibration, Scene]]


def one_frame(knowledge: Knowledge, seed: int) -> tuple[Estimate, Scene]:
    """The answer to one frame of a smooth silo."""
    scene = scene_of(seed)
    return knowledge.locate(scene.render()), scene


def one_real_wall(knowledge: Knowledge, seed: int) -> tuple[Estimate, Scene]:
    """The answer to one frame of a silo with seams, dents, 1 % ovality, ladder and cables."""
    scene = scene_of(seed, defects(WALLS, seed))
    return knowledge.locate(scene.render()), scene


def one_warped_sensor(knowledge: Knowledge, seed: int) -> tuple[Estimate, Scene]:
    """The answer to one frame of a smooth silo by a sensor with a lasting warp that no profile knows, 1 mm at 1 m."""
    scene = warped(scene_of(seed), seed)
    return knowledge.locate(scene.render()), scene


def warped(scene: Scene, seed: int) -> Scene:
    """The scene before one of many such sensors."""
    return replace(scene, sensor=replace(ASTRA_S, warp=0.001, warp_seed=seed))


def sequence(knowledge: Knowledge, seed: int) -> tuple[Calibration, Scene]:
    """The calibration from 6 frames of a discharge."""
    return _calibrated(knowledge, scene_of(seed))


def sequence_of_real_wall(knowledge: Knowledge, seed: int) -> tuple[Calibration, Scene]:
    """The same in a silo with seams, dents, 1 % ovality, ladder and cables."""
    return _calibrated(knowledge, scene_of(seed, defects(WALLS, seed)))


def long_sequence(knowledge: Knowledge, seed: int) -> tuple[Calibration, Scene]:
    """The calibration from 40 frames of a discharge."""
    return _calibrated(knowledge, scene_of(seed), LONG)


def long_sequence_of_dents(knowledge: Knowledge, seed: int) -> tuple[Calibration, Scene]:
    """The same in a round silo with dents: what they do comes back in every frame."""
    return _calibrated(knowledge, scene_of(seed, defects("dents", seed)), LONG)


def long_sequence_of_warped_sensor(knowledge: Knowledge, seed: int) -> tuple[Calibration, Scene]:
    """The same before a warped sensor."""
    return _calibrated(knowledge, warped(scene_of(seed), seed), LONG)


def _calibrated(knowledge: Knowledge, scene: Scene, steps: int = 6) -> tuple[Calibration, Scene]:
    return knowledge.calibrate(list(discharge(scene, steps, 0.55, 0.05))), scene


ROWS = (
    Row("one frame, profile known", KNOWN, one_frame),
    Row("one frame, diameter known", DIAMETER, one_frame),
    Row("one frame, nothing known", NOTHING, one_frame),
    Row("one frame, real wall, profile known", KNOWN, one_real_wall),
    Row("one frame, warped sensor, profile known", KNOWN, one_warped_sensor),
    Row("calibrated from 6, profile known", KNOWN, sequence),
    Row("calibrated from 6, diameter known", DIAMETER, sequence),
    Row("calibrated from 6, nothing known", NOTHING, sequence),
    Row("calibrated from 6, real wall, profile known", KNOWN, sequence_of_real_wall),
    Row("calibrated from 40, profile known", KNOWN, long_sequence),
    Row("calibrated from 40, nothing known", NOTHING, long_sequence),
    Row("calibrated from 40, dents, profile known", KNOWN, long_sequence_of_dents),
    Row("calibrated from 40, warped sensor, profile known", KNOWN, long_sequence_of_warped_sensor),
)


def main() -> None:
    """Prints the table; with --list the frames beyond 4; with --write puts it into the manual."""
    options = trials.arguments(__doc__, frames=100, sequences=40, first=1000, row=-1)
    lines = []
    for row in ROWS if options.row < 0 else (ROWS[options.row],):
        count = options.frames if row.name.startswith("one") else options.sequences
        seeds = range(options.first, options.first + count)
        answers = list(trials.each(seeds, partial(row.answer, row.knowledge), options.jobs, row.name))
        found = np.array([deviations(answer, scene) for answer, scene in answers if answer.ok]).reshape(-1, 7)
        for seed, (answer, scene) in zip(seeds, answers, strict=True):
            worst = np.nanmax(np.abs(deviations(answer, scene))) if answer.ok else 0.0
            if options.list and worst > 4.0:
                feed = scene.feed.shape if scene.feed else "empty"
                print(f"  seed {seed} ({feed}): {np.round(deviations(answer, scene), 1)}", flush=True)
        lines.append(
            (row.name, len(found), count - len(found), *(_share(found[:, k]) for k in range(7)), _worst(found))
        )
    head = ("within 2 std, %", "answers", "refused", *QUANTITIES, "beyond 4 std")
    trials.publish("coverage", trials.table(head, lines), options.write, "benchmarks.coverage")


def _share(values: np.ndarray) -> str:
    seen = values[np.isfinite(values)]
    return f"{100 * np.mean(np.abs(seen) <= 2.0):.0f}" if len(seen) else "—"


def _worst(found: np.ndarray) -> int:
    """Answers of which anything is off by more than 4 standard deviations."""
    return int((np.nanmax(np.abs(found), axis=1) > 4.0).sum()) if len(found) else 0


if __name__ == "__main__":
    main()
