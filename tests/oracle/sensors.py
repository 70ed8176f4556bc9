"""What sensors make of exact depths: bias, noise, multipath, warp, losses, dust, whole units."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .solids import Array


@dataclass(frozen=True)
class Sensor:
    """Depth error of one device: ``reading = d + b0 + b1 d + b2 d² + what lasts + sigma(d) n``. Metres."""

    profile: str
    """Name of the product's profile that a user would give."""
    bias: tuple[float, float, float]
    bias_std: tuple[float, float, float]
    """How far a device's own bias is off; drawn for each scene."""
    noise: tuple[float, float, float]
    """Standard deviation by powers of the depth."""
    floor: float
    """Least standard deviation."""
    near: float
    far: float
    """Range of readings."""
    focal: float
    """Focal length as a share of the width."""
    tof: bool = False
    """Whether it measures times of flight, and so suffers from multipath."""
    incidence: float = 0.0
    """The deviation grows by ``1 + incidence tan²`` of the angle of incidence, at most fivefold."""
    blur: float = 0.0
    """Half width in pixels over which neighbours share noise."""

    def sigma(self, depth: Array) -> Array:
        """Standard deviation at perpendicular incidence."""
        n0, n1, n2 = self.noise
        sigma: Array = np.maximum(n0 + depth * (n1 + depth * n2), self.floor)
        return sigma

    def biased(self, depth: Array, off: Array) -> Array:
        """Depth with the bias of a device that is `off` (3,) standard deviations."""
        b0, b1, b2 = np.array(self.bias) + np.array(self.bias_std) * off
        biased: Array = depth + b0 + b1 * depth + b2 * depth**2
        return biased


_ROOT = math.sqrt(12.0)

ASTRA_S = Sensor(
    "orbbec-astra-s",
    bias=(3.4397e-3, -0.017878, 2.2093e-2),
    bias_std=(0.0, 0.0, 0.0),
    noise=(0.5e-3 / _ROOT, -0.5e-3 / _ROOT, 3e-3 / _ROOT),
    floor=1e-4,
    near=0.4,
    far=8.0,
    focal=570.3 / 640,
)
"""Eqs. 8 to 10 of the paper."""

D455 = Sensor(
    "realsense-d455",
    bias=(0.0, 0.0, 0.0),
    bias_std=(0.003, 0.01, 0.004),
    noise=(0.0, 0.0, 0.002),
    floor=5e-4,
    near=0.4,
    far=10.0,
    focal=384.2 / 640,
    blur=1.0,
)
"""Stereo law with 0.08 px and a baseline of 95 mm; neighbours share a part of their windows."""

AZURE = Sensor(
    "azure-kinect",
    bias=(0.0, 0.0, 0.0),
    bias_std=(0.006, 0.001, 0.0005),
    noise=(0.0, 0.0, 0.0006),
    floor=1e-3,
    near=0.25,
    far=5.5,
    focal=504.0 / 640,
    tof=True,
    incidence=0.1,
)
"""Maker's specification."""

SENSORS = (ASTRA_S, D455, AZURE)


@dataclass(frozen=True)
class Faults:
    """What goes wrong beyond a sensor's own error. Shares are of the pixels."""

    unit: float = 1e-3
    """Metres of a whole unit."""
    multipath: float = 0.0
    """Greatest relative depth error by light that went round: grazing surfaces and those deep inside get most."""
    warp: float = 0.0
    """Relative depth error at 2 m of a lasting warp in disparity, 1 standard deviation."""
    warp_length: float = 0.2
    """Distance over which it changes, as a share of the width."""
    dropout: float = 0.0
    """Lost pixels: one half in patches, one half single."""
    dust: float = 0.0
    """Pixels that read a grain before the surface."""
    flying: float = 0.0
    """Pixels at depth edges that read between both sides."""


