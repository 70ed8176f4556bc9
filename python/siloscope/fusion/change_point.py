"""Has the camera moved? A robust change-point test on a sequence of frames."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from siloscope.fusion.factors import BIAS, RADIUS, SCALE, FrameFactors
from siloscope.fusion.solve import MAX_SIGMAS, Fused, deviation, fuse, least_trimmed_squares, summed
from siloscope.parameters import SIZE
from siloscope.types.frame_factor import SummedFactor
from siloscope.types.move import Move

MIN_FRAMES = 3
"""A move needs this many agreeing frames on both sides; fewer are bad frames."""

CHI2_MOVE = 50.0
"""Least squared distance between the poses before and after, for 4 degrees of freedom (chance: 4e-10)."""

MIN_TURN = 5e-4
"""Smallest reported turn, rad."""

MIN_SHIFT = 1e-3
"""Smallest reported shift, m."""

FEW_STARTS = 4
"""Starts of the robust fits while looking for the place."""

PLACES = 16
"""Places tried in one round of the search."""

MOVING = (0, 1, 2, 3, 6, 10, 11)
"""Parameters that a move changes: the pose, the cone's intercept, which is counted from the camera's height, and the
ovality's azimuth, which is counted from the camera."""

STAYING = (4, 5, 7, 8, 9)
"""Parameters that it does not: radius, cone slope, depth bias."""


def find_moves(factors: FrameFactors, earlier: SummedFactor | None = None, first: int = 0) -> list[Move]:
    """All moves in the sequence, in order; `earlier` frames stand before it."""
    known = 0 if earlier is None else earlier.frames
    if factors.count < MIN_FRAMES or known + factors.count < 2 * MIN_FRAMES:
        return []
    split = _best_split(factors, earlier)
    move = None if split is None else _judged(factors, earlier, split, first)
    if move is None:
        return []
    place = move.index - first
    before, after = factors.take(slice(0, place)), factors.take(slice(place, None))
    return [*find_moves(before, earlier, first), move, *find_moves(after, None, move.index)]


def may_have_moved(fused: Fused) -> bool:
    """Whether as many frames as a move needs were left out one after the other."""
    left_out = fused.weights < 0.5
    return any(left_out[first : first + MIN_FRAMES].all() for first in range(len(left_out) - MIN_FRAMES + 1))


def _best_split(factors: FrameFactors, earlier: SummedFactor | None) -> int | None:
    """Where cutting the sequence in two leaves the smallest robust misfit; coarse to fine."""
    least = MIN_FRAMES if earlier is None or earlier.frames < MIN_FRAMES else 0
    low, high = least, factors.count - MIN_FRAMES
    if high < low:
        return None
    while True:
        places = np.unique(np.linspace(low, high, PLACES).round().astype(int))
        costs = _misfits(factors, places, True, earlier) + _misfits(factors, places, False, None)
        best = int(places[costs.argmin()])
        step = int(np.diff(places).max()) if len(places) > 1 else 1
        if step <= 1:
            return best
        low, high = max(least, best - step), min(factors.count - MIN_FRAMES, best + step)


def _misfits(
    factors: FrameFactors, places: NDArray[np.int_], before: bool, base: SummedFactor | None
) -> NDArray[np.float64]:
    """Robust misfit of the frames before or after each place about their own answer."""
    first = np.zeros_like(places) if before else places
    last = places if before else np.full_like(places, factors.count)
    number = np.arange(factors.count)
    members = (number >= first[:, None]) & (number < last[:, None])
    starts = np.linspace(first, np.maximum(last - 1, first), FEW_STARTS, axis=1).round().astype(np.intp)
    centres = least_trimmed_squares(
        factors, members, np.minimum(starts, factors.count - 1), base or SummedFactor.nothing()
    )
    off = np.clip(deviation(factors.distances(centres), factors.dof), 0.0, MAX_SIGMAS)
    misfits: NDArray[np.float64] = np.where(members, off**2, 0.0).sum(axis=1)
    return misfits


def _judged(factors: FrameFactors, earlier: SummedFactor | None, split: int, first: int) -> Move | None:
    """The move at a place, if both sides agree within themselves and not with each other."""
    before, after = factors.take(slice(0, split)), factors.take(slice(split, None))
    sides = [fuse(before, earlier) if before.count else None, fuse(after)]
    counts = [_agreeing(sides[0], earlier), _agreeing(sides[1], None)]
    if min(counts) < MIN_FRAMES:
        return None
    totals = [_side(before, sides[0], earlier), _side(after, sides[1], None)]
    step, distance = _contrast(totals, max(side.excess for side in sides if side is not None))
    turn, shift = float(np.hypot(*step[:2])), float(np.hypot(*step[2:4]))
    worth = turn > MIN_TURN or shift > MIN_SHIFT
    index = first + _placed(factors, split, sides)
    return Move(index, turn, shift, distance) if worth and distance > CHI2_MOVE else None


