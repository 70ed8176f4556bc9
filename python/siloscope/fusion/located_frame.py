"""A frame of a calibration that has been located."""

from __future__ import annotations

from dataclasses import dataclass

from siloscope.errors import InputError
from siloscope.types.camera import Camera
from siloscope.types.estimate import Estimate
from siloscope.types.frame_factor import FrameFactor


@dataclass(frozen=True)
class LocatedFrame:
    """One frame's estimate without its details, or why there is none."""

    name: str
    timestamp: float | None
    estimate: Estimate | None
    error: InputError | None = None
    camera: Camera | None = None
    evidence: FrameFactor | None = None
    """What it says about every parameter."""
    cone_reach: tuple[float, float] | None = None
    """Distances from the axis between which it shows the bare cone, m."""
    digest: str | None = None
    """Hash of its measurements (`Frame.digest`)."""
    made: bool = True
    """Whether it was made here; False for an estimate that the caller brought."""
