"""Clouds that were depth images: points without order whose rays are those of a pinhole camera's pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from siloscope.types.camera import Camera

FEWEST = 2_000
"""Points below which no lattice is looked for."""

MOST_SIDE = 4_000
"""Pixels of a side beyond which a lattice is none of a depth camera."""

SAMPLES = 4_000
"""Points, drawn at random, from which the lattice is found."""

MOST_RMS = 0.05
"""Root mean square distance of the rays from the pixels' centres, pixels, up to which they are a camera's."""

LEAST_OCCUPIED = 0.3
"""Fraction of the lattice's places in view that must have a point for an image to be made of it."""

SHARP = 0.9
"""Length of the mean phasor of the rays at the lattice's frequency; 1 for a perfect lattice, 0.01 for none."""

BINS = 1 << 18
"""Bins over which the rays are counted to find the lattice's frequency."""


@dataclass(frozen=True)
class _Axis:
    """Pixels along one side: ``number = f·ratio + shift``, a whole number."""

    f: float
    shift: float

    def numbers(self, ratio: NDArray[np.float64]) -> NDArray[np.float64]:
        """Places along the side, near whole numbers."""
        return self.f * ratio + self.shift


def image_of(points: NDArray[np.float64]) -> tuple[NDArray[np.float32], Camera] | None:
    """Depth image (H, W), m, and camera of points (N, 3) in an optical frame; None where their rays are no pixels'.

    Of several points of one pixel the nearest is taken. Points behind the camera are none.
    """
    points = points[points[:, 2] > 0.0]
    if len(points) < FEWEST:
        return None
    ratios = points[:, :2] / points[:, 2:]
    drawn = np.random.default_rng(0).integers(len(ratios), size=SAMPLES)  # every second one may be one column in two
    axes = [_axis(ratios[drawn, k]) for k in range(2)]
    if axes[0] is None or axes[1] is None:
        return None
    places = np.stack([axis.numbers(ratios[:, k]) for k, axis in enumerate((axes[0], axes[1]))], axis=1)
    numbers = np.rint(places)
    if float(np.sqrt(np.mean((places - numbers) ** 2))) > MOST_RMS:
        return None
    first = numbers.min(axis=0)
    width, height = (int(n) + 1 for n in numbers.max(axis=0) - first)
    if max(width, height) > MOST_SIDE or width * height * LEAST_OCCUPIED > len(points):
        return None
    u, v = (numbers - first).astype(np.int64).T
    depth = np.full((height, width), np.inf)
    np.minimum.at(depth, (v, u), points[:, 2])
    cx, cy = axes[0].shift - first[0], axes[1].shift - first[1]
    camera = Camera(width, height, axes[0].f, axes[1].f, float(cx), float(cy))
    return np.where(np.isfinite(depth), depth, 0.0).astype(np.float32), camera


def _axis(ratio: NDArray[np.float64]) -> _Axis | None:
    """The coarsest lattice on which ratios lie, from the peaks of their spectrum; None where they lie on none."""
    least, most = float(ratio.min()), float(ratio.max())
    span = (most - least) * 1.0001
    if not 0.01 < span < 20.0:
        return None
    counts = np.bincount(((ratio - least) / span * BINS).astype(np.int64), minlength=BINS)
    spectrum = np.abs(np.fft.rfft(counts)[: MOST_SIDE + 2]) / len(ratio)
    peaks = np.flatnonzero(spectrum[8:] > 0.5 * SHARP) + 8
    if not len(peaks):
        return None
    near = peaks[peaks <= peaks[0] + 1]
    return _refined(ratio, float(near[np.argmax(spectrum[near])]) / span)


def _refined(ratio: NDArray[np.float64], f: float) -> _Axis | None:
    """The lattice of a frequency that is known to less than a period over the ratios."""
    grid = f + np.linspace(-1.0, 1.0, 41) / float(np.ptp(ratio))
    phasors = np.exp(2j * math.pi * grid[:, None] * ratio[None, :]).mean(axis=1)
    best = int(np.argmax(np.abs(phasors)))
    if abs(phasors[best]) < SHARP:
        return None
    axis = _Axis(float(grid[best]), -float(np.angle(phasors[best])) / (2.0 * math.pi))
    for _ in range(3):
        number = np.rint(axis.numbers(ratio))
        design = np.stack([ratio, np.ones_like(ratio)], axis=1)
        (slope, shift), *_ = np.linalg.lstsq(design, number, rcond=None)
        axis = _Axis(float(slope), float(shift))
    return axis