def _placed(factors: FrameFactors, split: int, sides: list[Fused | None]) -> int:
    """The place, with bad frames beside it on the side whose pose is nearer: they cost the same on both."""
    before, after = sides
    if before is None or after is None:
        return split
    bad = np.concatenate([before.weights, after.weights]) < 0.5
    poses = np.where(np.arange(SIZE) < RADIUS, [before.parameters, after.parameters], np.nan)
    to_before, to_after = factors.distances(poses)
    while split > 0 and bad[split - 1] and to_after[split - 1] < to_before[split - 1]:
        split -= 1
    while split < factors.count and bad[split] and to_before[split] < to_after[split]:
        split += 1
    return split


def _agreeing(side: Fused | None, earlier: SummedFactor | None) -> int:
    known = 0 if earlier is None else earlier.frames
    return known + (0 if side is None else int((side.weights > 0.5).sum()))


def _side(part: FrameFactors, fused: Fused | None, base: SummedFactor | None) -> SummedFactor:
    if fused is None:
        return base or SummedFactor.nothing()
    return summed(part, fused.weights, fused.parameters, base)


def _contrast(sides: list[SummedFactor], excess: float) -> tuple[NDArray[np.float64], float]:
    """Step of the pose between two sides (4,), and its squared distance from none.

    Both sides share radius, cone slope, depth bias and the priors on them: only the pose, and the cone seen from it,
    may differ. So what all frames have in common does not blur the comparison.
    """
    origin = sides[0].origin
    places = [_place(number) for number in range(2)]
    system, spread = np.zeros((_SIZE, _SIZE)), np.zeros((_SIZE, _SIZE))
    pull, held, wanted = np.zeros(_SIZE), np.zeros(_SIZE), np.zeros(_SIZE)
    for side, place in zip(sides, places, strict=True):
        system += place.T @ side.information @ place
        spread += place.T @ (excess * (side.noise + side.weight * side.shared)) @ place
        pull += place.T @ (side.pull + side.information @ (side.origin - origin))
        prior = np.where(_SHARED_PRIOR, side.prior_information, 0.0) @ place
        wanted = np.where(prior > held, (side.prior_mean - origin) @ place, wanted)
        held = np.maximum(held, prior)
    pinned = (np.concatenate([MOVING, MOVING, STAYING]) >= BIAS) & (held == 0.0)
    pinned[-len(STAYING) + STAYING.index(SCALE)] |= held[2 * len(MOVING)] == 0.0  # no radius, no scale
    system, spread = system + np.diag(held), spread + np.diag(held)
    system[pinned] = system[:, pinned] = spread[pinned] = spread[:, pinned] = 0.0
    return _stepped(system, spread, np.where(pinned, 0.0, pull + held * wanted))


_SIZE = 2 * len(MOVING) + len(STAYING)

_SHARED_PRIOR = np.arange(SIZE) >= RADIUS
"""Gravity is a prior on the pose of its own time, and so none on a step of it."""


def _place(side: int) -> NDArray[np.float64]:
    """Which columns of the two sides' common equations a side's parameters are."""
    place = np.zeros((SIZE, _SIZE))
    place[MOVING, np.arange(len(MOVING)) + side * len(MOVING)] = 1.0
    place[STAYING, np.arange(2 * len(MOVING), _SIZE)] = 1.0
    return place


def _stepped(
    system: NDArray[np.float64], spread: NDArray[np.float64], pull: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    scale = np.sqrt(np.diag(system))
    scale[scale == 0.0] = 1.0
    inverse = np.linalg.pinv(system / scale[:, None] / scale[None, :], rcond=1e-12, hermitian=True)
    inverse = inverse / scale[:, None] / scale[None, :]
    difference = np.zeros((4, len(system)))
    difference[:, :4] = -np.eye(4)
    difference[:, len(MOVING) : len(MOVING) + 4] = np.eye(4)
    reading = difference @ inverse
    step = reading @ pull
    covariance = reading @ spread @ reading.T
    return step, float(step @ np.linalg.solve(covariance, step))
