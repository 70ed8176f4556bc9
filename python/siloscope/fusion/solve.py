"""Fuses the frames of one silo by information: robust centre, weights, and a covariance with their common errors.

Notation: frame i has the answer θ_i, its information Λ_i and gradient g_i there (`FrameFactor`), so that its
negative log-likelihood is ``g_i·δ + δᵀ Λ_i δ / 2`` at θ_i + δ. Priors are common to all frames and enter once.
The manual's page on calibration derives every formula.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from siloscope.fusion.factors import BIAS, LENGTHS, PIECE, QUADRATIC, RADIUS, SCALE, FrameFactors
from siloscope.parameters import SIZE
from siloscope.types.frame_factor import Matrix, SummedFactor, Vector

FULL_WEIGHT_SIGMAS = 2.58
"""Deviation up to which a frame has full weight (99 % of a normal variable); beyond √2 times this it has none."""

MAX_SIGMAS = 4.0
"""Deviation at which a frame's cost is cut off."""

STARTS = 12
"""Frames from which the search for the majority's answer starts."""


TYPICAL = np.array([1e-3, 1e-3, 5e-3, 5e-3, 5e-3, 5e-3, 2e-2, 5e-3, 1e-2, 5e-3, 1e-3, 1e-3])
"""Typical deviations of the parameters (rad, m, and those without a unit; the quadratic bias 1/m): what frames share is
compared in these units."""

FRACTIONS = tuple(0.25**k for k in range(11))
"""Weights of the frames against the priors that are tried."""

SAME_SIZE_TOL = 0.01
"""Relative difference up to which sizes of covariances are the same: what the frames say counts fully then."""


@dataclass(frozen=True, eq=False)
class Fused:
    """The frames' common answer: `parameters` (12,), NaN where nobody saw; `covariance` (12, 12), zero there."""

    parameters: Vector
    covariance: Matrix
    solved: NDArray[np.bool_]
    weights: Vector
    """Of each frame, 0 to 1."""
    deviations: Vector
    """Each frame's distance from the answer, as the equally rare deviation of a normal variable."""
    excess: float
    """Variance of the frames' scatter over the variance that they state; at least 1."""
    scale_std: float
    """Standard deviation of the depth scale where nothing determines it; contained in `covariance`."""

    @property
    def disagreeing(self) -> float:
        """Fraction of the frames, 0 to 1, that count less than half."""
        return float((self.weights < 0.5).mean())


def fuse(factors: FrameFactors, earlier: SummedFactor | None = None) -> Fused:
    """Robust fusion: the answer of the majority, then every frame weighed by how well it agrees."""
    base = earlier or SummedFactor.nothing()
    everyone = np.ones((1, factors.count), bool)
    found = _reweighted(
        factors, base, _completed(factors, base, least_trimmed_squares(factors, everyone, _starts(factors), base))
    )
    if (found[1] < 0.5).any():  # half of a few frames may agree by chance where each leaves much open: do all agree?
        other = _reweighted(factors, base, solve(factors, everyone.astype(float), base))
        found = min(found, other, key=lambda answer: _cost(factors, answer[0]))
    return _with_covariance(factors, *found[1:], base)


def _completed(factors: FrameFactors, base: SummedFactor, centre: Matrix) -> Matrix:
    """A majority's answer; where it lacks what others that agree with it have seen, the answer of most of those."""
    lacking = ~np.isfinite(centre[0]) & factors.seen.any(axis=0)
    near = redescending_weight(deviation(factors.distances(centre)[0], factors.dof)) > 0.0
    fuller = near & factors.seen[:, lacking].all(axis=1)
    if not lacking.any() or not fuller.any():
        return centre
    numbers = np.flatnonzero(fuller)
    starts = numbers[np.unique(np.linspace(0, len(numbers) - 1, STARTS).round().astype(np.intp))]
    return least_trimmed_squares(factors, fuller[None], starts, base)


def _cost(factors: FrameFactors, centre: Matrix) -> float:
    """Sum of the squared deviations from an answer, of no frame more than `MAX_SIGMAS`."""
    off = np.clip(deviation(factors.distances(centre)[0], factors.dof), 0.0, MAX_SIGMAS)
    return float((off**2).sum())


