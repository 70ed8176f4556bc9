"""Frames of a sensor whose depth error is unknown, looked at again from what they have in common.

A frame's equations hold near the place where they were made. Where the bias has to be told together with the wall, the
frame leaves a valley open, and the valley is bent: offset and quadratic error against size, place and tilt. Where the
straight lines through far ends of bent valleys cross is not where the valleys do. Each frame keeps some of its rays,
and in the readings that walls predict on them its valley is straight (`_core.surface_seen_from`); so its equations are
carried to the frames' common answer, which thereby is the minimum of the sum of the bent valleys.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.fusion.solve import BIAS, Stack, fuse, solved_by_frame
from siloscope.parameters import SIZE
from siloscope.types.frame_factor import Matrix, SummedFactor, Vector

DEPTH_BIAS = slice(BIAS, BIAS + 3)

ROUNDS = 10
"""Most times that the frames are carried to a new common answer."""

SOME = 48
"""So many of the frames, evenly among them, tell the common answer well enough to make equations about it."""

SETTLED = 0.05
"""The answer has settled where it changes by less than this share of its standard deviation."""

STEPS = 2
"""Newton steps of a frame to where it stands with a given bias."""

LARGEST_CHANGE = 10.0
"""Most that the logarithm of the determinant of a frame's information may change; else the frame is left as it is."""


def bias_is_free(stack: Stack) -> bool:
    """Whether a frame had to tell the depth bias itself."""
    return bool(stack.free[:, DEPTH_BIAS].any())


def at_bias(stack: Stack, common: Vector) -> Stack:
    """The frames with equations about where each of them stands with the bias of the `common` answer (12,)."""
    return _carried(stack, _with_bias(stack, common[DEPTH_BIAS]))


def straightened(stack: Stack, earlier: SummedFactor | None = None) -> Stack:
    """The frames with equations about their common answer; as they are where the sensor's bias is known."""
    if not bias_is_free(stack):
        return stack
    some = stack.take(np.unique(np.linspace(0, stack.count - 1, SOME).round().astype(np.intp)))
    common = _common(some, earlier)
    return _carried(stack, np.where(np.isfinite(common), common, _own(stack)))


def _common(stack: Stack, earlier: SummedFactor | None) -> Vector:
    """The answer about which the frames' equations give the same answer again."""
    found = fuse(stack, earlier)
    found = fuse(at_bias(stack, found.parameters), earlier)
    for _ in range(ROUNDS):
        place = np.where(np.isfinite(found.parameters), found.parameters, _own(stack))
        before, found = found, fuse(_carried(stack, place), earlier)
        change = np.abs(found.parameters - before.parameters)
        if (np.nan_to_num(change) <= SETTLED * np.sqrt(np.diag(found.covariance))).all():
            break
    return found.parameters


def _own(stack: Stack) -> Matrix:
    """The frames' answers (N, 12), and what was taken for granted."""
    return np.where(stack.seen, stack.answers, stack.base)


def _with_bias(stack: Stack, bias: Vector) -> Matrix:
    """Where each frame stands (N, 12) with a given bias."""
    free = stack.free.copy()
    free[:, DEPTH_BIAS] = False
    place = _own(stack)
    place[:, DEPTH_BIAS] = bias
    for _ in range(STEPS):
        information, gradient, _ = _seen_from(stack, place)
        place = place + _newton(stack, place, information, gradient, free)
    return place


def _carried(stack: Stack, place: Matrix) -> Stack:
    """The frames with equations made anew, each at its row of `place` (N, 12)."""
    information, gradient, turn = _seen_from(stack, place)
    step = _newton(stack, place, information, gradient, stack.free)
    change = _volume(stack, information) - _volume(stack, stack.information)
    usable = np.isfinite(np.where(stack.seen, place + step, 0.0)).all(axis=1) & (np.abs(change) < LARGEST_CHANGE)
    anew = {
        "answers": np.where(stack.seen, place + step, np.nan),
        "information": information,
        "gradient": gradient + np.einsum("nij,nj->ni", information, step),
        **{name: _turned(getattr(stack, name), turn) for name in ("noise", "shared", "scatter")},
    }
    return stack.replaced(usable, anew)


def _seen_from(stack: Stack, place: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """Information and gradient of the frames at `place`, and what turned them."""
    step, turn = _core.surface_seen_from(stack.base, stack.rays, stack.free, place)
    from_answer = step + np.nan_to_num(stack.base - stack.answers)
    gradient = stack.gradient + np.einsum("nij,nj->ni", stack.information, from_answer)
    return _turned(stack.information, turn), np.einsum("nji,nj->ni", turn, gradient), turn


def _turned(matrices: Matrix, turn: Matrix) -> Matrix:
    turned: Matrix = np.swapaxes(turn, 1, 2) @ matrices @ turn
    return turned


def _newton(stack: Stack, place: Matrix, information: Matrix, gradient: Matrix, free: NDArray[np.bool_]) -> Matrix:
    """Steps (N, 12) from `place` to the frames' own answers in the `free` parameters."""
    pull = gradient + stack.prior * np.nan_to_num(place - stack.expected)
    return -solved_by_frame(_system(stack, information, free), np.where(free, pull, 0.0)[:, :, None])[:, :, 0]


def _system(stack: Stack, information: Matrix, free: NDArray[np.bool_]) -> Matrix:
    both = free[:, :, None] & free[:, None, :]
    prior = np.einsum("ni,ij->nij", np.where(free, stack.prior, 1.0), np.eye(SIZE))
    system: Matrix = np.where(both, information, 0.0) + prior
    return system


def _volume(stack: Stack, information: Matrix) -> Vector:
    """Logarithm of the determinant of a frame's information and the priors; NaN or infinite where that can't be."""
    system = _system(stack, information, stack.free)
    scale = 1.0 / np.sqrt(np.maximum(np.einsum("nii->ni", system), 1e-300))
    scaled = np.linalg.slogdet(system * scale[:, :, None] * scale[:, None, :])[1]
    volume: Vector = scaled - 2.0 * np.log(scale).sum(axis=1)
    return volume
