"""Clouds that a sensor at the origin has seen, as the depth image of a pinhole camera in its place."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from siloscope.types.camera import Camera

FEWEST = 4_000
"""Points below which a cloud stays one."""

FEWEST_RAYS = 200
"""Points below which nothing is said of where a cloud was seen from."""

WIDEST = 2.5
"""Tangent of the largest angle between a ray and the optical axis."""

LEAST_INSIDE = 0.97
"""Fraction of the points that must lie within that."""

POINTS_A_PIXEL = 1.5
"""Mean number of points in a pixel that has any."""

MOST_SIDE = 1_000
"""Pixels of a side at most; more points share a pixel."""

ROUGH = 0.03
"""Relative scatter of the depths around a pixel above which it shows an edge."""

FEWEST_AROUND = 5
"""Pixels, of nine, that must have a point for a pixel to have a depth."""

MOST_BEHIND = 0.1
"""Fraction of the pixels with points at different depths, above which no single place has seen them."""


def image_from_origin(points: NDArray[np.float64]) -> tuple[NDArray[np.float32], Camera] | None:
    """Depth image (H, W), metres, and camera of points (N, 3) in an optical frame; None where no one place saw them.

    A pixel takes the point nearest to its centre, moved onto its ray in the plane of the points around it: along a
    plane 1/z is linear in the rays. So noise stays what it is, and the rays of the points need not be a camera's.
    """
    seen = _seen(points)
    if seen is None or len(seen.inverse) < FEWEST:
        return None
    shape = seen.camera.height, seen.camera.width
    chosen = _nearest(seen.number, (seen.off**2).sum(axis=1), shape[0] * shape[1])
    return _onto_rays(chosen, seen.off, seen.inverse, shape), seen.camera


def camera_at_origin(points: NDArray[np.float64]) -> Camera | None:
    """A camera in the place of the sensor that saw points (N, 3) in an optical frame; None where no one place did."""
    ahead = float(np.mean(points[:, 2] > 0.0)) if len(points) else 0.0
    seen = _seen(points) if ahead > LEAST_INSIDE else None
    return None if seen is None else seen.camera


@dataclass(frozen=True)
class _Seen:
    """Points on the pixels of a camera at the origin: each one's pixel, place beside its centre, and 1/z, 1/m."""

    camera: Camera
    number: NDArray[np.int64]
    off: NDArray[np.float64]
    inverse: NDArray[np.float64]


def _seen(points: NDArray[np.float64]) -> _Seen | None:
    points = points[points[:, 2] > 0.0]
    ratios = points[:, :2] / points[:, 2:]
    inside = (np.abs(ratios) < WIDEST).all(axis=1)
    if inside.sum() < max(FEWEST_RAYS, LEAST_INSIDE * len(points)):
        return None
    points, ratios = points[inside], ratios[inside]
    first = ratios.min(axis=0)
    f = _pixels_per_ray(ratios - first)
    width, height = (int(n) + 1 for n in np.ceil((ratios.max(axis=0) - first) * f))
    places = (ratios - first) * f
    cells = np.rint(places).astype(np.int64)
    number, inverse = cells[:, 1] * width + cells[:, 0], 1.0 / points[:, 2]
    if _seen_through(number, inverse, width * height):
        return None
    camera = Camera(width, height, f, f, -float(first[0]) * f, -float(first[1]) * f)
    return _Seen(camera, number, places - cells, inverse)


def _pixels_per_ray(ratios: NDArray[np.float64]) -> float:
    """Focal length at which a pixel has `POINTS_A_PIXEL` points, from the area that the rays cover."""
    side = max(float(ratios.max()), 1e-9)
    coarse = max(8.0, math.sqrt(len(ratios) / 16.0)) / side
    covered = len(np.unique((ratios * coarse).astype(np.int64) @ np.array([1, 1 << 20]))) / coarse**2
    return min(math.sqrt(len(ratios) / (POINTS_A_PIXEL * covered)), MOST_SIDE / side)


def _seen_through(number: NDArray[np.int64], inverse: NDArray[np.float64], count: int) -> bool:
    """Whether many pixels have points at depths apart, as clouds from several places have."""
    least, most = np.full(count, np.inf), np.zeros(count)
    np.minimum.at(least, number, inverse)
    np.maximum.at(most, number, inverse)
    several = np.bincount(number, minlength=count) > 1
    if not several.any():
        return False
    return float(np.mean(most[several] / least[several] > 1.3)) > MOST_BEHIND


def _nearest(number: NDArray[np.int64], away: NDArray[np.float64], count: int) -> NDArray[np.int64]:
    """Index of the point nearest to each pixel's centre, -1 where it has none."""
    chosen = np.full(count, -1)
    order = np.argsort(-away, kind="stable")
    chosen[number[order]] = order
    return chosen


def _onto_rays(
    chosen: NDArray[np.int64], off: NDArray[np.float64], inverse: NDArray[np.float64], shape: tuple[int, int]
) -> NDArray[np.float32]:
    """Depths on the pixels' own rays, by the plane of 1/z through the points of the 3 x 3 pixels around each."""
    seen = (chosen >= 0).reshape(shape)
    x, y, w = (np.where(seen, values[chosen].reshape(shape), 0.0) for values in (off[:, 0], off[:, 1], inverse))
    n, sx, sy, sxx, sxy, syy, sw, sxw, syw, sww = _sums(seen.astype(np.float64), x, y, w)
    with np.errstate(all="ignore"):
        sxx, sxy, syy = sxx - sx * sx / n, sxy - sx * sy / n, syy - sy * sy / n
        sxw, syw, sww = sxw - sx * sw / n, syw - sy * sw / n, sww - sw * sw / n
        determinant = sxx * syy - sxy * sxy
        right, down = (syy * sxw - sxy * syw) / determinant, (sxx * syw - sxy * sxw) / determinant
        scatter = np.sqrt(np.maximum(sww - right * sxw - down * syw, 0.0) / n)
        centre = w - right * x - down * y
        smooth = seen & (n >= FEWEST_AROUND) & (determinant > 0.1) & (scatter < ROUGH * sw / n) & (centre > 0.0)
        return np.where(smooth, 1.0 / centre, 0.0).astype(np.float32)


def _sums(
    there: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64], w: NDArray[np.float64]
) -> list[NDArray[np.float64]]:
    """Sums of 1, x, y, xx, xy, yy, w, xw, yw, ww over the 3 x 3 pixels around each, x and y from its own centre."""
    sums = [np.zeros_like(w) for _ in range(10)]
    for dv in (-1, 0, 1):
        for du in (-1, 0, 1):
            one, dx, dy, value = (_shifted(part, dv, du) for part in (there, x, y, w))
            dx, dy = (dx + du) * one, (dy + dv) * one
            terms = (one, dx, dy, dx * dx, dx * dy, dy * dy, value, dx * value, dy * value, value * value)
            for total, term in zip(sums, terms, strict=True):
                total += term
    return sums


def _shifted(values: NDArray[np.float64], dv: int, du: int) -> NDArray[np.float64]:
    """``values[v + dv, u + du]``, 0 outside."""
    padded = np.pad(values, 1)
    height, width = values.shape
    return padded[1 + dv : 1 + dv + height, 1 + du : 1 + du + width]