def _reweighted(factors: FrameFactors, base: SummedFactor, centre: Matrix) -> tuple[Matrix, Vector, float]:
    """The answer near a first one, with each frame weighed by how well it agrees; the weights, and the excess."""
    weights, excess = np.ones(factors.count), 1.0
    for again in range(30):
        squared, counts = factors.distances(centre)[0], weights > 0.0
        excess = _excess(squared[counts], factors.dof[counts])
        new = redescending_weight(deviation(squared / excess, factors.dof))
        centre = solve(factors, new[None], base)
        settled = again and np.allclose(new, weights, atol=1e-9)  # at first nothing has been weighed yet
        weights = new
        if settled:
            break
    return centre, weights, excess


def solve(factors: FrameFactors, weights: Matrix, base: SummedFactor) -> Matrix:
    """Answers (K, 12) to K weightings (K, N): ``(Σ w Λ + Π)⁻¹ (Σ w (Λ θ - g) + Π μ)``; NaN for what nobody saw."""
    return _answers(*_systems(factors, weights, base))


def _answers(system: Matrix, pull: Matrix, origin: Vector, solved: NDArray[np.bool_]) -> Matrix:
    """Solutions (K, 12) of normal equations; NaN for what they don't determine, but for a bias, which is expected."""
    answers: Matrix = origin + solved_by_frame(system, pull[:, :, None])[:, :, 0]
    answers[:, :BIAS][~solved[:, :BIAS]] = np.nan
    return answers


