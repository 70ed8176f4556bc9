"""Relinearises frame factors at the frames' common answer, for a sensor whose depth bias is unknown.

A frame's equations hold near their linearization point. A frame that estimates the depth bias together with the wall
has a likelihood with a bent valley: offset and quadratic error against radius, position and tilt. Two bent valleys do
not meet where the straight lines through their far ends meet. Each frame keeps some of its rays. In the readings that
walls predict on these rays the valley is straight (`_core.map_increment`). So the equations are mapped to the
frames' common answer, which then is the minimum of the sum of the bent valleys.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.fusion.factors import BIAS, FrameFactors
from siloscope.fusion.solve import fuse, solved_by_frame
from siloscope.parameters import SIZE
from siloscope.types.frame_factor import Matrix, SummedFactor, Vector

DEPTH_BIAS = slice(BIAS, BIAS + 3)

MAX_ROUNDS = 10
"""Largest number of relinearisations."""

SAMPLED_FRAMES = 48
"""Number of frames, evenly spaced, from which the common answer is found; enough for a linearization point."""

CONVERGENCE_TOL = 0.05
"""Change of the answer, in its standard deviations, below which it has converged."""

STEPS = 2
"""Newton steps that move a frame to its answer at a given bias."""

LARGEST_CHANGE = 10.0
"""Most that the logarithm of the determinant of a frame's information may change; else the frame is left as it is."""


def bias_is_free(factors: FrameFactors) -> bool:
    """Whether a frame had to estimate the depth bias."""
    return bool(factors.free[:, DEPTH_BIAS].any())


def at_bias(factors: FrameFactors, common: Vector) -> FrameFactors:
    """The frames, each linearised at its own answer with the bias of the `common` answer (12,)."""
    return _relinearized_at(factors, _with_bias(factors, common[DEPTH_BIAS]))


def relinearized(factors: FrameFactors, earlier: SummedFactor | None = None) -> FrameFactors:
    """The frames, linearised at their common answer; unchanged if the sensor's bias is known."""
    if not bias_is_free(factors):
        return factors
    some = factors.take(np.unique(np.linspace(0, factors.count - 1, SAMPLED_FRAMES).round().astype(np.intp)))
    common = _common(some, earlier)
    return _relinearized_at(factors, np.where(np.isfinite(common), common, _own(factors)))


def _common(factors: FrameFactors, earlier: SummedFactor | None) -> Vector:
    """The fixed point: the answer at which the frames' equations give the same answer again."""
    found = fuse(factors, earlier)
    found = fuse(at_bias(factors, found.parameters), earlier)
    for _ in range(MAX_ROUNDS):
        place = np.where(np.isfinite(found.parameters), found.parameters, _own(factors))
        before, found = found, fuse(_relinearized_at(factors, place), earlier)
        change = np.abs(found.parameters - before.parameters)
        if (np.nan_to_num(change) <= CONVERGENCE_TOL * np.sqrt(np.diag(found.covariance))).all():
            break
    return found.parameters


def _own(factors: FrameFactors) -> Matrix:
    """The frames' answers (N, 12); fixed parameters at their given values."""
    return np.where(factors.seen, factors.answers, factors.linearization_point)


def _with_bias(factors: FrameFactors, bias: Vector) -> Matrix:
    """Each frame's answer (N, 12) at a given bias."""
    free = factors.free.copy()
    free[:, DEPTH_BIAS] = False
    place = _own(factors)
    place[:, DEPTH_BIAS] = bias
    for _ in range(STEPS):
        information, gradient, _ = _linearized_at(factors, place)
        place = place + _newton(factors, place, information, gradient, free)
    return place


def _relinearized_at(factors: FrameFactors, place: Matrix) -> FrameFactors:
    """The frames, each linearised at its row of `place` (N, 12)."""
    information, gradient, jacobian = _linearized_at(factors, place)
    step = _newton(factors, place, information, gradient, factors.free)
    change = _log_determinant(factors, information) - _log_determinant(factors, factors.information)
    usable = np.isfinite(np.where(factors.seen, place + step, 0.0)).all(axis=1) & (np.abs(change) < LARGEST_CHANGE)
    anew = {
        "answers": np.where(factors.seen, place + step, np.nan),
        "information": information,
        "gradient": gradient + np.einsum("nij,nj->ni", information, step),
        **{name: _congruent(getattr(factors, name), jacobian) for name in ("noise", "shared", "scatter")},
    }
    return factors.replaced(usable, anew)


def _linearized_at(factors: FrameFactors, place: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """Information and gradient of the frames at `place`, and the Jacobian of the parameter map."""
    found = _core.map_increment(factors.linearization_point, factors.rays, factors.free, place)
    step, jacobian = found.step, found.jacobian
    from_answer = step + np.nan_to_num(factors.linearization_point - factors.answers)
    gradient = factors.gradient + np.einsum("nij,nj->ni", factors.information, from_answer)
    return _congruent(factors.information, jacobian), np.einsum("nji,nj->ni", jacobian, gradient), jacobian


def _congruent(matrices: Matrix, jacobian: Matrix) -> Matrix:
    turned: Matrix = np.swapaxes(jacobian, 1, 2) @ matrices @ jacobian
    return turned


def _newton(
    factors: FrameFactors, place: Matrix, information: Matrix, gradient: Matrix, free: NDArray[np.bool_]
) -> Matrix:
    """Steps (N, 12) from `place` to the frames' own answers in the `free` parameters."""
    pull = gradient + factors.prior * np.nan_to_num(place - factors.expected)
    return -solved_by_frame(_system(factors, information, free), np.where(free, pull, 0.0)[:, :, None])[:, :, 0]


def _system(factors: FrameFactors, information: Matrix, free: NDArray[np.bool_]) -> Matrix:
    both = free[:, :, None] & free[:, None, :]
    prior = np.einsum("ni,ij->nij", np.where(free, factors.prior, 1.0), np.eye(SIZE))
    system: Matrix = np.where(both, information, 0.0) + prior
    return system


def _log_determinant(factors: FrameFactors, information: Matrix) -> Vector:
    """Logarithm of the determinant of a frame's information and the priors; NaN or infinite where that can't be."""
    system = _system(factors, information, factors.free)
    scale = 1.0 / np.sqrt(np.maximum(np.einsum("nii->ni", system), 1e-300))
    scaled = np.linalg.slogdet(system * scale[:, :, None] * scale[:, None, :])[1]
    volume: Vector = scaled - 2.0 * np.log(scale).sum(axis=1)
    return volume
