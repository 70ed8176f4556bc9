"""A depth image as the core reads it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.types.camera import Camera


@dataclass(frozen=True, eq=False)
class DepthFrame:
    """A depth image with its camera, in the camera's optical frame."""

    depth: NDArray[Any]
    """(H, W) float32 or float64 metres, or uint16 raw units of `unit` metres; z, not ray length."""
    camera: Camera
    """Intrinsics of the same size."""
    rays: NDArray[np.float64] | None = None
    """(H, W, 2) ``camera.rays()``; None where the core is to form them from a camera without distortion."""
    unit: float = 1.0
    """Metres per unit of `depth`."""
    mask: NDArray[np.bool_] | None = None
    """(H, W) True for the pixels to use; None for all."""

    @classmethod
    def of(
        cls, depth: NDArray[Any], camera: Camera, unit: float = 1.0, mask: NDArray[np.bool_] | None = None
    ) -> DepthFrame:
        """With rays only where the lens distorts."""
        return cls(depth, camera, None if camera.distortion_model == "none" else camera.rays(), unit, mask)
