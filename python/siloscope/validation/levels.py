"""Frames by the level of the feed in them, as far as the wall that they show tells it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from siloscope.validation.frames import SeenFrame

MOST_LEVELS = 6
"""Levels into which a sequence is cut."""

STANDING = 0.05
"""Feed stands where all frames show as many wall tiles, but for this fraction."""


def by_level(frames: Sequence[SeenFrame]) -> list[list[int]]:
    """Numbers of the frames of each level, the fullest first; single frames in order where the feed stands."""
    shown = np.array([int(one.shown.sum()) for one in frames], float)
    count = min(MOST_LEVELS, len(frames))
    order = np.arange(len(frames)) if stands(frames) else np.argsort(shown, kind="stable")
    return [sorted(part.tolist()) for part in np.array_split(order, count) if len(part)]


def stands(frames: Sequence[SeenFrame]) -> bool:
    """Whether the feed stands in all frames."""
    shown = [int(one.shown.sum()) for one in frames]
    return max(shown) - min(shown) <= STANDING * max(shown)
