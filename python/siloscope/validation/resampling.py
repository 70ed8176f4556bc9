"""The user's own solve, made exact and disturbed anew: do the answers scatter as they state?"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.parameters import POSE
from siloscope.types.frame import Frame
from siloscope.validation.frames import Asked, SeenFrame
from siloscope.validation.ideal import Ideal
from siloscope.validation.significance import deviation
from siloscope.validation.splits import calibrated

NEAR = 6.0
"""A pixel within so many deviations of the wall's reading, or of a fiftieth of its depth, shows the wall."""
OF_DEPTH = 0.02

MOST_FRAMES = 8
"""Frames of a resampled solve; more are thinned evenly."""


@dataclass(frozen=True)
class Resampled:
    """Answers to the same frames with other noise."""

    answers: int
    stated: dict[str, float]
    """Standard deviation that the exact frames' answer states, by parameter of the pose."""
    scatter: dict[str, float]
    """Standard deviation of the answers about that of the exact frames."""
    deviation: float
    """How rare it is that the scatter is so much larger than stated, of the worst parameter."""

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {"answers": self.answers, "stated": self.stated, "scatter": self.scatter, "deviation": self.deviation}


def resampled(
    frames: Sequence[SeenFrame],
    ideal: Ideal,
    asked: Asked,
    times: int,
    seed: int,
    progress: Callable[[Iterable[Any]], Iterable[Any]] | None = None,
) -> Resampled | None:
    """Solves exact frames with the profile's noise so many times; None without a noise law, or without answers."""
    law = asked.profile.noise
    if law is None or times < 2:
        return None
    some = [frames[i] for i in np.unique(np.linspace(0, len(frames) - 1, min(MOST_FRAMES, len(frames))).astype(int))]
    exact = [_exact(one, ideal) for one in some]
    middle = _solved(exact, asked)
    if middle is None:
        return None
    draws = np.random.default_rng(seed)
    offs = []
    for _ in progress(range(times)) if progress else range(times):
        noisy = [_noisy(one, law, draws) for one in exact]
        answer = _solved(noisy, asked)
        if answer is not None:
            offs.append(answer[0] - middle[0])
    if len(offs) < 2:
        return None
    squares = (np.array(offs) ** 2).sum(axis=0)
    worst = max(deviation(float(s / v**2), len(offs)) for s, v in zip(squares, middle[1], strict=True))
    scatter = np.sqrt(squares / len(offs))
    return Resampled(len(offs), _named(middle[1]), _named(scatter), worst)


def _named(values: NDArray[np.float64]) -> dict[str, float]:
    return dict(zip(POSE, values.tolist(), strict=True))


@dataclass(frozen=True, eq=False)
class _Exact:
    frame: Frame
    wall: NDArray[np.bool_]


def _exact(one: SeenFrame, ideal: Ideal) -> _Exact:
    """The frame with the ideal vessel's readings where it shows the wall, and as it was elsewhere."""
    depth = one.frame.depth
    reading = np.nan_to_num(_core.wall_readings(one.frame, ideal.wall))
    spread = float(np.sqrt(np.mean(ideal.tiles.residual**2))) if len(ideal.tiles) else 0.0
    near = np.abs(depth - reading) < NEAR * spread + OF_DEPTH * reading
    wall = (depth > 0.0) & (reading > 0.0) & near
    made = np.where(wall, reading, depth).astype(np.float32)
    return _Exact(Frame(depth=made, camera=one.frame.camera, source=one.name), wall)


def _noisy(one: _Exact, law: tuple[float, ...], draws: np.random.Generator) -> _Exact:
    """With the sensor's noise on the wall."""
    depth = np.asarray(one.frame.depth, np.float64)
    floor, constant, linear, quadratic, factor, power = law
    sigma = np.maximum(floor, constant + linear * depth + quadratic * depth**2 + factor * depth**power)
    noise = np.where(one.wall, sigma * draws.standard_normal(depth.shape), 0.0)
    return replace(one, frame=replace(one.frame, depth=(depth + noise).astype(np.float32)))


def _solved(frames: Sequence[_Exact], asked: Asked) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Pose and its deviations from all frames; None where they give no answer."""
    start, seen = None, []
    for one in frames:
        estimate = replace(asked, depth_unit=None).located(one.frame, start)
        start = start or (estimate if estimate.ok else None)
        if estimate.ok:
            seen.append(estimate)
    found = calibrated(seen, asked) if seen else None
    if found is None or found.pose is None or found.covariance is None:
        return None
    pose = np.array([getattr(found.pose, name) for name in POSE])
    return pose, np.sqrt(np.diag(found.covariance))
