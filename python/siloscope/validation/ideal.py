"""The ideal vessel: straight, round, as the camera and the sensor are told to be; fitted to the tiles of many frames.

Everything that a calibration explains by the wall's form is left to the residuals here. What the camera's intrinsics
and the sensor's bias are stated to leave open is free within these deviations, so that it convicts nobody.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from siloscope.estimation.priors import Priors
from siloscope.types.wall import COLUMNS, INTERCEPT, OBLIQUITY, OFFSET, RADIUS, SIZE, SLOPE, Wall
from siloscope.validation.frames import OBLIQUE, SeenFrame
from siloscope.validation.tiles import Tiles, against

Vector = NDArray[np.float64]

TOLERANCE, LEANING = 0.005, 0.4
"""Building tolerance of a cone against its cylinder, and an oblique hopper's obliquity, as in the joint fit."""

SCALE = COLUMNS["bias"].start + 1
SCALE_BY_TAPE = 0.05
"""Where the depth's scale stands, and its deviation where a diameter tells it."""

ROUNDS = 8
"""Most linearisations."""

LONGEST_TURN = 0.05
"""Longest step of an angle, rad."""

UNDETERMINED = 1e-12
"""Eigenvalues of the scaled equations below this are rounding."""

SMALL = 1e-5
"""A step of the pose so small (rad, m) is the last."""


@dataclass(frozen=True, eq=False)
class Ideal:
    """The ideal vessel that fits best, the tiles against it, and what it was fitted with."""

    wall: Wall
    tiles: Tiles
    free: NDArray[np.int64]
    """Columns that were fitted."""
    prior_mean: Vector
    prior_information: Vector
    """(71,) means and inverse variances of what was known before."""
    information: Vector
    """Of the free columns, by tiles and priors."""
    covariance: Vector
    """Its inverse, without what nothing tells."""


def first_wall(frames: Sequence[SeenFrame]) -> Wall:
    """The wall of the frame that shows most of it, without form.

    Its cone only where most frames that see one call it the vessel's own.
    """
    cones = [one for one in frames if one.factor.has_cone]
    trusted = [one for one in cones if one.shows_vessels_cone]
    with_cone = 2 * len(trusted) > len(cones) > 0
    factor = max(trusted if with_cone else frames, key=lambda one: int(one.shown.sum())).factor
    state = np.zeros(SIZE)
    for name in ("pose", "bias", "radius"):
        state[COLUMNS[name]] = factor.state[COLUMNS[name]]
    with_cone |= not factor.has_cylinder
    if with_cone:
        state[SLOPE : SLOPE + 2] = factor.state[SLOPE : SLOPE + 2]
    return referred(Wall(state, bool(factor.has_cylinder), with_cone, float(factor.reference)))


def referred(wall: Wall) -> Wall:
    """With heights told to where cylinder and cone meet."""
    if not (wall.has_cylinder and wall.has_cone):
        return wall
    joint = (wall.state[INTERCEPT] - wall.state[RADIUS]) / max(wall.state[SLOPE], 0.05)
    return Wall(wall.state, True, True, float(np.clip(joint, 0.2, 60.0)))


def prior_of(priors: Priors, wall: Wall, oblique: bool) -> tuple[Vector, Vector, NDArray[np.int64]]:
    """Mean and inverse variance (71,) of what is known before, and the columns that are free."""
    mean, std = np.zeros(SIZE), np.zeros(SIZE)
    std[COLUMNS["pose"]] = np.inf
    mean[COLUMNS["bias"]], std[COLUMNS["bias"]] = priors.profile.bias, priors.profile.bias_std
    if priors.diameter is None:
        std[SCALE] = 0.0  # nothing tells a scale without a length
    elif std[SCALE] > 0.0:
        std[SCALE] = max(std[SCALE], SCALE_BY_TAPE)  # which tells it better than any expectation
    std[COLUMNS["camera"]] = priors.camera_std
    if wall.has_cylinder:
        std[RADIUS] = np.inf
        if priors.diameter is not None:
            mean[RADIUS], std[RADIUS] = priors.diameter / 2.0, priors.diameter_std / 2.0
    if wall.has_cone:
        std[SLOPE : SLOPE + 2] = np.inf
        std[OFFSET] = TOLERANCE * wall.size if wall.has_cylinder else 0.0
        std[OBLIQUITY] = LEANING if oblique else TOLERANCE
    free = np.flatnonzero(std > 0.0)
    information = np.zeros(SIZE)
    information[free] = 1.0 / std[free] ** 2
    return mean, information, free


def fitted(frames: Sequence[SeenFrame], start: Wall | None = None) -> Ideal:
    """The ideal vessel that fits the frames best, by Gauss-Newton steps on all their wall tiles."""
    wall = first_wall(frames) if start is None else start
    oblique = sum(one.factor.model in OBLIQUE for one in frames) > 0.5 * len(frames)
    mean, known, free = prior_of(frames[0].priors, wall, oblique)
    tiles = against(frames, wall)
    information = covariance = np.zeros((len(free), len(free)))
    for _ in range(ROUNDS):
        weight = 1.0 / np.sqrt(tiles.variance)
        rows = tiles.jacobian[:, free] * weight[:, None]
        gradient = rows.T @ (tiles.residual * weight) + known[free] * (wall.state - mean)[free]
        information = rows.T @ rows + np.diag(known[free])
        covariance = inverse_of(information)
        step = np.zeros(SIZE)
        step[free] = -covariance @ gradient
        step *= min(1.0, LONGEST_TURN / max(np.abs(step[:2]).max(), 1e-12))
        moved = referred(wall.moved(step))
        if not np.isfinite(moved.state).all():
            break
        wall, tiles = moved, against(frames, moved)
        if np.abs(step[COLUMNS["pose"]]).max() < SMALL:
            break
    return Ideal(wall, tiles, free, mean, known, information, covariance)


def inverse_of(normal: Vector) -> Vector:
    """Inverse of normal equations; a column of which nothing is known stays where it is."""
    told = np.diag(normal) > 0.0
    scale = np.where(told, 1.0 / np.sqrt(np.where(told, np.diag(normal), 1.0)), 0.0)
    values, vectors = np.linalg.eigh(normal * scale * scale[:, None])
    sure = values > UNDETERMINED
    inverse: Vector = (vectors[:, sure] / values[sure]) @ vectors[:, sure].T * scale * scale[:, None]
    return inverse
