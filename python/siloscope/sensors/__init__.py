"""Sensor profiles: what is known about the depth error of a kind of sensor. One TOML file each, yours by path."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError, UsageError
from siloscope.parameters import BIAS, NOISE, noise_std
from siloscope.types.camera import Camera
from siloscope.types.intrinsics import IntrinsicsStd, named
from siloscope.types.sensor_map import SensorMap

__all__ = ["UNKNOWN", "SensorProfile", "load", "names"]


@dataclass(frozen=True)
class SensorProfile:
    """Depth error of a sensor: ``measured = d + offset + scale·d + quadratic·d² + noise(d)``, d the true depth in m.

    Eqs. 8–10 of the paper are of this form.
    """

    name: str
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Offset (m), scale (1), quadratic (1/m)."""
    bias_std: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Standard deviations of what is not known about the bias; 0 where it is exact."""
    noise: tuple[float, float, float, float, float, float] | None = None
    """Standard deviation of the noise, ``max(floor, constant + linear·d + quadratic·d² + power_factor·d^power)``, as
    (floor, constant, linear, quadratic, power_factor, power) in metres; None where a frame itself has to tell it."""
    range: tuple[float, float] = (0.0, math.inf)
    """Nearest and farthest depth measured, m."""
    depth_unit: float | None = None
    """Metres per raw unit that the sensor's makers set by default; for messages, never assumed."""
    source: str = ""
    """Where the figures come from."""
    intrinsics: tuple[Camera, ...] = field(default=())
    """Nominal cameras by image size; a device's own always win."""
    intrinsics_std: tuple[float, float, float] | None = None
    """Standard deviations of a device about them: of f (relative), of c (fraction of the width), of k1; None where the
    library's for nominal cameras hold."""
    map: SensorMap | None = None
    """What this very device reads wrong over its image; None where nobody has mapped it."""

    def camera(self, width: int, height: int) -> Camera | None:
        """Nominal intrinsics for an image size, or None."""
        return next((c for c in self.intrinsics if (c.width, c.height) == (width, height)), None)

    def nominal_std(self, camera: Camera) -> IntrinsicsStd:
        """How far a device's intrinsics may be off a nominal camera's."""
        if self.intrinsics_std is None:
            return named("nominal", camera)
        f, c, k1 = self.intrinsics_std
        return IntrinsicsStd(f, c * camera.width, k1)

    def sigma(self, depth: float) -> float | None:
        """Standard deviation of the noise at a true depth, m."""
        return None if self.noise is None else noise_std(self.noise, depth)

    def true_depth(self, measured: NDArray[np.float64]) -> NDArray[np.float64]:
        """Depth d with ``measured = d + offset + scale·d + quadratic·d²``, m."""
        offset, scale, quadratic = self.bias
        gain, rest = 1.0 + scale, measured - offset
        return np.asarray(2.0 * rest / (gain + np.sqrt(np.maximum(gain**2 + 4.0 * quadratic * rest, 0.0))))

    def to_dict(self) -> dict[str, Any]:
        """What a result's ``config`` says about the sensor."""
        noise = None if self.noise is None else dict(zip(NOISE, self.noise, strict=True))
        bias, bias_std = (dict(zip(BIAS, values, strict=True)) for values in (self.bias, self.bias_std))
        mapped = {} if self.map is None else {"map": self.map.to_dict()}
        return {"name": self.name, "bias": bias, "bias_std": bias_std, "noise": noise, **mapped}


UNKNOWN = SensorProfile(
    "unknown", bias_std=(0.01, 0.02, 0.02), source="Weak priors that every sensor of the library agrees with."
)
"""A sensor of which nothing is known."""


@cache
def _shipped(name: str) -> SensorProfile:
    return _parse(resources.files(__name__).joinpath("profiles", f"{name}.toml").read_bytes(), name)


def names() -> list[str]:
    """Names of the profiles that come with siloscope."""
    return list(_names())


@cache
def _names() -> tuple[str, ...]:
    files = resources.files(__name__).joinpath("profiles").iterdir()
    return tuple(sorted(file.name.removesuffix(".toml") for file in files if file.name.endswith(".toml")))


def load(sensor: str | Path | SensorProfile | None) -> SensorProfile:
    """The profile of a name, of a TOML file, of a calibration's file, or `UNKNOWN` for None.

    A calibration's is the one that it was made with, and has the map of its device.

    Raises
    ------
    UsageError
        For a name that is no profile and no file.
    InputError
        For a file that is no profile; the message names the entry.
    """
    if sensor is None or isinstance(sensor, SensorProfile):
        return sensor or UNKNOWN
    if str(sensor) in names():
        return _shipped(str(sensor))
    path = Path(sensor)
    if path.suffix == ".json" and path.is_file():
        return _of_calibration(path)
    if path.is_file():
        from siloscope.schema.sensor_profile import read

        return _parse(read(path), str(path))
    known = ", ".join(names())
    raise UsageError(f"unknown sensor '{sensor}'; give a TOML profile's path or one of: {known}")


def _of_calibration(path: Path) -> SensorProfile:
    from siloscope.schema.calibration import read

    found = from_record(read(path)[1].get("sensor"))
    if found is None:
        raise InputError(f"{path}: the calibration does not tell its sensor; name the sensor itself")
    return found


def from_record(table: Any) -> SensorProfile | None:
    """The profile that a result's ``config`` has as its sensor; None where it has none.

    A result does not keep the range; it is the shipped profile's of that name.
    """
    from siloscope.schema.sensor_profile import record

    told = record(table)
    if told is None:
        return None
    reach = _ranges().get(told.name, (0.0, math.inf))
    mapped = None if told.map is None else SensorMap(told.map.power, told.map.error, told.map.std, told.map.opens)
    return SensorProfile(told.name, told.bias, told.bias_std, told.noise, reach, map=mapped)


def with_map(profile: SensorProfile, table: Any) -> SensorProfile:
    """A profile with the map of the sensor in a calibration's ``config``, where that is the same one and was mapped."""
    if profile.map is not None or not isinstance(table, dict) or "map" not in table:
        return profile
    own = from_record(table)
    same = own is not None and profile.name in (own.name, UNKNOWN.name)
    return replace(profile, map=own.map) if own is not None and same else profile


@cache
def _ranges() -> dict[str, tuple[float, float]]:
    """Ranges of the shipped profiles by their names."""
    return {profile.name: profile.range for profile in map(load, names())}


def _parse(content: bytes, source: str) -> SensorProfile:
    from siloscope.schema.sensor_profile import parse

    told = parse(content, source)
    spread = told.intrinsics_std
    return SensorProfile(
        name=source if told.name is None else told.name,
        bias=(told.bias.offset, told.bias.scale, told.bias.quadratic),
        bias_std=(told.bias.offset_std, told.bias.scale_std, told.bias.quadratic_std),
        noise=None if told.noise is None else told.noise.law,
        range=told.range,
        depth_unit=told.depth_unit,
        source=told.source,
        intrinsics=tuple(_camera(entry, source) for entry in told.intrinsics),
        intrinsics_std=None if spread is None else (spread.f, spread.c, spread.k1),
    )


def _camera(entry: dict[str, Any], source: str) -> Camera:
    try:
        return Camera(**entry)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{source}: [[intrinsics]] {error}; give width, height, fx, fy, cx, cy") from None
