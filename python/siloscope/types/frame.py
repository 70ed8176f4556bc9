"""One depth frame, however it was stored."""

from __future__ import annotations

from dataclasses import dataclass, field
from hashlib import sha256
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.types.camera import Camera


@dataclass(frozen=True, eq=False)
class Frame:
    """One frame in the camera's optical frame, in metres.

    Either a depth image with its camera (`depth` and `camera`), or points (`points`).

    Attributes
    ----------
    depth : float32 or uint16 array (H, W), or None
        Depth z (not ray length). Floating point is metres; uint16 is raw units of `depth_unit` metres.
        0, NaN, negative and (raw) 65535 are "no measurement".
    camera : Camera or None
        Intrinsics; None for points, and for an image whose file names none.
    depth_unit : float or None
        Metres per raw unit; None for floating-point depth and where the file does not tell.
    points : float array (N, 3), or (H, W, 3) where organised, or None
        Points in metres; NaN rows are "no measurement".
    labels : integer array of the shape of the pixels or points, or None
        A segmentation that came with the file.
    timestamp : float or None
        Seconds since 1970 (UTC) where the source has absolute time, else since its start.
    gravity : float array (3,) or None
        Direction of gravity in the camera frame as the sensor's accelerometer has it, in m/s² (pointing down).
    source : str
        File, and the frame in it, for messages.
    provenance : dict
        What is known about where the frame comes from: format, stream, device, unit and its origin.
    """

    depth: NDArray[Any] | None = None
    camera: Camera | None = None
    depth_unit: float | None = None
    points: NDArray[Any] | None = None
    labels: NDArray[np.integer[Any]] | None = None
    timestamp: float | None = None
    gravity: NDArray[np.float64] | None = None
    source: str = "frame"
    provenance: dict[str, Any] = field(default_factory=dict)

    @property
    def digest(self) -> str:
        """Hash of the measurements, by which a frame is known again whatever its file is called."""
        return digest_of(self.depth if self.depth is not None else self.points)


def digest_of(values: NDArray[Any] | None) -> str:
    """Hash of measurements, in hexadecimal."""
    return sha256(b"" if values is None else np.ascontiguousarray(values).data).hexdigest()[:32]
