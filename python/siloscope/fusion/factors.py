"""The factors of several frames as arrays, one frame a row."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from siloscope.parameters import PARAMETERS, SIZE
from siloscope.types.frame_factor import FrameFactor, Matrix, Vector

RADIUS, SCALE, QUADRATIC = (PARAMETERS.index(name) for name in ("radius", "scale", "quadratic"))


BIAS = PARAMETERS.index("offset")
"""From here on a parameter is estimated only where a prior holds it."""


LENGTHS = tuple(PARAMETERS.index(name) for name in ("t_x", "t_y", "radius", "cone_intercept"))
"""Parameters that grow with the depth scale."""


PIECE = 24
"""Frames added up at a time."""


UPPER = np.triu_indices(SIZE)
"""Rows and columns of a symmetric matrix' upper triangle."""


class FrameFactors:
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
        self.linearization_point = _stacked([f.linearization_point for f in frames], (SIZE,))
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

    def take(self, which: NDArray[np.bool_] | NDArray[np.intp] | slice) -> FrameFactors:
        """Some of the frames; what is computed once for all of them is not taken along."""
        part = object.__new__(FrameFactors)
        for name, value in self.__dict__.items():
            if name not in FrameFactors.__dict__:
                part.__dict__[name] = value[which] if isinstance(value, np.ndarray) else value
        part.count = len(part.answers)
        return part

    def replaced(self, which: NDArray[np.bool_], anew: dict[str, NDArray[np.float64]]) -> FrameFactors:
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
