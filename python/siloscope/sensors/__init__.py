"""Sensor profiles: what is known about the depth error of a kind of sensor. One TOML file each, yours by path."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from siloscope.errors import InputError, UsageError
from siloscope.types.camera import Camera

__all__ = ["UNKNOWN", "SensorProfile", "load", "names"]

BIAS = ("offset", "scale", "quadratic")
NOISE = ("floor", "constant", "linear", "quadratic", "power_factor", "power")
POWER = 2.0
STEEPEST = 10.0
"""Largest power of a noise law; sensors have 1 to 3."""
LARGEST_FILE = 100_000
"""Bytes; a profile is a page of text."""


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

    def camera(self, width: int, height: int) -> Camera | None:
        """Nominal intrinsics for an image size, or None."""
        return next((c for c in self.intrinsics if (c.width, c.height) == (width, height)), None)

    def sigma(self, depth: float) -> float | None:
        """Standard deviation of the noise at a true depth, m."""
        if self.noise is None:
            return None
        floor, constant, linear, quadratic, factor, power = self.noise
        return max(floor, constant + linear * depth + quadratic * depth**2 + factor * math.pow(depth, power))

    def to_dict(self) -> dict[str, Any]:
        """What a result's ``config`` says about the sensor."""
        noise = None if self.noise is None else dict(zip(NOISE, self.noise, strict=True))
        bias, bias_std = (dict(zip(BIAS, values, strict=True)) for values in (self.bias, self.bias_std))
        return {"name": self.name, "bias": bias, "bias_std": bias_std, "noise": noise}


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
    """The profile of a name, of a TOML file, or `UNKNOWN` for None.

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
    if path.is_file():
        return _parse(_content(path), str(path))
    known = ", ".join(names())
    raise UsageError(f"unknown sensor '{sensor}'; give a TOML profile's path or one of: {known}")


def _content(path: Path) -> bytes:
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise InputError(f"{path}: too large for a sensor profile; docs/your-frame.md has an example")
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: can't be read ({error.strerror}); check its name and permissions") from None


def _parse(content: bytes, source: str) -> SensorProfile:
    try:
        table = tomllib.loads(content.decode())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{source}: no TOML sensor profile ({error}); docs/your-frame.md has an example") from None
    known = {"name", "source", "range", "depth_unit", "bias", "noise", "intrinsics"}
    _only(table, known, source)
    bias, noise = _table(table, "bias", source), _table(table, "noise", source)
    _only(bias, {*BIAS, *(f"{key}_std" for key in BIAS)}, f"{source}: [bias]")
    _only(noise, set(NOISE), f"{source}: [noise]")
    near, far = _range(table.get("range", [0.0, 1e6]), source)
    offset, scale, quadratic = (_number(bias.get(key, 0.0), f"{source}: bias.{key}") for key in BIAS)
    stds = [_number(bias.get(f"{key}_std", 0.0), f"{source}: bias.{key}_std", 0.0) for key in BIAS]
    law = [_number(noise.get(key, POWER if key == "power" else 0.0), f"{source}: noise.{key}") for key in NOISE]
    unit = table.get("depth_unit")
    profile = SensorProfile(
        name=str(table.get("name", source)),
        bias=(offset, scale, quadratic),
        bias_std=(stds[0], stds[1], stds[2]),
        noise=(law[0], law[1], law[2], law[3], law[4], law[5]) if noise else None,
        range=(near, far),
        depth_unit=None if unit is None else _number(unit, f"{source}: depth_unit", 1e-9),
        source=str(table.get("source", "")),
        intrinsics=_cameras(table.get("intrinsics", []), source),
    )
    _plausible(profile, source)
    return profile


def _range(value: Any, source: str) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise InputError(f"{source}: range must be [nearest, farthest] in metres, got {value!r}")
    near, far = (_number(depth, f"{source}: range") for depth in value)
    return near, far


def _plausible(profile: SensorProfile, source: str) -> None:
    """Noise must be positive and measured depth must grow with true depth over the sensor's range."""
    _, scale, quadratic = profile.bias
    near, far = profile.range
    if profile.noise is not None and abs(profile.noise[5]) > STEEPEST:
        raise InputError(f"{source}: noise.power must be between -{STEEPEST:g} and {STEEPEST:g}")
    if not 0.0 <= near < far:
        raise InputError(f"{source}: range must be [nearest, farthest] in metres, got [{near}, {far}]")
    for depth in (max(near, 0.05), min(far, 50.0)):
        sigma = profile.sigma(depth)
        if sigma is not None and not sigma > 0.0:
            raise InputError(f"{source}: the noise at {depth:g} m is {sigma:g} m; it must be positive over the range")
        if not 1.0 + scale + 2.0 * quadratic * depth > 0.1:
            raise InputError(f"{source}: with this bias, measured depth does not grow with true depth at {depth:g} m")


def _only(table: dict[str, Any], known: set[str], where: str) -> None:
    unknown = sorted(set(table) - known)
    if unknown:
        raise InputError(f"{where}: unknown entry '{unknown[0]}'; known are {', '.join(sorted(known))}")


def _table(table: dict[str, Any], key: str, source: str) -> dict[str, Any]:
    entry = table.get(key, {})
    if not isinstance(entry, dict):
        raise InputError(f"{source}: '{key}' must be a table, written as [{key}]")
    return entry


def _number(value: Any, where: str, least: float = -math.inf) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value) or value < least:
        bound = "" if least == -math.inf else f" of at least {least:g}"
        raise InputError(f"{where} must be a finite number{bound}, got {value!r}")
    return float(value)


def _cameras(entries: Any, source: str) -> tuple[Camera, ...]:
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise InputError(f"{source}: 'intrinsics' must be a list of tables, written as [[intrinsics]]")
    return tuple(_camera(entry, source) for entry in entries)


def _camera(entry: dict[str, Any], source: str) -> Camera:
    try:
        return Camera(**entry)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{source}: [[intrinsics]] {error}; give width, height, fx, fy, cx, cy") from None
