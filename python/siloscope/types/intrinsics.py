"""How exactly a camera's intrinsics are known."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from numbers import Real
from typing import Any, Protocol

from siloscope.errors import InputError, UsageError


class Pinhole(Protocol):
    """What of a camera brings its intrinsics' deviations to the image."""

    @property
    def width(self) -> int:
        """Pixels across."""

    @property
    def fx(self) -> float:
        """Focal length across, pixels."""

    @property
    def fy(self) -> float:
        """Focal length down, pixels."""


@dataclass(frozen=True)
class IntrinsicsStd:
    """Standard deviations of a camera's intrinsics.

    No frame shows an error of the principal point or of both focal lengths: what is stated here goes into the answer.
    """

    f: float
    """Of the focal lengths, as a fraction of them."""
    c: float
    """Of the principal point, pixels."""
    k1: float
    """Of the first radial distortion coefficient."""

    @classmethod
    def of_fields(cls, fields: Any) -> IntrinsicsStd:
        """From a camera file's ``intrinsics_std``: ``f``, ``c`` and ``k1``; one that is missing is 0.

        Raises
        ------
        InputError
            If it is no table of such numbers.
        """
        known = ("f", "c", "k1")
        if not isinstance(fields, Mapping) or not fields or not fields.keys() <= set(known):
            raise InputError(f"intrinsics_std is {fields!r}; give numbers by the names f (a fraction), c (pixels), k1")
        for name, value in fields.items():
            if isinstance(value, bool) or not isinstance(value, Real) or not 0.0 <= float(value) < math.inf:
                raise InputError(f"intrinsics_std: {name} is {value!r}, no standard deviation; give 0 or more")
        return cls(*(float(fields.get(name, 0.0)) for name in known))

    def scaled(self, by: float) -> IntrinsicsStd:
        """Of the same camera's image at another size: the principal point's goes with the pixels."""
        return replace(self, c=self.c * by)

    def of_rays(self, camera: Pinhole) -> tuple[float, float, float, float, float]:
        """Of fx and fy (relative), of cx and cy in units of the rays, and of k1."""
        return self.f, self.f, self.c / camera.fx, self.c / camera.fy, self.k1

    def to_dict(self) -> dict[str, float]:
        """Plain data, as in a camera file's ``intrinsics_std``."""
        return asdict(self)


EXACT = IntrinsicsStd(0.0, 0.0, 0.0)
"""As in a simulation."""

CALIBRATED = IntrinsicsStd(0.002, 1.0, 0.003)
"""A camera's own intrinsics, from its factory or a calibration board: 0.2 % and a pixel, by reprojection."""

NOMINAL_F, NOMINAL_C, NOMINAL_K1 = 0.02, 0.01, 0.03
"""What specimens of a model scatter by: 2 %, 1 % of the image's width, and 0.03."""

NAMES = ("exact", "calibrated", "nominal")


def named(name: str, camera: Pinhole) -> IntrinsicsStd:
    """The standard deviations of a name: exact, calibrated or nominal.

    Raises
    ------
    UsageError
        For another name.
    """
    known = {
        "exact": EXACT,
        "calibrated": CALIBRATED,
        "nominal": IntrinsicsStd(NOMINAL_F, NOMINAL_C * camera.width, NOMINAL_K1),
    }
    if name not in known:
        raise UsageError(f"unknown intrinsics '{name}'; known are {', '.join(NAMES)}")
    return known[name]
