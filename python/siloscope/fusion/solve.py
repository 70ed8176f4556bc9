"""Frames of one silo, fused by information: robust centre, weights, and a covariance that contains what they share.

Notation: frame i has the answer θ_i, its information Λ_i and gradient g_i there (`FrameFactor`), so that its
negative log-likelihood is ``g_i·δ + δᵀ Λ_i δ / 2`` at θ_i + δ. Priors are common to all frames and enter once.
The manual's page on calibration derives every formula.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from siloscope.parameters import PARAMETERS, SIZE
from siloscope.types.frame_factor import FrameFactor, Matrix, SummedFactor, Vector

RADIUS, SCALE, QUADRATIC = (PARAMETERS.index(name) for name in ("radius", "scale", "quadratic"))
BIAS = PARAMETERS.index("offset")
"""From here on a parameter is estimated only where a prior holds it."""
LENGTHS = tuple(PARAMETERS.index(name) for name in ("t_x", "t_y", "radius", "cone_intercept"))
"""Parameters that grow with the depth scale."""

AGREE = 2.58
"""A frame counts fully up to this many standard deviations (99 % of a normal variable), not at all beyond √2 times."""

FAR = 4.0
"""A frame further from an answer than so many standard deviations costs no more than that."""

STARTS = 12
"""Frames from which the search for the majority's answer starts."""

PIECE = 24
"""Frames added up at a time."""

TYPICAL = np.array([1e-3, 1e-3, 5e-3, 5e-3, 5e-3, 5e-3, 2e-2, 5e-3, 1e-2, 5e-3, 1e-3, 1e-3])
"""Typical deviations of the parameters (rad, m, and those without a unit; the quadratic bias 1/m): what frames share is
compared in these units."""

SHARES = tuple(0.25**k for k in range(11))
"""By how much less than fully what the frames say may count."""

SAME_SIZE = 0.01
"""Sizes of covariances that differ by no more than this share are the same: what the frames say counts fully then."""

UPPER = np.triu_indices(SIZE)
"""Rows and columns of a symmetric matrix' upper triangle."""


