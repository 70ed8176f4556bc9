"""A depth frame as a picture for people: near is light, far is dark, no measurement is grey."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from siloscope.types.frame import Frame

WIDEST = 480
"""Pixels; larger frames are thinned to it."""

_STOPS = np.array([[250, 232, 184], [217, 159, 61], [140, 88, 38], [58, 40, 30]], np.float64)
"""From near to far, sRGB."""

NOT_MEASURED = 65_535
"""Raw value of a pixel without a measurement, beside 0."""

_NOTHING = np.array([112, 120, 122], np.uint8)


def drawn(frame: Frame) -> bytes | None:
    """PNG of a frame's depth; None for a cloud of points, which is no picture."""
    if frame.depth is None:
        return None
    from PIL import Image

    stride = -(-frame.depth.shape[1] // WIDEST)
    buffer = io.BytesIO()
    Image.fromarray(coloured(frame.depth[::stride, ::stride])).save(buffer, "PNG", optimize=True)
    return buffer.getvalue()


def coloured(depth: NDArray[Any]) -> NDArray[np.uint8]:
    """(H, W, 3) colours of (H, W) depths, metres or raw units; the scale spans the middle 98 % of them."""
    seen = np.isfinite(depth) & (depth > 0)
    if depth.dtype == np.uint16:
        seen &= depth != NOT_MEASURED
    picture = np.broadcast_to(_NOTHING, (*depth.shape, 3)).copy()
    if not seen.any():
        return picture
    near, far = np.quantile(depth[seen], (0.01, 0.99))
    place = np.clip((depth[seen] - near) / max(far - near, 1e-3), 0.0, 1.0) * (len(_STOPS) - 1)
    channels = [np.interp(place, np.arange(len(_STOPS)), stops) for stops in _STOPS.T]
    picture[seen] = np.rint(np.stack(channels, axis=-1)).astype(np.uint8)
    return picture