def least_trimmed_squares(
    factors: FrameFactors, members: NDArray[np.bool_], starts: NDArray[np.intp], base: SummedFactor
) -> Matrix:
    """Least trimmed squares for K groups of frames: the answers (K, 12) about which half of a group lie closest.

    `members` (K, N) are the groups, `starts` (S,) or (K, S) the frames from which the search starts.
    """
    if base.weight > factors.count:
        return solve(factors, members.astype(float), base)
    groups, tries = len(members), np.broadcast_to(starts, (len(members), np.shape(starts)[-1]))
    within = np.repeat(members, tries.shape[1], axis=0)
    centres = factors.answers[tries.ravel()]
    half = np.where(within.sum(axis=1) > 2, within.sum(axis=1) // 2 + 1, within.sum(axis=1))
    for _ in range(4):
        centres = solve(factors, _closest(factors, centres, within, half)[0], base)
    cost = _closest(factors, centres, within, half)[1].reshape(groups, -1)
    best: Matrix = centres.reshape(groups, -1, SIZE)[np.arange(groups), cost.argmin(axis=1)]
    return best


def _closest(
    factors: FrameFactors, centres: Matrix, within: NDArray[np.bool_], half: NDArray[np.int_]
) -> tuple[Matrix, Vector]:
    """Weights (K, N) of the `half` frames closest to each centre (ties too), and the sum of their distances."""
    relative = np.where(within, factors.distances(centres) / np.maximum(factors.dof, 1), np.inf)
    furthest = np.take_along_axis(np.sort(relative, axis=1), half[:, None] - 1, axis=1)
    chosen = within & (relative <= furthest)
    return chosen.astype(float), np.where(chosen, relative, 0.0).sum(axis=1)


def summed(factors: FrameFactors, weights: Vector, origin: Vector, base: SummedFactor | None = None) -> SummedFactor:
    """The frames added up, for a later continuation without their own factors."""
    start = base or SummedFactor.nothing()
    origin = np.nan_to_num(origin)
    information, pull = _added(factors, weights[None], origin)
    prior, mean = prior_of(factors, weights[None], start)
    return SummedFactor(
        origin,
        information[0] + start.information,
        pull[0] + start.pull + start.information @ (start.origin - origin),
        np.einsum("n,nij->ij", weights**2, factors.noise) + start.noise,
        _in_common(factors, weights, start) / max(float(weights.sum()) + start.weight, 1e-300),
        float(weights.sum()) + start.weight,
        factors.count + start.frames,
        prior,
        mean[0],
    )


def _in_common(factors: FrameFactors, weights: Vector, base: SummedFactor) -> Matrix:
    """Upper bound (12, 12) of the covariance of the frames' summed common errors, for any correlation between them.

    For parts ``b`` with covariances E, ``(Σ b)(Σ b)ᵀ ≤ Σ E/α`` for any fractions α > 0 of 1 (Cauchy and Schwarz).
    Fractions as large as the parts themselves keep a few vague frames from standing for all.
    """
    sizes = weights * np.sqrt(np.einsum("nii,i->n", factors.shared, TYPICAL**2))
    earlier = base.weight * base.shared
    before = float(np.sqrt(np.einsum("ii,i", earlier, TYPICAL**2)))
    ratios = np.divide(weights**2, sizes, out=np.zeros_like(sizes), where=sizes > 0.0)
    total: Matrix = (before + sizes.sum()) * (
        np.einsum("n,nij->ij", ratios, factors.shared) + earlier / (before or 1.0)
    )
    return total


def deviation(squared: Vector, dof: NDArray[np.int_]) -> Vector:
    """Standard normal deviate that is as rare as these chi-squares (Wilson and Hilferty's cube root)."""
    k = np.maximum(dof, 1)
    deviate: Vector = (np.cbrt(squared / k) - (1.0 - 2.0 / (9.0 * k))) / np.sqrt(2.0 / (9.0 * k))
    return deviate


def redescending_weight(deviations: Vector) -> Vector:
    """Weight of frames by their deviation."""
    return np.clip(2.0 - (np.maximum(deviations, 0.0) / FULL_WEIGHT_SIGMAS) ** 2, 0.0, 1.0)


def prior_of(factors: FrameFactors, weights: Matrix, base: SummedFactor) -> tuple[Vector, Matrix]:
    """The priors, once for all frames: information (12,), and mean (K, 12) for K weightings.

    Frames may state different means where each has its own accelerometer reading.
    """
    held = (factors.prior > 0.0).astype(float)
    information = np.maximum(factors.prior.max(axis=0, initial=0.0), base.prior_information)
    total, count = weights @ (held * np.nan_to_num(factors.expected)), weights @ held
    mean = np.where(count > 0.0, total / np.maximum(count, 1e-300), base.prior_mean)
    return information, mean


def _starts(factors: FrameFactors) -> NDArray[np.intp]:
    """Frames of every quality, chosen without regard to their order."""
    order = np.argsort(np.einsum("nii->n", factors.metric[:, :4, :4]))[::-1]
    return order[np.unique(np.linspace(0, factors.count - 1, STARTS).round().astype(np.intp))]


def _excess(squared: Vector, dof: NDArray[np.int_]) -> float:
    """Median of the squared distances over the median that chi-square has; at least 1."""
    if len(squared) < 2:
        return 1.0
    k = np.maximum(dof, 1)
    return max(1.0, float(np.median(squared / (k * (1.0 - 2.0 / (9.0 * k)) ** 3))))


def _added(factors: FrameFactors, weights: Matrix, origin: Vector) -> tuple[Matrix, Matrix]:
    """``Σ w Λ`` (K, 12, 12) and ``Σ w (Λ (θ - origin) - g)`` (K, 12)."""
    total = _product(weights, factors.equations)
    information = total[:, : SIZE * SIZE].reshape(-1, SIZE, SIZE)
    return information, total[:, SIZE * SIZE :] + information @ (factors.middle - origin)


def _product(weights: Matrix, rows: Matrix) -> Matrix:
    """``weights @ rows`` in pieces too small to be spread over threads, which take longer to wake than to work."""
    pieces = [slice(first, first + PIECE) for first in range(0, rows.shape[0], PIECE)]
    total: Matrix = sum((weights[:, piece] @ rows[piece] for piece in pieces), np.zeros((len(weights), rows.shape[1])))
    return total


def _systems(
    factors: FrameFactors, weights: Matrix, base: SummedFactor, fraction: float = 1.0
) -> tuple[Matrix, Matrix, Vector, NDArray[np.bool_]]:
    """Normal equations about an origin, and which parameters they determine; the others stay at the origin.

    The frames count by `fraction` against the priors.
    """
    origin = _origin(factors, base)
    information, pull = _added(factors, weights, origin)
    information = fraction * (information + base.information)
    pull = fraction * (pull + base.pull + base.information @ (base.origin - origin))
    prior, mean = prior_of(factors, weights, base)
    solved = np.einsum("kii->ki", information) > 0.0
    solved[:, BIAS:] &= prior[BIAS:] > 0.0
    solved[:, SCALE] &= solved[:, RADIUS] & (prior[RADIUS] > 0.0)
    both = solved[:, :, None] & solved[:, None, :]
    held = np.where(solved, prior, 1.0)
    system = np.where(both, information, 0.0) + held[:, :, None] * np.eye(SIZE)
    return system, np.where(solved, pull + prior * (mean - origin), 0.0), origin, solved


def _origin(factors: FrameFactors, base: SummedFactor) -> Vector:
    """A point near the answer, so that sums about it keep their digits."""
    return np.where(factors.seen.any(axis=0), factors.middle, base.origin)


def _with_covariance(factors: FrameFactors, weights: Vector, excess: float, base: SummedFactor) -> Fused:
    """The answer with the smallest covariance of the pose over all weights of the frames against the priors.

    The frames' information contains their noise alone. If their common errors are larger, the frames would override the
    priors. Any weight gives an answer with a true covariance; the weight with the smallest covariance is taken.
    """
    origin = _origin(factors, base)
    total = summed(factors, weights, origin, base)
    spread = excess * (total.noise + total.weight * total.shared)
    fractions = FRACTIONS if total.weight > 1.0 else FRACTIONS[:1]  # one frame's answer is its own
    found = [_sandwich(factors, weights, base, fraction, spread) for fraction in fractions]
    sizes = np.array([(np.diag(covariance)[:4] / TYPICAL[:4] ** 2).sum() for _, covariance, _ in found])
    centre, covariance, solved = found[int(np.argmax(sizes <= (1.0 + SAME_SIZE_TOL) * sizes.min()))]
    scale_std = 0.0 if solved[SCALE] else factors.scale_std
    covariance = covariance + _scale_covariance(centre, scale_std)
    deviations = deviation(factors.distances(centre[None])[0] / excess, factors.dof)
    return Fused(centre, covariance, solved, weights, deviations, excess, scale_std)


def _sandwich(
    factors: FrameFactors, weights: Vector, base: SummedFactor, fraction: float, spread: Matrix
) -> tuple[Vector, Matrix, NDArray[np.bool_]]:
    """The answer of a fraction f of what the frames say; its covariance ``P (Π + f² spread) P``; what it determines."""
    equations = _systems(factors, weights[None], base, fraction)
    system, solved = equations[0][0], equations[3][0]
    both = np.diag(prior_of(factors, weights[None], base)[0]) + fraction**2 * spread
    inverse = solved_by_frame(system, np.eye(SIZE))
    return _answers(*equations)[0], inverse @ np.where(solved[:, None] & solved, both, 0.0) @ inverse, solved


def _scale_covariance(centre: Vector, std: float) -> Matrix:
    """Every length of the answer goes with an unknown scale, however many frames there are.

    A measured depth means ``d (1 + scale)``: lengths that are all too long by a fraction mean a scale too small by it.
    """
    gradient = np.zeros(SIZE)
    gradient[list(LENGTHS)] = np.nan_to_num(centre[list(LENGTHS)]) * std
    gradient[SCALE] = -(1.0 + np.nan_to_num(centre[SCALE])) * std
    gradient[QUADRATIC] = -2.0 * np.nan_to_num(centre[QUADRATIC]) * std
    return np.outer(gradient, gradient)


def solved_by_frame(system: Matrix, right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solution of symmetric equations whose unknowns differ by many orders of magnitude."""
    scale = 1.0 / np.sqrt(np.maximum(np.einsum("...ii->...i", system), 1e-300))[..., None]
    scaled = system * scale * np.swapaxes(scale, -1, -2)
    solution: Matrix = scale * np.linalg.solve(scaled + 1e-13 * np.eye(SIZE), right * scale)
    return solution
