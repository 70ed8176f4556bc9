"""Cameras that are not quite what is told of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from siloscope.errors import UsageError
from siloscope.types.camera import Camera

PRIORS = {"exact": (0.0, 0.0, 0.0), "calibrated": (0.002, 1.0, 0.003), "nominal": (0.02, 0.01, 0.03)}
"""Standard deviations of f (relative), c and k1 by how the intrinsics are known; c in pixels, or for "nominal" as a
share of the image's width."""


def true_camera(told: Camera, known: str, seed: int) -> Camera:
    """A camera as it may truly be where `told` is said of it; the same seed gives the same one.

    Focal lengths and principal point are drawn independently. A radial distortion is drawn where none is told.

    Raises
    ------
    UsageError
        For a name that is not in `PRIORS`.
    """
    if known not in PRIORS:
        raise UsageError(f"intrinsics '{known}': give one of {', '.join(PRIORS)}")
    f, c, k1 = PRIORS[known]
    c = c * told.width if known == "nominal" else c
    n = np.random.default_rng((seed, 21)).normal(size=5)
    focal = {"fx": told.fx * (1.0 + f * n[0]), "fy": told.fy * (1.0 + f * n[1])}
    camera = replace(told, **focal, cx=told.cx + c * n[2], cy=told.cy + c * n[3])
    if k1 == 0.0 or told.distortion_model != "none":
        return camera
    return replace(camera, distortion_model="brown_conrady", distortion=(k1 * n[4], 0.0, 0.0, 0.0, 0.0))
