"""Up to which feed level the answer is within 5 mm.

python -m benchmarks.levels --write
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from benchmarks import trials
from benchmarks.trials import KNOWN

from siloscope.simulation import ASTRA_S, Feed, Scene
from siloscope.simulation.scenarios import random_scene, scenario

NAMES = ("silo1", "silo2", "silo3", "silo-r1", "silo-r2")
LEVELS = tuple(round(0.1 * step, 1) for step in range(1, 10))
WITHIN = 5.0
"""mm"""


def measured(scene: Scene) -> tuple[float, float, str | None]:
    """PC average distance in mm, share of wall in the picture, and the reason of a refusal."""
    frame = scene.render()
    ratios, estimate = frame.pixel_ratios, KNOWN.locate(frame)
    return trials.distance(frame, estimate), ratios.cylinder + ratios.cone, estimate.reason


def main() -> None:
    """Prints the table; with --list every refusal; with --write puts it into the manual."""
    options = trials.arguments(__doc__, silos=10, first=200)
    named = [(name, scenario(name)) for name in NAMES]
    unseen = [(f"unseen {k}", random_scene(k)) for k in range(options.first, options.first + options.silos)]
    scenes = [
        replace(scene, feed=Feed("gaussian", level), sensor=ASTRA_S, seed=1)
        for _, scene in named + unseen
        for level in LEVELS
    ]
    found = list(trials.each(scenes, measured, options.jobs, "levels"))
    rows = [found[k : k + len(LEVELS)] for k in range(0, len(found), len(LEVELS))]
    lines: list[tuple[object, ...]] = []
    for (name, _), row in zip(named + unseen, rows, strict=True):
        if options.list:
            print(f"  {name}: " + ", ".join(f"{wall:.2f} {reason or f'{gap:.2f}'}" for gap, wall, reason in row))
    for (name, _), row in zip(named, rows, strict=False):
        lines.append((f"{name}, mm", *(f"{gap:.2f}" if reason is None else "refused" for gap, _, reason in row)))
    for told, holds in (("within 5 mm", _within), ("refused", _refused), ("further off", _off)):
        lines.append(
            (f"of {len(rows)} silos {told}", *(sum(holds(row[k]) for row in rows) for k in range(len(LEVELS))))
        )
    lines.append(
        ("median share of wall, %", *(f"{100 * np.median([row[k][1] for row in rows]):.0f}" for k in range(9)))
    )
    head = ("feed level", *(f"{100 * level:.0f} %" for level in LEVELS))
    trials.publish("levels", trials.table(head, lines), options.write, "benchmarks.levels")


def _within(cell: tuple[float, float, str | None]) -> bool:
    return cell[2] is None and cell[0] <= WITHIN


def _refused(cell: tuple[float, float, str | None]) -> bool:
    return cell[2] is not None


def _off(cell: tuple[float, float, str | None]) -> bool:
    return cell[2] is None and cell[0] > WITHIN


if __name__ == "__main__":
    main()