def measured(
    sensor: Sensor, faults: Faults, depth: Array, cosine: Array, deep: Array, seed: tuple[int, ...], device: int
) -> Array:
    """Readings (H, W), 0 where there is none.

    Parameters
    ----------
    depth : (H, W)
        Exact; 0 where nothing is hit.
    cosine : (H, W)
        Of the angle of incidence.
    deep : (H, W)
        0 where the surface is open, 1 where it lies deep in a hollow: where light goes round.
    seed, device
        Draw what changes with each frame, and what lasts.
    """
    draw, lasting = np.random.default_rng(seed), np.random.default_rng((device, 77))
    surface = _false(faults, sensor, depth, draw)
    reading = sensor.biased(surface, lasting.normal(size=3))
    reading = reading * (1.0 + faults.multipath * (0.6 * (1.0 - cosine) + 0.4 * deep))
    if faults.warp:
        field = smooth(depth.shape, faults.warp_length * depth.shape[1], lasting)
        reading = reading + 0.5 * faults.warp * field * surface**2
    tangent2 = np.minimum(1.0 / np.maximum(cosine, 0.05) ** 2 - 1.0, 4.0 / max(sensor.incidence, 1e-9))
    reading = reading + sensor.sigma(surface) * (1.0 + sensor.incidence * tangent2) * _unit_noise(sensor, depth, draw)
    lost = (depth <= 0.0) & (surface <= 0.0) | _lost(faults, depth.shape, draw)
    reading = np.where(lost | (reading < sensor.near) | (reading > sensor.far), 0.0, reading)
    return np.rint(reading / faults.unit) * faults.unit if faults.unit else reading


def smooth(shape: tuple[int, ...], length: float, draw: np.random.Generator) -> Array:
    """A smooth random field of unit variance that changes over `length` pixels: random plane waves."""
    v, u = np.meshgrid(*(np.arange(n, dtype=float) for n in shape), indexing="ij")
    field = np.zeros(shape)
    count = 40
    for _ in range(count):
        kx, ky = draw.normal(0.0, 1.0 / length, 2)
        field += math.sqrt(2.0 / count) * np.cos(kx * u + ky * v + draw.uniform(0.0, 2.0 * math.pi))
    return field


def _unit_noise(sensor: Sensor, depth: Array, draw: np.random.Generator) -> Array:
    noise = draw.normal(size=depth.shape)
    if not sensor.blur:
        return noise
    kernel = np.exp(-0.5 * (np.arange(-3, 4) / sensor.blur) ** 2)
    kernel /= np.sqrt((kernel**2).sum())
    for axis in (0, 1):
        padded = np.pad(noise, [(3, 3) if axis == a else (0, 0) for a in (0, 1)], mode="wrap")
        window = np.lib.stride_tricks.sliding_window_view(padded, 7, axis=axis)
        noise = window @ kernel
    return noise


def _false(faults: Faults, sensor: Sensor, depth: Array, draw: np.random.Generator) -> Array:
    """Depth of what a pixel really reads: its surface, a grain, or something between two surfaces."""
    surface = depth.copy()
    if faults.flying:
        beside = np.roll(depth, 1, axis=int(draw.integers(2)))
        edge = (np.abs(beside - depth) > 0.03 * depth) & (beside > 0.0) & (depth > 0.0)
        mixed = edge & (draw.uniform(size=depth.shape) < faults.flying)
        surface = np.where(mixed, depth + (beside - depth) * draw.uniform(size=depth.shape), surface)
    if faults.dust:
        far = np.where(depth > 0.0, depth, sensor.far)
        grain = sensor.near + np.maximum(far - sensor.near, 0.0) * draw.uniform(size=depth.shape) ** 2
        surface = np.where(draw.uniform(size=depth.shape) < faults.dust, grain, surface)
    return surface


def _lost(faults: Faults, shape: tuple[int, ...], draw: np.random.Generator) -> np.ndarray:
    if not faults.dropout:
        return np.zeros(shape, bool)
    single = 1.0 - math.sqrt(1.0 - faults.dropout)
    field = smooth(shape, 0.04 * shape[1], draw)
    return (field < np.quantile(field, single)) | (draw.uniform(size=shape) < single)
