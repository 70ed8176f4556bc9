"""A depth frame with a quarter of its pixels, for where that is enough."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from siloscope.types.camera import Camera
from siloscope.types.frame import Frame

STEP = 2
"""Rows and columns from one pixel that is kept to the next."""

LEAST = 640
"""Columns of the smallest image that is decimated: half as many still show where wall ends and feed begins."""


def decimated(data: Any, camera: Camera | None) -> Frame | None:
    """Every second row and column of a depth image, with the camera that sees just these.

    `data` is a frame, or an array of depth (H, W), whose camera is `camera` where that is given. None where there is
    nothing to decimate: points, a small image, or one whose camera is not known or of another size.
    """
    frame = data if isinstance(data, Frame) else Frame(depth=data) if type(data) is np.ndarray else Frame()
    camera = camera or frame.camera
    if camera is None or frame.depth is None or camera.width < LEAST:
        return None
    if frame.depth.shape != (camera.height, camera.width):
        return None
    return replace(frame, depth=np.ascontiguousarray(frame.depth[::STEP, ::STEP]), camera=decimated_camera(camera))


@lru_cache(maxsize=4)
def decimated_camera(camera: Camera) -> Camera:
    """The camera that sees every second row and column of another."""
    return replace(
        camera,
        width=-(-camera.width // STEP),
        height=-(-camera.height // STEP),
        fx=camera.fx / STEP,
        fy=camera.fy / STEP,
        cx=camera.cx / STEP,
        cy=camera.cy / STEP,
        intrinsics_std=camera.intrinsics_std and camera.intrinsics_std.scaled(1.0 / STEP),
    )
