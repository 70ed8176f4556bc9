"""A floor as it was seen: in frames of the empty vessel, or as the lowest surface that a refill has confirmed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from siloscope.types.content import Content
from siloscope.types.floor import FloorMap
from siloscope.vessel.bottoms import Bottom, Oblique

SIDE = 64
"""Cells of a learned floor along a side."""

LEAST_SEEN = 0.25
"""Fraction of the floor that must be seen for a map."""

SAME = 3.0
"""Standard deviations within which two surfaces lie in the same place."""

COVERED = 0.05
"""A surface this much higher has covered the floor in between, m."""

SMALLEST = 0.002
"""Standard deviation of a place that the camera saw, m: the wall's unevenness."""

FITS = 3.0
"""A kind completes a floor where its residuals are below this many deviations, or below `ROUGH`."""
ROUGH = 0.015
"""m."""

DEEPEST = 0.98
"""Quantile of the seen heights that counts as the deepest seen."""

STAGE = 1.0
"""Standard deviation of what was never seen below it, per metre that the kind continues: another stage may follow."""

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Layer:
    """The surface of one frame on the learned floor's grid; z down, m."""

    z: Array
    std: Array
    seen: NDArray[np.bool_]
    derivatives: Array

    @classmethod
    def of(cls, content: Content) -> Layer | None:
        """The surface of a reading; None where it has none."""
        surface, lengths = content.surface, content.lengths
        if surface is None or lengths is None or lengths.geometry.radius is None or content.ullage_derivatives is None:
            return None
        x, y = FloorMap.middles(lengths.geometry.radius, SIDE)
        rows, columns = surface.cells(np.dstack([x, y]))
        z = surface.core.z_at(np.column_stack([x.ravel(), y.ravel()])).reshape(x.shape)
        std = np.hypot(np.nan_to_num(surface.std[rows, columns], nan=1.0), SMALLEST)
        inside = np.hypot(x, y) <= lengths.geometry.radius
        return cls(z, std, inside & np.isin(surface.kinds[rows, columns], (1, 2, 3)), content.ullage_derivatives)


def tare_map(layers: Sequence[Layer], radius: float) -> FloorMap | None:
    """The floor from frames of the empty vessel, weighed by what they know; None where too little is seen."""
    weight = np.array([np.where(layer.seen, layer.std**-2.0, 0.0) for layer in layers])
    total = weight.sum(axis=0)
    seen = total > 0.0
    continued = np.mean([layer.z for layer in layers], axis=0)
    z = np.where(seen, (weight * [layer.z for layer in layers]).sum(axis=0) / np.where(seen, total, 1.0), continued)
    std = np.where(seen, np.maximum(np.where(seen, total, 1.0) ** -0.5, SMALLEST), layers[0].std)
    derivatives = np.mean([layer.derivatives for layer in layers], axis=0)
    return _completed(z, std, seen, derivatives, radius)


def learned_map(layers: Sequence[Layer], radius: float) -> FloorMap | None:
    """The lowest surface of a sequence where a fill covered it and a draw-down showed it again; None without one.

    At a place the lowest surface counts only if a frame before and a frame after a higher one agree on it, so neither
    a single outlier nor feed that only slid down can make a floor.
    """
    z = np.array([np.where(layer.seen, layer.z, -np.inf) for layer in layers])
    std = np.array([layer.std for layer in layers])
    lowest = z.max(axis=0)
    at_floor = z >= lowest - SAME * np.sqrt(2.0) * std
    with np.errstate(invalid="ignore"):
        covered = z < lowest - np.maximum(COVERED, SAME * std)
    covered &= np.isfinite(z)
    before = np.logical_or.accumulate(at_floor & np.isfinite(z), axis=0)
    after = np.logical_or.accumulate((at_floor & np.isfinite(z))[::-1], axis=0)[::-1]
    confirmed = (covered & before & after).any(axis=0)
    weight = np.where(at_floor & np.isfinite(z), std**-2.0, 0.0)
    total = np.maximum(weight.sum(axis=0), 1e-12)
    mean = (weight * np.where(np.isfinite(z), z, 0.0)).sum(axis=0) / total
    deepest = max(range(len(layers)), key=lambda k: float(layers[k].z[confirmed].mean()) if confirmed.any() else 0.0)
    made = np.where(confirmed, mean, layers[deepest].z)
    deviation = np.where(confirmed, np.maximum(total**-0.5, SMALLEST), layers[deepest].std)
    return _completed(made, deviation, confirmed, layers[deepest].derivatives, radius)


