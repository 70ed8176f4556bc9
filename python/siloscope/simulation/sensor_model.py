"""What a sensor makes of exact depths (Eqs. 8–10)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from siloscope import _core, sensors
from siloscope.simulation.checked import checked


@dataclass(frozen=True)
class SensorModel:
    """What a sensor makes of exact depths (Eq. 10). Metres and radians.

    A reading is ``true + bias(true) + sigma(true)·normal``, cut to the range and rounded to `unit`.
    The default is a perfect sensor.
    """

    bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Bias ``b0 + b1 d + b2 d²`` at the true depth d (Eq. 8)."""
    noise: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Standard deviation ``n0 + n1 d + n2 d²`` (Eq. 9), to which the power law is added."""
    noise_scale: float = 0.0
    """Power law ``scale · d**power``; for stereo ``s/(fx·B)`` and 2."""
    noise_power: float = 2.0
    """Its exponent."""
    noise_floor: float = 0.0
    """Least standard deviation."""
    incidence_gain: float = 0.0
    """The standard deviation grows by ``1 + gain·(θ/(π/2 - θ))²`` at incidence angle θ."""
    correlation: float = 0.0
    """Share of the noise's variance that neighbouring pixels have in common."""
    correlation_length: float = 8.0
    """Reach of the common part in pixels."""
    warp: float = 0.0
    """Lasting low-frequency warp: its standard deviation at 1 m; grows with the depth squared, as for stereo."""
    warp_length: float = 80.0
    """Distance over which the warp changes, pixels."""
    warp_seed: int = 0
    """The unit whose warp it is."""
    bowl: float = 0.0
    """Depth added at the image's corner, growing with the squared distance from its centre (multipath)."""
    multipath: float = 0.0
    """Share of the light that surfaces throw back, for a time-of-flight sensor that also sees light which went round
    once, by the scene's geometry; 0 for none of it. 0.1 lengthens a silo's depths by about 1 %."""
    min_range: float = 0.0
    """Nearest depth measured."""
    max_range: float = math.inf
    """Farthest depth measured."""
    max_incidence: float = math.pi / 2
    """Surfaces met at a larger angle to their normal give no measurement."""
    dropout: float = 0.0
    """Share of pixels lost for no visible reason."""
    dropout_length: float = 0.0
    """Size of the patches in which they are lost, pixels; below 1 for single pixels."""
    baseline: float = 0.0
    """Distance to the projector or second imager: the left ``fx·baseline/depth`` columns give no measurement."""
    flying: float = 0.0
    """Share of pixels at depth edges that read a depth between the two sides."""
    flying_step: float = 0.03
    """Relative depth step that makes an edge."""
    dust: float = 0.0
    """Share of pixels that read a dust grain before the surface."""
    unit: float = 0.0
    """Metres a raw unit, 0 for unrounded depths; readings beyond 65534 units are lost."""

    def __post_init__(self) -> None:
        checked(_core.check_sensor, self)

    @property
    def perfect(self) -> bool:
        """Whether it leaves exact depths as they are."""
        return self == SensorModel()

    def bias_at(self, depth: ArrayLike) -> NDArray[np.float64]:
        """Mean error at true depths, metres (Eq. 8)."""
        d = np.asarray(depth, np.float64)
        return self._laws(d).bias.reshape(d.shape)

    def sigma_at(self, depth: ArrayLike) -> NDArray[np.float64]:
        """Standard deviation at true depths and perpendicular incidence, metres (Eq. 9)."""
        d = np.asarray(depth, np.float64)
        return self._laws(d).std.reshape(d.shape)

    def _laws(self, depth: NDArray[np.float64]) -> _core.SensorLaws:
        return _core.sensor_laws(self, depth.ravel())


PERFECT = SensorModel()
"""Exact depths (section 2.4.1)."""

ASTRA_S = SensorModel(
    bias=(3.4397e-3, -0.017878, 2.2093e-2),
    noise=(0.5e-3 / math.sqrt(12.0), -5e-4 / math.sqrt(12.0), 3e-3 / math.sqrt(12.0)),
)
"""Orbbec Astra S: Eqs. 8 and 9, which are in millimetres, for metres."""


def sensor_model(name: str, device: int | None = None) -> SensorModel:
    """The model of a sensor: "perfect", or a profile's name, its last part ("d455"), or its file.

    "astra-s" is `ASTRA_S`, Eqs. 8 and 9 without a limit of range, as the paper uses it. Of other profiles the range
    counts as well; `device` draws the bias of one device from what the profile leaves open, None takes its mean.
    Raises `UsageError` for an unknown name, `InputError` for a file that is no profile.
    """
    if name == "perfect":
        return PERFECT
    full = next((known for known in sensors.names() if known.endswith(f"-{name}")), name)
    if full == "orbbec-astra-s":
        return ASTRA_S
    return _of_profile(sensors.load(full), device)


def _of_profile(profile: sensors.SensorProfile, device: int | None) -> SensorModel:
    floor, constant, linear, quadratic, factor, power = profile.noise or (0.0,) * 6
    spread = np.zeros(3) if device is None else np.random.default_rng(device).normal(size=3)
    bias = np.array(profile.bias) + spread * np.array(profile.bias_std)
    return SensorModel(
        bias=(float(bias[0]), float(bias[1]), float(bias[2])),
        noise=(constant, linear, quadratic),
        noise_scale=factor,
        noise_power=power if factor else 2.0,
        noise_floor=floor,
        min_range=profile.range[0],
        max_range=profile.range[1],
    )
