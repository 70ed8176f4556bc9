"""What is really drawn: pixels read back from a screenshot."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image


def of(locator: Any) -> NDArray[np.int64]:
    """(H, W, 3) colours of an element as the screen shows it."""
    picture = Image.open(io.BytesIO(locator.screenshot())).convert("RGB")
    return np.asarray(picture, np.int64)


def shot(page: Any, clip: dict[str, float]) -> NDArray[np.int64]:
    """(H, W, 3) colours of a part of the window as it stands, without scrolling."""
    picture = Image.open(io.BytesIO(page.screenshot(clip=clip))).convert("RGB")
    return np.asarray(picture, np.int64)


def colours(pixels: NDArray[np.int64]) -> int:
    """Number of different colours."""
    flat = pixels.reshape(-1, 3)
    return int(np.unique(flat @ np.array([65_536, 256, 1])).size)


def near(pixels: NDArray[np.int64], colour: str, within: int = 30) -> int:
    """Number of pixels near a colour such as "#24614c"."""
    wanted = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)])
    return int((np.abs(pixels - wanted).max(axis=-1) <= within).sum())


def different(one: NDArray[np.int64], other: NDArray[np.int64]) -> float:
    """Fraction of pixels that differ plainly."""
    return float((np.abs(one - other).max(axis=-1) > 24).mean())
