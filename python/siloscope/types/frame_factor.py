"""What one frame says about all parameters of the joint fit, and frames added up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.schema.frame_factor import packed
from siloscope.types.by_value import ByValue

if TYPE_CHECKING:
    from siloscope.schema.frame_factor import Factor, Summed

Vector = NDArray[np.float64]

GROUPS = {
    "pose": 4,
    "bias": 3,
    "camera": 5,
    "radius": 1,
    "cylinder_form": 36,
    "cone": 6,
    "cone_form": 16,
}
"""All parameters in their order, with how many each group has."""


@dataclass(frozen=True, eq=False, repr=False)
class Share(ByValue):
    """What some tiles of a frame say, about a state: ``gradient @ δ + δ @ information @ δ / 2``, in their own columns.

    Tiles of the cylinder have the columns of pose, bias, camera, radius and its form, those of the cone pose, bias,
    camera, cone and its form; "whole" are the twelve parameters of `siloscope.parameters`, for clouds.
    """

    kind: str
    information: Vector
    """Upper triangle, row by row."""
    gradient: Vector
    sensor_fraction: float
    """Fraction of the gradient's variance that the sensor's noise makes: new in every frame."""
    seen: float
    """Fraction of the frame's tiles."""

    @classmethod
    def of(cls, told: _core.Share) -> Share:
        """From the core."""
        return cls(told.kind, told.information, told.gradient, told.sensor_fraction, told.seen)

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "kind": self.kind,
            "information": packed(self.information),
            "gradient": packed(self.gradient),
            "sensor_fraction": self.sensor_fraction,
            "seen": self.seen,
        }


@dataclass(frozen=True, eq=False, repr=False)
class FrameFactor(ByValue):
    """What one frame says about all parameters, without priors: what `calibrate` fuses.

    What was known before the frame (sensor profile, diameter, gravity, intrinsics) stands beside it, because it is
    common to all frames.
    """

    state: Vector
    """(71,) all parameters where the frame's equations were made, in the order of `GROUPS`."""
    has_cylinder: bool
    has_cone: bool
    reference: float
    """Height to which the form and the cone's offset are told, m."""
    model: str
    """The frame's own most probable model."""
    hopper: bool
    """Whether it knows that its cone is the silo's own."""
    shares: tuple[Share, ...]
    bias: tuple[float, float, float]
    bias_std: tuple[float, float, float]
    radius: tuple[float, float] | None
    """By the tape, with its standard deviation, m."""
    gravity: tuple[float, float, float] | None
    """r_x and r_y by gravity with their standard deviation, rad."""
    camera_std: tuple[float, float, float, float, float]
    scale_std: float
    """Standard deviation of the depth scale where no frame can tell it, else 0."""
    rays: Vector
    """(K, 3): (x, y) of rays (x, y, 1) to some of the wall that was seen, and their information, 1/m². None where the
    depth bias is known: the equations hold far enough."""

    @classmethod
    def of(cls, told: _core.FrameFactor) -> FrameFactor:
        """From the core."""
        names = (name for name in cls.__dataclass_fields__ if name not in ("shares", "bias", "bias_std", "camera_std"))
        return cls(
            **{name: getattr(told, name) for name in names},
            shares=tuple(map(Share.of, told.shares)),
            bias=_three(told.bias),
            bias_std=_three(told.bias_std),
            camera_std=_five(told.camera_std),
        )

    @classmethod
    def read(cls, told: Factor) -> FrameFactor:
        """From a document."""
        names = (name for name in cls.__dataclass_fields__ if name not in ("shares", "rays"))
        shares = (Share(one.kind, one.information, one.gradient, one.sensor_fraction, one.seen) for one in told.shares)
        return cls(**{name: getattr(told, name) for name in names}, shares=tuple(shares), rays=told.rays.reshape(-1, 3))

    def to_dict(self) -> dict[str, Any]:
        """Plain data; vectors as base64 of little-endian doubles."""
        plain = ("has_cylinder", "has_cone", "reference", "model", "hopper", "scale_std")
        lists = ("bias", "bias_std", "camera_std")
        return {
            "state": packed(self.state),
            **{name: getattr(self, name) for name in plain},
            **{name: list(getattr(self, name)) for name in lists},
            "radius": None if self.radius is None else list(self.radius),
            "gravity": None if self.gravity is None else list(self.gravity),
            "shares": [share.to_dict() for share in self.shares],
            "rays": packed(self.rays.ravel()),
        }


@dataclass(frozen=True, eq=False, repr=False)
class SummedFactor(ByValue):
    """Frames added up, as often as each counted: what remains of frames whose own factor is not kept."""

    factor: FrameFactor
    heights: tuple[float, float]
    """To which the form and the cone's offset are told, m."""
    counted: tuple[float, ...]
    """For how many frames each share stands."""
    frames: int

    @classmethod
    def of(cls, told: _core.SummedFactor) -> SummedFactor:
        """From the core."""
        return cls(FrameFactor.of(told.factor), told.heights, tuple(told.counted), told.frames)

    @classmethod
    def read(cls, told: Summed) -> SummedFactor:
        """From a document."""
        return cls(FrameFactor.read(told.factor), told.heights, tuple(told.counted), told.frames)

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "factor": self.factor.to_dict(),
            "heights": list(self.heights),
            "counted": list(self.counted),
            "frames": self.frames,
        }


def _three(values: list[float]) -> tuple[float, float, float]:
    a, b, c = values
    return a, b, c


def _five(values: list[float]) -> tuple[float, float, float, float, float]:
    a, b, c, d, e = values
    return a, b, c, d, e