class Stack:
    """Evidence of several frames as arrays, one frame a row."""

    def __init__(self, frames: Sequence[FrameFactor]) -> None:
        self.count = len(frames)
        self.answers = _stacked([f.parameters for f in frames], (SIZE,))
        self.seen = np.isfinite(self.answers)
        self.free = _stacked([f.free for f in frames], (SIZE,)).astype(bool)
        self.information = _stacked([f.information for f in frames], (SIZE, SIZE))
        self.gradient = _stacked([f.gradient for f in frames], (SIZE,))
        self.noise = _stacked([f.noise for f in frames], (SIZE, SIZE))
        self.scatter = _stacked([f.scatter for f in frames], (SIZE, SIZE))
        self.prior = _stacked([f.prior_information for f in frames], (SIZE,))
        self.expected = _stacked([f.prior_mean for f in frames], (SIZE,))
        both = self.free[:, :, None] & self.free[:, None, :]
        self.shared = _positive(np.where(both, self.scatter - self.noise, 0.0))
        self.metric = self._metric()
        self.dof = self.free.sum(axis=1)
        self.scale_std = max((f.scale_std for f in frames), default=0.0)
        self.base = _stacked([f.base for f in frames], (SIZE,))
        self.rays = _padded([f.rays for f in frames])

    def _metric(self) -> Matrix:
        """Inverse covariances ``H (S + Π)⁻¹ H`` of the frames' own answers, H = Λ + Π; zero where not free."""
        both = self.free[:, :, None] & self.free[:, None, :]
        prior = np.einsum("ni,ij->nij", self.prior, np.eye(SIZE))
        joint = np.where(both, self.information + prior, 0.0)
        fixed = np.einsum("ni,ij->nij", ~self.free, np.eye(SIZE))
        spread = np.where(both, self.scatter + prior, 0.0) + fixed
        scale = 1.0 / np.sqrt(np.maximum(np.einsum("nii->ni", spread), 1e-300))
        spread = spread * scale[:, :, None] * scale[:, None, :]
        joint = joint * scale[:, :, None]
        metric: Matrix = np.einsum("nji,njk->nik", joint, np.linalg.solve(spread, joint))
        return 0.5 * (metric + metric.transpose(0, 2, 1))  # solving leaves it symmetric to some digits only

    def take(self, which: NDArray[np.bool_] | NDArray[np.intp] | slice) -> Stack:
        """Some of the frames; what is computed once for all of them is not taken along."""
        part = object.__new__(Stack)
        for name, value in self.__dict__.items():
            if name not in Stack.__dict__:
                part.__dict__[name] = value[which] if isinstance(value, np.ndarray) else value
        part.count = len(part.answers)
        return part

    def replaced(self, which: NDArray[np.bool_], anew: dict[str, NDArray[np.float64]]) -> Stack:
        """The frames `which` (N,) with other arrays."""
        changed = self.take(slice(None))
        for name, value in anew.items():
            keep = which.reshape(-1, *[1] * (value.ndim - 1))
            changed.__dict__[name] = np.where(keep, value, getattr(self, name))
        changed.metric = changed._metric()
        return changed

    def distances(self, centres: Matrix) -> Matrix:
        """Squared distances (K, N) of the frames' answers from K `centres` (K, 12), each in its own covariance."""
        held = self.answers[self.seen[:, SCALE] & ~self.free[:, SCALE], SCALE]
        plain = (centres[:, SCALE, None] == held).all(axis=1)
        lacking = np.where(plain, ~np.isfinite(centres) @ (1 << np.arange(SIZE)), -1)
        squared = np.empty((len(centres), self.count))
        for which in set(lacking.tolist()):
            some = lacking == which
            by = self._distances_by_frame if which < 0 else self._distances_expanded
            squared[some] = by(centres[some])
        return squared

    def _distances_by_frame(self, centres: Matrix) -> Matrix:
        """For centres of another depth scale than frames that take theirs for granted."""
        known = np.isfinite(centres)[:, None, :] & self.seen[None, :, :]
        gaps = np.where(known, self.answers[None, :, :] - centres[:, None, :], 0.0)
        fixed = ~self.free[None, :, SCALE] & known[:, :, SCALE]
        if fixed.any():  # a frame that took the scale for granted answers for its own scale
            shift = np.where(fixed, self.answers[None, :, SCALE] - centres[:, None, SCALE], 0.0)
            lengths = np.nan_to_num(centres)[:, None, list(LENGTHS)] * known[:, :, list(LENGTHS)]
            gaps[:, :, list(LENGTHS)] += shift[:, :, None] * lengths
        of_frame = gaps.transpose(1, 0, 2)
        squared: Matrix = np.einsum("nkj,nkj->kn", of_frame @ self.metric, of_frame)
        return squared

    def _distances_expanded(self, centres: Matrix) -> Matrix:
        """``(θ - c)ᵀ M (θ - c)`` as one product of matrices, multiplied out; all centres lack the same parameters."""
        known = np.isfinite(centres[0])
        of_frames = self._expanded.get(known.tobytes())
        if of_frames is None:
            of_frames = self._expanded[known.tobytes()] = self._multiplied_out(known)
        from_middle = np.where(known, centres - self.middle, 0.0)
        squares = from_middle[:, UPPER[0]] * from_middle[:, UPPER[1]]
        centres = np.hstack([squares, from_middle, np.ones((len(centres), 1))])
        pieces = [centres @ of_frames[:, first : first + PIECE] for first in range(0, self.count, PIECE)]
        return np.maximum(np.hstack(pieces), 0.0)

    def _multiplied_out(self, known: NDArray[np.bool_]) -> Matrix:
        """Each frame's ``M``, ``-2 M θ`` and ``θᵀ M θ`` (91, N) about the middle, of the `known` parameters (12,)."""
        own = np.where(self.seen & known, self.answers - self.middle, 0.0)
        metric = np.where(known[:, None] & known, self.metric, 0.0)
        pull = np.einsum("nij,nj->ni", metric, own)
        rest = np.einsum("ni,ni->n", own, pull)[:, None]
        twice = np.where(UPPER[0] == UPPER[1], 1.0, 2.0)
        upper = metric[:, UPPER[0], UPPER[1]] * twice
        return np.ascontiguousarray(np.hstack([upper, -2.0 * pull, rest]).T)

    @cached_property
    def _expanded(self) -> dict[bytes, Matrix]:
        """What has been multiplied out, by the parameters that are known."""
        return {}

    @cached_property
    def middle(self) -> Vector:
        """Median of the frames' answers (12,); zero for what no frame has seen."""
        if not self.count:
            return np.zeros(SIZE)
        count = self.seen.sum(axis=0)
        middle = np.sort(self.answers, axis=0)[np.minimum(count // 2, self.count - 1), np.arange(SIZE)]
        return np.where(count > 0, middle, 0.0)

    @cached_property
    def equations(self) -> Matrix:
        """``Λ`` and ``Λ (θ - middle) - g`` of each frame, one after the other (N, 156)."""
        gap = np.where(self.seen, self.answers - self.middle, 0.0)
        pulls = np.einsum("nij,nj->ni", self.information, gap) - self.gradient
        return np.hstack([self.information.reshape(-1, SIZE * SIZE), pulls])


@dataclass(frozen=True, eq=False)
class Fused:
    """The frames' common answer: `parameters` (12,), NaN where nobody saw; `covariance` (12, 12), zero there."""

    parameters: Vector
    covariance: Matrix
    solved: NDArray[np.bool_]
    weights: Vector
    """Of each frame, 0 to 1."""
    deviations: Vector
    """Distance of each frame from the answer: as rare as for a normal variable so many standard deviations off."""
    excess: float
    """Scatter of the frames over what they state; 1 where they state enough."""
    scale_std: float
    """Standard deviation of the depth scale that nothing could tell; contained in `covariance`."""

    @property
    def disagreeing(self) -> float:
        """Share of the frames, 0 to 1, that count less than half."""
        return float((self.weights < 0.5).mean())


def fuse(stack: Stack, earlier: SummedFactor | None = None) -> Fused:
    """Robust fusion: the answer of the majority, then every frame weighed by how well it agrees."""
    base = earlier or SummedFactor.nothing()
    everyone = np.ones((1, stack.count), bool)
    found = _reweighted(stack, base, _completed(stack, base, majority(stack, everyone, _starts(stack), base)))
    if (found[1] < 0.5).any():  # half of a few frames may agree by chance where each leaves much open: do all agree?
        other = _reweighted(stack, base, solve(stack, everyone.astype(float), base))
        found = min(found, other, key=lambda answer: _cost(stack, answer[0]))
    return _with_covariance(stack, *found[1:], base)


def _completed(stack: Stack, base: SummedFactor, centre: Matrix) -> Matrix:
    """A majority's answer; where it lacks what others that agree with it have seen, the answer of most of those."""
    lacking = ~np.isfinite(centre[0]) & stack.seen.any(axis=0)
    near = agreement(deviation(stack.distances(centre)[0], stack.dof)) > 0.0
    fuller = near & stack.seen[:, lacking].all(axis=1)
    if not lacking.any() or not fuller.any():
        return centre
    numbers = np.flatnonzero(fuller)
    starts = numbers[np.unique(np.linspace(0, len(numbers) - 1, STARTS).round().astype(np.intp))]
    return majority(stack, fuller[None], starts, base)


def _cost(stack: Stack, centre: Matrix) -> float:
    """Sum of the squared deviations from an answer, of no frame more than `FAR`."""
    off = np.clip(deviation(stack.distances(centre)[0], stack.dof), 0.0, FAR)
    return float((off**2).sum())


def _reweighted(stack: Stack, base: SummedFactor, centre: Matrix) -> tuple[Matrix, Vector, float]:
    """The answer near a first one, with each frame weighed by how well it agrees; the weights, and the excess."""
    weights, excess = np.ones(stack.count), 1.0
    for again in range(30):
        squared, counts = stack.distances(centre)[0], weights > 0.0
        excess = _excess(squared[counts], stack.dof[counts])
        new = agreement(deviation(squared / excess, stack.dof))
        centre = solve(stack, new[None], base)
        settled = again and np.allclose(new, weights, atol=1e-9)  # at first nothing has been weighed yet
        weights = new
        if settled:
            break
    return centre, weights, excess


def solve(stack: Stack, weights: Matrix, base: SummedFactor) -> Matrix:
    """Answers (K, 12) to K weightings (K, N): ``(Σ w Λ + Π)⁻¹ (Σ w (Λ θ - g) + Π μ)``; NaN for what nobody saw."""
    return _answers(*_systems(stack, weights, base))


def _answers(system: Matrix, pull: Matrix, origin: Vector, solved: NDArray[np.bool_]) -> Matrix:
    """Solutions (K, 12) of normal equations; NaN for what they don't determine, but for a bias, which is expected."""
    answers: Matrix = origin + solved_by_frame(system, pull[:, :, None])[:, :, 0]
    answers[:, :BIAS][~solved[:, :BIAS]] = np.nan
    return answers


def majority(stack: Stack, members: NDArray[np.bool_], starts: NDArray[np.intp], base: SummedFactor) -> Matrix:
    """Least trimmed squares for K groups of frames: the answers (K, 12) about which half of a group lie closest.

    `members` (K, N) are the groups, `starts` (S,) or (K, S) the frames from which the search starts.
    """
    if base.weight > stack.count:
        return solve(stack, members.astype(float), base)
    groups, tries = len(members), np.broadcast_to(starts, (len(members), np.shape(starts)[-1]))
    within = np.repeat(members, tries.shape[1], axis=0)
    centres = stack.answers[tries.ravel()]
    half = np.where(within.sum(axis=1) > 2, within.sum(axis=1) // 2 + 1, within.sum(axis=1))
    for _ in range(4):
        centres = solve(stack, _closest(stack, centres, within, half)[0], base)
    cost = _closest(stack, centres, within, half)[1].reshape(groups, -1)
    best: Matrix = centres.reshape(groups, -1, SIZE)[np.arange(groups), cost.argmin(axis=1)]
    return best


def _closest(stack: Stack, centres: Matrix, within: NDArray[np.bool_], half: NDArray[np.int_]) -> tuple[Matrix, Vector]:
    """Weights (K, N) of the `half` frames closest to each centre (ties too), and the sum of their distances."""
    relative = np.where(within, stack.distances(centres) / np.maximum(stack.dof, 1), np.inf)
    furthest = np.take_along_axis(np.sort(relative, axis=1), half[:, None] - 1, axis=1)
    chosen = within & (relative <= furthest)
    return chosen.astype(float), np.where(chosen, relative, 0.0).sum(axis=1)


def sums(stack: Stack, weights: Vector, origin: Vector, base: SummedFactor | None = None) -> SummedFactor:
    """The frames added up, to be gone on with when their own evidence is no longer there."""
    start = base or SummedFactor.nothing()
    origin = np.nan_to_num(origin)
    information, pull = _added(stack, weights[None], origin)
    prior, mean = prior_of(stack, weights[None], start)
    return SummedFactor(
        origin,
        information[0] + start.information,
        pull[0] + start.pull + start.information @ (start.origin - origin),
        np.einsum("n,nij->ij", weights**2, stack.noise) + start.noise,
        _in_common(stack, weights, start) / max(float(weights.sum()) + start.weight, 1e-300),
        float(weights.sum()) + start.weight,
        stack.count + start.frames,
        prior,
        mean[0],
    )


def _in_common(stack: Stack, weights: Vector, base: SummedFactor) -> Matrix:
    """Covariance (12, 12) of what the frames may share, added up, however much of it they do share.

    For parts ``b`` with covariances E, ``(Σ b)(Σ b)ᵀ ≤ Σ E/α`` for any shares α > 0 of 1 (Cauchy and Schwarz). Shares
    as large as the parts themselves keep a few vague frames from standing for all.
    """
    sizes = weights * np.sqrt(np.einsum("nii,i->n", stack.shared, TYPICAL**2))
    earlier = base.weight * base.shared
    before = float(np.sqrt(np.einsum("ii,i", earlier, TYPICAL**2)))
    ratios = np.divide(weights**2, sizes, out=np.zeros_like(sizes), where=sizes > 0.0)
    total: Matrix = (before + sizes.sum()) * (np.einsum("n,nij->ij", ratios, stack.shared) + earlier / (before or 1.0))
    return total


def deviation(squared: Vector, dof: NDArray[np.int_]) -> Vector:
    """Standard normal deviate that is as rare as these chi-squares (Wilson and Hilferty's cube root)."""
    k = np.maximum(dof, 1)
    deviate: Vector = (np.cbrt(squared / k) - (1.0 - 2.0 / (9.0 * k))) / np.sqrt(2.0 / (9.0 * k))
    return deviate


def agreement(deviations: Vector) -> Vector:
    """Weight of frames by their deviation."""
    return np.clip(2.0 - (np.maximum(deviations, 0.0) / AGREE) ** 2, 0.0, 1.0)


def prior_of(stack: Stack, weights: Matrix, base: SummedFactor) -> tuple[Vector, Matrix]:
    """What was known before the frames, once for all of them: information (12,), and mean (K, 12) for K weightings.

    Frames may state different means where each has its own accelerometer reading.
    """
    held = (stack.prior > 0.0).astype(float)
    information = np.maximum(stack.prior.max(axis=0, initial=0.0), base.prior_information)
    total, count = weights @ (held * np.nan_to_num(stack.expected)), weights @ held
    mean = np.where(count > 0.0, total / np.maximum(count, 1e-300), base.prior_mean)
    return information, mean


def _starts(stack: Stack) -> NDArray[np.intp]:
    """Frames of every quality, chosen without regard to their order."""
    order = np.argsort(np.einsum("nii->n", stack.metric[:, :4, :4]))[::-1]
    return order[np.unique(np.linspace(0, stack.count - 1, STARTS).round().astype(np.intp))]


def _excess(squared: Vector, dof: NDArray[np.int_]) -> float:
    """Median of the squared distances over the median that chi-square has; at least 1."""
    if len(squared) < 2:
        return 1.0
    k = np.maximum(dof, 1)
    return max(1.0, float(np.median(squared / (k * (1.0 - 2.0 / (9.0 * k)) ** 3))))


def _added(stack: Stack, weights: Matrix, origin: Vector) -> tuple[Matrix, Matrix]:
    """``Σ w Λ`` (K, 12, 12) and ``Σ w (Λ (θ - origin) - g)`` (K, 12)."""
    total = _product(weights, stack.equations)
    information = total[:, : SIZE * SIZE].reshape(-1, SIZE, SIZE)
    return information, total[:, SIZE * SIZE :] + information @ (stack.middle - origin)


def _product(weights: Matrix, rows: Matrix) -> Matrix:
    """``weights @ rows`` in pieces too small to be spread over threads, which take longer to wake than to work."""
    pieces = [slice(first, first + PIECE) for first in range(0, rows.shape[0], PIECE)]
    total: Matrix = sum((weights[:, piece] @ rows[piece] for piece in pieces), np.zeros((len(weights), rows.shape[1])))
    return total


def _systems(
    stack: Stack, weights: Matrix, base: SummedFactor, share: float = 1.0
) -> tuple[Matrix, Matrix, Vector, NDArray[np.bool_]]:
    """Normal equations about an origin, and which parameters they determine; the others stay at the origin.

    What the frames say counts by its `share` beside what was known before them.
    """
    origin = _origin(stack, base)
    information, pull = _added(stack, weights, origin)
    information = share * (information + base.information)
    pull = share * (pull + base.pull + base.information @ (base.origin - origin))
    prior, mean = prior_of(stack, weights, base)
    solved = np.einsum("kii->ki", information) > 0.0
    solved[:, BIAS:] &= prior[BIAS:] > 0.0
    solved[:, SCALE] &= solved[:, RADIUS] & (prior[RADIUS] > 0.0)
    both = solved[:, :, None] & solved[:, None, :]
    held = np.where(solved, prior, 1.0)
    system = np.where(both, information, 0.0) + held[:, :, None] * np.eye(SIZE)
    return system, np.where(solved, pull + prior * (mean - origin), 0.0), origin, solved


def _origin(stack: Stack, base: SummedFactor) -> Vector:
    """A point near the answer, so that sums about it keep their digits."""
    return np.where(stack.seen.any(axis=0), stack.middle, base.origin)


def _with_covariance(stack: Stack, weights: Vector, excess: float, base: SummedFactor) -> Fused:
    """The answer by which the pose is known best, however much the frames count beside what was known before them.

    Their information is that of their noise alone. Where what they share is larger, they would override what was known
    as if they were sure of it. Any share gives an answer whose covariance is true; the one that is known best is taken.
    """
    origin = _origin(stack, base)
    total = sums(stack, weights, origin, base)
    spread = excess * (total.noise + total.weight * total.shared)
    shares = SHARES if total.weight > 1.0 else SHARES[:1]  # one frame's answer is its own
    found = [_sandwich(stack, weights, base, share, spread) for share in shares]
    sizes = np.array([(np.diag(covariance)[:4] / TYPICAL[:4] ** 2).sum() for _, covariance, _ in found])
    centre, covariance, solved = found[int(np.argmax(sizes <= (1.0 + SAME_SIZE) * sizes.min()))]
    scale_std = 0.0 if solved[SCALE] else stack.scale_std
    covariance = covariance + _scale_share(centre, scale_std)
    deviations = deviation(stack.distances(centre[None])[0] / excess, stack.dof)
    return Fused(centre, covariance, solved, weights, deviations, excess, scale_std)


def _sandwich(
    stack: Stack, weights: Vector, base: SummedFactor, share: float, spread: Matrix
) -> tuple[Vector, Matrix, NDArray[np.bool_]]:
    """The answer of a share of what the frames say; its covariance ``P (Π + share² spread) P``; what it determines."""
    equations = _systems(stack, weights[None], base, share)
    system, solved = equations[0][0], equations[3][0]
    both = np.diag(prior_of(stack, weights[None], base)[0]) + share**2 * spread
    inverse = solved_by_frame(system, np.eye(SIZE))
    return _answers(*equations)[0], inverse @ np.where(solved[:, None] & solved, both, 0.0) @ inverse, solved


def _scale_share(centre: Vector, std: float) -> Matrix:
    """Every length of the answer goes with an unknown scale, however many frames there are.

    A measured depth means ``d (1 + scale)``: where all lengths are too long by a share, the scale is too small by it.
    """
    share = np.zeros(SIZE)
    share[list(LENGTHS)] = np.nan_to_num(centre[list(LENGTHS)]) * std
    share[SCALE] = -(1.0 + np.nan_to_num(centre[SCALE])) * std
    share[QUADRATIC] = -2.0 * np.nan_to_num(centre[QUADRATIC]) * std
    return np.outer(share, share)


def solved_by_frame(system: Matrix, right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solution of symmetric equations whose unknowns differ by many orders of magnitude."""
    scale = 1.0 / np.sqrt(np.maximum(np.einsum("...ii->...i", system), 1e-300))[..., None]
    scaled = system * scale * np.swapaxes(scale, -1, -2)
    solution: Matrix = scale * np.linalg.solve(scaled + 1e-13 * np.eye(SIZE), right * scale)
    return solution


def _positive(matrices: Matrix) -> Matrix:
    """The nearest matrices without negative eigenvalues, in units of their own diagonals."""
    scale = np.sqrt(np.maximum(np.abs(np.einsum("nii->ni", matrices)), 1e-300))
    values, vectors = np.linalg.eigh(matrices / scale[:, :, None] / scale[:, None, :])
    clipped = np.einsum("nij,nj,nkj->nik", vectors, np.maximum(values, 0.0), vectors)
    positive: Matrix = clipped * scale[:, :, None] * scale[:, None, :]
    return positive


def _padded(rays: Sequence[Matrix]) -> Matrix:
    """(N, K, 3) of N times (up to K, 3), filled up with rays that tell nothing."""
    padded = np.zeros((len(rays), max(map(len, rays), default=0), 3))
    for row, own in zip(padded, rays, strict=True):
        row[: len(own)] = own
    return padded


def _stacked(rows: Sequence[NDArray[np.generic]], shape: tuple[int, ...]) -> NDArray[np.float64]:
    return np.asarray(rows, np.float64).reshape(len(rows), *shape)
