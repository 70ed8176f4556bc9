"""What could be wrong, as families of patterns that the wall's residuals would have then.

Each pattern is what a reading would be off by on every tile. A family is tested by its score: the sum of squares that
its patterns take off the residuals of the ideal vessel once everything that is free there is fitted. The variances are
those that the sensor's noise states, or larger where the same patterns scatter more from frame to frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray

from siloscope.types.wall import COLUMNS
from siloscope.validation.ideal import Ideal
from siloscope.validation.significance import deviation
from siloscope.validation.tiles import Tiles

Vector = NDArray[np.float64]

DEGREE = 5
"""Degree of the patterns over the image: changes over a fifth of it and more."""

DEPENDENT = 1e-7
"""A pattern of which less than this fraction is its own is the others'."""

UNKNOWN_BEFORE = 0.02
"""A prior of which frames take less than this fraction can't be contradicted by them."""

FORM = {"rings": (0, 8), "bend": (8, 16), "oval": (16, 24), "sheets": (24, 36)}
"""Columns of the cylinder's form by group."""


@dataclass(frozen=True, eq=False)
class Score:
    """A family's test."""

    squares: float
    """Sum of squares that its patterns explain, in stated variances."""
    dof: int
    scale: float
    """Scatter from frame to frame in these patterns over what is stated."""
    deviation: float
    """How rare that is, as the equally rare deviation of a normal variable."""
    unsteady: float
    """How rare the scatter from frame to frame is, likewise."""
    amplitudes: Vector
    """(K,) of the patterns."""
    std: Vector
    off: Vector
    """(N,) what they explain on the tiles, metres along the rays."""

    def evidence(self, tiles: int, scale: float) -> float:
        """By how much the family explains the residuals better than nothing does (BIC), in squares over a scale."""
        return self.squares / scale - self.dof * math.log(max(tiles, 2))


def over_image(ray: Vector, reach: Vector, degree: int = DEGREE) -> Vector:
    """Products of Legendre polynomials over the image, (N, 20); `reach` (2,) is the largest ray across and down."""
    u, v = (legvander(np.clip(ray[:, k] / reach[k], -1.0, 1.0), degree) for k in range(2))
    pairs = [(a, b) for a in range(degree + 1) for b in range(degree + 1 - a) if a + b > 0]
    return np.column_stack([u[:, a] * v[:, b] for a, b in pairs])


def reach_of(ray: Vector) -> Vector:
    """Largest rays (2,) across and down."""
    reach: Vector = np.abs(ray).max(axis=0, initial=1e-6)
    return reach


def detours(tiles: Tiles) -> Vector:
    """Light that goes round, (N, 2): more of the depth at grazing incidence, and deep in the vessel."""
    cosine = tiles.across / np.sqrt(1.0 + (tiles.ray**2).sum(axis=1))
    deep = np.clip(tiles.height / max(float(np.quantile(tiles.height, 0.99)), 0.1), 0.0, 1.0) ** 2
    return np.column_stack([tiles.depth * (1.0 - cosine), tiles.depth * deep])


def patterns(ideal: Ideal) -> dict[str, Vector]:
    """The families' patterns, (N, K) each; without those of what is free in the ideal vessel."""
    tiles, form = ideal.tiles, COLUMNS["cylinder_form"].start
    found = {name: tiles.jacobian[:, form + first : form + end] for name, (first, end) in FORM.items()}
    found["cone"] = tiles.jacobian[:, COLUMNS["cone_form"]]
    found["image"] = over_image(tiles.ray, reach_of(tiles.ray)) * tiles.depth[:, None]
    found["multipath"] = detours(tiles)
    if not set(range(COLUMNS["camera"].start, COLUMNS["camera"].stop)) & set(ideal.free.tolist()):
        found["camera"] = tiles.jacobian[:, COLUMNS["camera"]]
    return found


def scores(ideal: Ideal) -> dict[str, Score]:
    """The tests of all families."""
    found = {name: score(ideal, basis) for name, basis in patterns(ideal).items()}
    if "camera" not in found:
        found["camera"] = pull(ideal, COLUMNS["camera"])
    found["bias"] = pull(ideal, COLUMNS["bias"])
    found["diameter"] = pull(ideal, COLUMNS["radius"])
    return found


