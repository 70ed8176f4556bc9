"""Camera intrinsics."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.errors import InputError
from siloscope.types.intrinsics import IntrinsicsStd

DISTORTION_MODELS = ("none", "brown_conrady", "inverse_brown_conrady", "rational", "kannala_brandt")
"""Names of the distortion models; coefficients are in the order of OpenCV and ROS."""


@dataclass(frozen=True)
class Camera:
    """Intrinsics of a depth camera, in pixels; pixel centres are at integers, (0, 0) is the top-left one.

    Parameters
    ----------
    width, height : int
        Image size.
    fx, fy, cx, cy : float
        Focal lengths and principal point (Eqs. 1 and 2).
    distortion_model : str
        One of `DISTORTION_MODELS`.
    distortion : tuple of float
        Coefficients: ``k1 k2 p1 p2 k3`` (brown_conrady and its inverse), ``… k4 k5 k6`` after them (rational),
        ``k1 k2 k3 k4`` (kannala_brandt).
    intrinsics_std : IntrinsicsStd or mapping, optional
        How exactly they are known, where a calibration states it: ``f``, ``c``, ``k1``.

    Raises
    ------
    InputError
        For NaN, zero or negative focal lengths, a size that is no size, or an unknown distortion model.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion_model: str = "none"
    distortion: tuple[float, ...] = ()
    intrinsics_std: IntrinsicsStd | None = None

    def __post_init__(self) -> None:
        if not all(map(is_number, self.distortion)):
            raise InputError(f"camera distortion is {self.distortion!r}; give the coefficients as numbers")
        object.__setattr__(self, "distortion", tuple(float(k) for k in self.distortion))
        for name in ("width", "height"):
            side = getattr(self, name)
            if not is_number(side) or not 1 <= side <= 20_000 or int(side) != side:
                raise InputError(f"camera {name} is {side!r}; give a whole number of pixels between 1 and 20000")
            object.__setattr__(self, name, int(side))
        for name in ("fx", "fy", "cx", "cy"):
            value = getattr(self, name)
            if not is_number(value) or not math.isfinite(value) or (name in ("fx", "fy") and value <= 0.0):
                raise InputError(f"camera {name} is {value!r}; give the sensor's own intrinsics with --camera FILE")
            object.__setattr__(self, name, float(value))
        if self.distortion_model not in DISTORTION_MODELS:
            known = ", ".join(DISTORTION_MODELS)
            raise InputError(f"unknown distortion model '{self.distortion_model}'; known are {known}")
        if not isinstance(self.intrinsics_std, IntrinsicsStd | None):
            object.__setattr__(self, "intrinsics_std", IntrinsicsStd.of_fields(self.intrinsics_std))
        try:
            _core.check_camera(self)
        except ValueError as error:
            raise InputError(f"camera: {error}") from None

    def __getstate__(self) -> dict[str, Any]:
        return {field.name: getattr(self, field.name) for field in fields(self)}  # without the cached rays

    def rays(self) -> NDArray[np.float64]:
        """Undistorted ray ``(x/z, y/z)`` of every pixel: float64 array (height, width, 2), read-only, cached."""
        rays: NDArray[np.float64] | None = self.__dict__.get("_rays")
        if rays is None:
            rays = _core.camera_rays(self).reshape(self.height, self.width, 2)
            rays.flags.writeable = False
            object.__setattr__(self, "_rays", rays)
        return rays

    def to_dict(self) -> dict[str, Any]:
        """Plain data with the fields' names, as in our TOML and JSON camera files."""
        plain = {field.name: getattr(self, field.name) for field in fields(self)}
        stated = plain.pop("intrinsics_std")
        known = {} if stated is None else {"intrinsics_std": stated.to_dict()}
        return {**plain, "distortion": list(self.distortion), **known}


def is_number(value: Any) -> bool:
    """Whether a caller's value is a real number, and neither text nor a truth value."""
    return isinstance(value, Real) and not isinstance(value, bool)
