"""A method of one's own on the paper's frames, judged as the paper judges (section 2.4).

::

    from siloscope.reproduction.own_method import evaluate, table

    def mine(frame):                      # a SimulatedFrame: .measured (H, W) metres, .camera
        return SiloPose(...)              # or None where it gives no answer

    print(table(evaluate(mine, "perturbed", steps=20)))
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from siloscope.errors import UsageError
from siloscope.reproduction.discharges import Discharge, perfect, perturbed, real
from siloscope.reproduction.trials import STRIDE
from siloscope.simulation import SimulatedFrame, metrics
from siloscope.types.pose import SiloPose

KINDS: dict[str, Callable[[], list[Discharge]]] = {"perfect": perfect, "perturbed": perturbed, "real": real}
"""Tables 3, 4 and 5 of the paper."""

Method = Callable[[SimulatedFrame], SiloPose | None]
"""A method: the camera's pose in the silo from a frame, or None."""


@dataclass(frozen=True)
class Judged:
    """A method's answer for one frame of a discharge."""

    silo: str
    step: int
    pose: SiloPose | None
    direction: float | None
    """Angle between the axis found and the true one, rad."""
    position: float | None
    """Distance between the two camera positions across the axis, m."""
    distance: float | None
    """The paper's PC average distance (Eq. 11), m."""
    seconds: float


def evaluate(method: Method, kind: str = "perturbed", steps: int | None = None) -> Iterator[Judged]:
    """Runs a method on every frame of the paper's discharges.

    Parameters
    ----------
    method : callable
        Is given the frame with its truth, of which a fair method looks at ``measured`` and ``camera`` only.
    kind : {"perfect", "perturbed", "real"}
        Which of the paper's sets.
    steps : int, optional
        Frames a discharge in place of the paper's number.

    Raises
    ------
    UsageError
        For another kind.
    """
    if kind not in KINDS:
        raise UsageError(f"kind '{kind}' is not known; known are {', '.join(KINDS)}")
    for silo in KINDS[kind]():
        for step, trial in enumerate(silo.trials(steps)):
            frame = trial.scene.render()
            start = time.perf_counter()
            pose = method(frame)
            yield _judged(silo.name, step, frame, pose, time.perf_counter() - start)


def _judged(silo: str, step: int, frame: SimulatedFrame, pose: SiloPose | None, seconds: float) -> Judged:
    if pose is None:
        return Judged(silo, step, None, None, None, None, seconds)
    found, true = pose.axis_direction, frame.pose.axis_direction
    direction = math.atan2(float(np.linalg.norm(np.cross(found, true))), float(found @ true))
    position = math.hypot(pose.t_x - frame.pose.t_x, pose.t_y - frame.pose.t_y)
    (distance,) = metrics.pc_average_distances([pose], frame.pose, frame.measured, frame.camera, stride=STRIDE)
    return Judged(silo, step, pose, direction, position, distance, seconds)


def table(judged: Iterable[Judged]) -> str:
    """A Markdown table: a row a silo, with the medians over its answered frames."""
    rows = ["| silo | frames | answered | direction (°) | position (mm) | PC distance (mm) | time (ms) |"]
    rows.append("|---|--:|--:|--:|--:|--:|--:|")
    by_silo: dict[str, list[Judged]] = {}
    for one in judged:
        by_silo.setdefault(one.silo, []).append(one)
    for silo, frames in by_silo.items():
        answered = [one for one in frames if one.pose is not None]
        numbers = [
            _median(one.direction for one in answered) * math.degrees(1.0),
            _median(one.position for one in answered) * 1e3,
            _median(one.distance for one in answered) * 1e3,
            _median(one.seconds for one in frames) * 1e3,
        ]
        shown = " | ".join("" if math.isnan(number) else f"{number:.3g}" for number in numbers)
        rows.append(f"| {silo} | {len(frames)} | {len(answered)} | {shown} |")
    return "\n".join(rows)


def _median(values: Iterable[float | None]) -> float:
    known = [value for value in values if value is not None]
    return float(np.median(known)) if known else math.nan