def score(ideal: Ideal, basis: Vector) -> Score:
    """The test of one family, of patterns (N, K)."""
    tiles = ideal.tiles
    weight = 1.0 / np.sqrt(tiles.variance)
    own, rows = basis * weight[:, None], tiles.jacobian[:, ideal.free] * weight[:, None]
    size = np.sqrt((own**2).sum(axis=0))
    size = np.where(size > 0.0, size, 1.0)
    own = own / size
    mixed = own.T @ rows
    inverse, dof = own_part(own.T @ own - mixed @ ideal.covariance @ mixed.T)
    towards = own.T @ (tiles.residual * weight)
    amplitudes = inverse @ towards
    squares = float(towards @ amplitudes)
    scatter, scatter_dof = _scatter(tiles, own)
    explained = own @ amplitudes - rows @ (ideal.covariance @ (mixed.T @ amplitudes))
    return Score(
        squares,
        dof,
        scatter,
        deviation(squares, dof, max(scatter, 1.0), scatter_dof or math.inf),
        deviation(scatter * scatter_dof, scatter_dof),
        amplitudes / size,
        np.sqrt(np.maximum(np.diag(inverse), 0.0)) / size,
        explained / weight,
    )


def pull(ideal: Ideal, columns: slice) -> Score:
    """How far frames pull what was known before, against what it and they leave open.

    An estimate x with the prior variance P and the posterior variance C differs from the prior's mean by P − C.
    """
    known_before = ideal.prior_information[ideal.free] > 0.0
    chosen = np.flatnonzero((ideal.free >= columns.start) & (ideal.free < columns.stop) & known_before)
    amplitudes, std = np.zeros((2, columns.stop - columns.start))
    if not len(chosen):
        return Score(0.0, 0, 1.0, 0.0, 0.0, amplitudes, std, np.zeros(len(ideal.tiles)))
    all_columns = ideal.free[chosen]
    prior = 1.0 / np.sqrt(ideal.prior_information[all_columns])
    covariance = ideal.covariance[np.ix_(chosen, chosen)]
    moved = (ideal.wall.state - ideal.prior_mean)[all_columns]
    values, vectors = np.linalg.eigh(np.eye(len(chosen)) - covariance / prior / prior[:, None])
    known = values > UNKNOWN_BEFORE
    along = vectors[:, known].T @ (moved / prior)
    squares, dof = float((along**2 / values[known]).sum()), int(known.sum())
    amplitudes[all_columns - columns.start] = moved
    std[all_columns - columns.start] = np.sqrt(np.diag(covariance))
    shown = ideal.tiles.jacobian[:, all_columns] @ -moved
    return Score(squares, dof, 1.0, deviation(squares, dof), 0.0, -amplitudes, std, shown)


def own_part(information: Vector) -> tuple[Vector, int]:
    """Inverse on the patterns that say something of their own, and how many these are."""
    values, vectors = np.linalg.eigh(0.5 * (information + information.T))
    known = values > DEPENDENT
    inverse: Vector = (vectors[:, known] / values[known]) @ vectors[:, known].T
    return inverse, int(known.sum())


def _scatter(tiles: Tiles, own: Vector) -> tuple[float, float]:
    """Scatter of the patterns' amplitudes from frame to frame over what is stated, and its degrees of freedom."""
    if not len(tiles):
        return 1.0, 0.0
    place = tiles.place
    weight = 1.0 / tiles.variance
    total = np.bincount(place, weight)
    mean = np.bincount(place, weight * tiles.residual) / np.maximum(total, 1e-300)
    rest = (tiles.residual - mean[place]) * np.sqrt(weight)
    fraction = 1.0 - weight / total[place]
    squares, dof = 0.0, 0
    for number in np.unique(tiles.frame):
        here = (tiles.frame == number) & (fraction > 1e-9)
        rows = own[here]
        inverse, rank = own_part((rows * fraction[here, None]).T @ rows)
        towards = rows.T @ rest[here]
        squares += float(towards @ inverse @ towards)
        dof += rank
    return (squares / dof, float(dof)) if dof else (1.0, 0.0)
