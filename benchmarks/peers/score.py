"""How far an answer is off."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from frames import Shown
from methods import Found

from siloscope.reproduction.trials import STRIDE
from siloscope.simulation import metrics


def distances(frame: Shown, found: Sequence[Found]) -> list[float]:
    """PC average distance (Eq. 11) on the whole frame of each answer, m; NaN where there is none."""
    poses = [one.pose for one in found if one.pose is not None]
    measured = iter(metrics.pc_average_distances(poses, frame.pose, frame.whole, frame.camera, stride=STRIDE))
    return [np.nan if one.pose is None else next(measured) for one in found]