def _completed(z: Array, std: Array, seen: NDArray[np.bool_], derivatives: Array, radius: float) -> FloorMap | None:
    """The map with what was not seen by the kind that fits the rest, else as the surface continues, twice as unsure."""
    x, y = FloorMap.middles(radius, SIDE)
    inside = np.hypot(x, y) <= radius
    fraction = float(seen.sum() / inside.sum())
    if fraction < LEAST_SEEN:
        return None
    model, rms, name = _kind_that_fits(x, y, z, std, seen, radius)
    if model is None:
        filled, unsure = z, np.where(seen, std, 2.0 * std)
    else:
        deeper = np.maximum(model - np.quantile(z[seen], DEEPEST), 0.0)
        filled = np.where(seen, z, model)
        unsure = np.where(seen, std, np.hypot(max(FITS * rms, ROUGH), STAGE * deeper))
    return FloorMap(radius, filled, unsure, derivatives, fraction, name if fraction < 1.0 else None)


def _kind_that_fits(
    x: Array, y: Array, z: Array, std: Array, seen: NDArray[np.bool_], radius: float
) -> tuple[Array | None, float, str | None]:
    """Flat, cone or oblique cone: the simplest whose residuals are small; with their root mean square."""
    edge, drop = float(z[seen].min()), float(np.ptp(z[seen])) + 1e-3
    kinds: tuple[tuple[str, tuple[float, ...]], ...] = (
        ("flat", (edge,)),
        ("cone", (edge, drop)),
        ("oblique", (edge, drop, 0.0, 0.0)),
    )
    limit = max(FITS * float(np.median(std[seen])), ROUGH)
    for name, start in kinds:
        found = _fitted(x[seen], y[seen], z[seen], start, radius)
        rms = float(np.sqrt(np.mean((_model(x[seen], y[seen], found, radius) - z[seen]) ** 2)))
        if rms < limit:
            return _model(x, y, found, radius), rms, name
    return None, 0.0, None


def _model(x: Array, y: Array, lengths: Array, radius: float) -> Array:
    """z of a floor: edge, height, and where the vertex lies."""
    if len(lengths) == 1:
        return np.full(x.shape, float(lengths[0]))
    aside = (0.0, 0.0) if len(lengths) == 2 else (float(lengths[2]), float(lengths[3]))
    shape: Bottom = replace(Oblique(max(float(lengths[1]), 1e-3)), outlet_x=aside[0], outlet_y=aside[1])
    return float(lengths[0]) + shape.depth(x, y, radius)


def _fitted(x: Array, y: Array, z: Array, start: tuple[float, ...], radius: float) -> Array:
    """Gauss–Newton with differences; a few places are enough."""
    few = slice(None, None, max(len(x) // 600, 1))
    x, y, z = x[few], y[few], z[few]
    lengths = np.array(start)
    for _ in range(12):
        now = _model(x, y, lengths, radius)
        columns = [(_model(x, y, lengths + 1e-4 * unit, radius) - now) / 1e-4 for unit in np.eye(len(lengths))]
        jacobian, residual = np.column_stack(columns), z - now
        scale = 1.4826 * np.median(np.abs(residual)) + 1e-4
        weight = 1.0 / np.maximum(np.abs(residual) / (2.0 * scale), 1.0)
        normal = jacobian.T @ (jacobian * weight[:, None]) + 1e-9 * np.eye(len(lengths))
        step = np.linalg.solve(normal, jacobian.T @ (weight * residual))
        lengths = lengths + np.clip(step, -0.3 * radius, 0.3 * radius)
        if len(lengths) > 2:
            away = float(np.hypot(lengths[2], lengths[3]))
            lengths[2:] *= min(1.0, 0.95 * radius / max(away, 1e-9))
    return lengths
