"""What a caller asks of `locate`, checked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from siloscope.errors import UsageError
from siloscope.estimation.contradictions import trusted
from siloscope.estimation.inputs import FROM_ORIGIN, RESAMPLED, Prepared, PreparedDepth
from siloscope.sensors import SensorProfile
from siloscope.types.camera import is_number
from siloscope.types.estimate import Estimate
from siloscope.types.intrinsics import CALIBRATED, EXACT, NAMES, IntrinsicsStd, named

Number = float | None

RAY_STD = 0.002
"""Direction of the rays of a cloud that is no camera's, rad: as a pixel of a calibrated camera."""


@dataclass(frozen=True)
class Settings:
    """What the caller asks for, checked."""

    profile: SensorProfile
    diameter: Number
    gravity: NDArray[np.float64] | None
    grid: Number
    neighbours: int
    threads: int
    start: Estimate | None
    ratios: bool
    intrinsics: str | IntrinsicsStd | None
    trust: frozenset[str] = frozenset()
    """Codes of contradictions that only warn."""
    told_cone: bool = False
    """Whether the vessel is said to end in a cone about its own axis."""
    gravity_given: bool = False
    """Whether gravity is the caller's, not the frame's own."""
    gravity_is_behind: bool = False
    """Whether gravity points out of the camera's back, and was turned round."""

    @classmethod
    def checked(
        cls,
        profile: SensorProfile,
        *,
        diameter: Number,
        gravity: ArrayLike | None,
        grid: Number,
        neighbours: int,
        threads: int,
        start: Estimate | None,
        ratios: bool,
        intrinsics: str | IntrinsicsStd | None,
        trust: str | Sequence[str] = (),
        told_cone: bool = False,
    ) -> Settings:
        """Raises `UsageError` for a setting outside its bounds."""
        return cls(
            profile,
            _bounded("diameter", diameter, 0.01, 200.0),
            _direction(gravity),
            _bounded("grid", grid, 1e-4, 10.0),
            _whole("neighbours", neighbours, 6, 500),
            _whole("threads", threads, 1, 256),
            start,
            ratios,
            intrinsics if isinstance(intrinsics, IntrinsicsStd | None) else _one_of("intrinsics", intrinsics, NAMES),
            trusted(trust),
            told_cone,
        )

    def with_gravity_of(self, prepared: Prepared) -> Settings:
        """With gravity in the optical frame: the caller's, who gives it in the file's, else the frame's own.

        To a cloud's fit it is a line's direction, and a caller may have its signs from an accelerometer: both are made
        to point forward. What an image's recording says stays, and the fit refuses a camera above the horizon.
        """
        turn = prepared.turn
        given = self.gravity is not None
        if self.gravity is None:
            down = None if prepared.gravity is None else _direction(prepared.gravity)
        else:
            down = self.gravity if turn is None else turn.rotation @ self.gravity
        recorded = self.gravity is None and isinstance(prepared, PreparedDepth)
        if down is None or down[2] >= 0.0 or recorded:
            return replace(self, gravity=down, gravity_given=given)
        return replace(self, gravity=-down, gravity_given=given, gravity_is_behind=True)

    def intrinsics_std(self, frame: Prepared) -> IntrinsicsStd:
        """How exactly the intrinsics of a frame are known; of a cloud's rays as of a calibrated camera's."""
        if frame.camera is None:
            return EXACT
        if isinstance(self.intrinsics, IntrinsicsStd):
            return self.intrinsics
        if self.intrinsics is None and frame.camera.intrinsics_std is not None:
            return frame.camera.intrinsics_std
        free_rays = frame.config.get("cloud") == RESAMPLED or frame.config.get("rays") == FROM_ORIGIN
        if free_rays and self.intrinsics in (None, "calibrated"):
            return IntrinsicsStd(CALIBRATED.f, RAY_STD * frame.camera.fx, CALIBRATED.k1)
        name = self.intrinsics or ("nominal" if "intrinsics" in frame.config else "calibrated")
        return self.profile.nominal_std(frame.camera) if name == "nominal" else named(name, frame.camera)

    def effective(self, method: str, prepared: Prepared) -> dict[str, Any]:
        """The effective settings, written beside every result."""
        return {
            "method": method,
            "sensor": self.profile.to_dict(),
            "diameter": self.diameter,
            "gravity": None if self.gravity is None else self.gravity.tolist(),
            "grid": self.grid,
            "neighbours": self.neighbours,
            "threads": self.threads,
            "camera": prepared.camera.to_dict() if isinstance(prepared, PreparedDepth) else None,
            "intrinsics_std": self.intrinsics_std(prepared).to_dict() if isinstance(prepared, PreparedDepth) else None,
            **prepared.config,
        }


def _one_of(name: str, value: str, known: tuple[str, ...]) -> str:
    if value not in known:
        raise UsageError(f"unknown {name} '{value}'; known are {', '.join(known)}")
    return value


def _bounded(name: str, value: Number, least: float, most: float) -> Number:
    if value is None:
        return None
    if not is_number(value) or not least <= value <= most:
        raise UsageError(f"{name} must be between {least:g} and {most:g} m, got {value}")
    return float(value)


def _whole(name: str, value: float, least: int, most: int) -> int:
    if not is_number(value) or not least <= value <= most or value != int(value):
        raise UsageError(f"{name} must be a whole number between {least} and {most}, got {value}")
    return int(value)


def _direction(gravity: ArrayLike | None) -> NDArray[np.float64] | None:
    if gravity is None:
        return None
    try:
        vector = np.asarray(gravity, np.float64)
    except (TypeError, ValueError):
        vector = np.empty(0)
    if vector.shape != (3,) or not (np.abs(vector) < 1e100).all() or not np.linalg.norm(vector) > 0:
        raise UsageError(f"gravity must be three numbers, not all zero, got {gravity}")
    return vector
