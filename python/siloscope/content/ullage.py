"""Free space between the surface and the height up to which the vessel is filled. It needs no bottom."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.content.knowledge import Knowledge
from siloscope.content.setup import CoreVessel
from siloscope.types.content import Parts
from siloscope.vessel.limits import LENGTH_STD

STEP = 1e-4
"""Half the step of the central differences by a length, m."""

GROUPS = {"pose": slice(0, 4), "geometry": slice(4, 7), "depth": slice(7, 10)}
"""Parameters by cause (`siloscope.content.knowledge.PARAMETERS`)."""


@dataclass(frozen=True)
class Ullage:
    """Free space, m³."""

    volume: float
    std: float
    parts: Parts
    derivatives: NDArray[np.float64]
    """(10,) by the parameters."""


def ullage_of(found: _core.ContentMeasure, known: Knowledge, silo: CoreVessel) -> Ullage | None:
    """The free space over the surface that the core found; None where the radius is not known.

    U = capacity - V with one floor for both, so what lies under the surface cancels: where content covers the floor, U
    does not depend on it, and a floor put out of sight does as well as the true one.

    Parameters
    ----------
    found : ContentMeasure
        The core's answer, with or without a surface.
    known : Knowledge
        Pose, lengths and their covariance.
    silo : CoreVessel
        The lengths that the core measured with.
    """
    if known.lengths.cone_only:
        return None
    filled = 0.0 if found.volume is None else found.volume.volume
    capacity = _capacity(silo)
    area = math.pi * silo[0] ** 2
    by = capacity_derivatives(silo) - found.derivatives
    edge_std = top_std(known, silo)
    if known.lengths.top_from == "datasheet":
        by[5] -= area  # the edge is placed from the joint
    parts = {name: std_by(by, known.covariance, group) for name, group in GROUPS.items()}
    parts["geometry"] = math.hypot(parts["geometry"], edge_std)
    own = {"noise": found.std.noise, "unseen": found.std.unseen, "grid": found.std.grid}
    total = math.hypot(std_by(by, known.covariance, slice(None)), edge_std, *own.values())
    return Ullage(capacity - filled, total, Parts(**parts, **own), by)


def top_std(known: Knowledge, silo: CoreVessel) -> float:
    """What the upper edge, where it is given, adds to the ullage's deviation, m³."""
    return 0.0 if known.lengths.top_from == "camera" else math.pi * silo[0] ** 2 * LENGTH_STD


@lru_cache(maxsize=64)
def _capacity(silo: CoreVessel) -> float:
    return float(_core.vessel_volume_below(silo, [silo[3]])[0])


def capacity_derivatives(silo: CoreVessel) -> NDArray[np.float64]:
    """Derivatives (10,) of the capacity by the parameters: only the lengths matter."""
    made = np.zeros(10)
    for parameter, place in ((4, 0), (5, 1), (6, 2)):
        ends = [_capacity(_moved(silo, place, sign * STEP)) for sign in (1.0, -1.0)]
        made[parameter] = (ends[0] - ends[1]) / (2.0 * STEP)
    return made


def _moved(silo: CoreVessel, place: int, step: float) -> CoreVessel:
    """The vessel with one length changed; a flat floor's two ends move together."""
    lengths = list(silo)
    lengths[place] += step
    lengths[2] = max(lengths[1], lengths[2])
    lengths[1] = min(lengths[1], lengths[2])
    return CoreVessel(*lengths)


def std_by(by: NDArray[np.float64], covariance: NDArray[np.float64], group: slice) -> float:
    """Standard deviation by some of the parameters."""
    own = np.zeros(10)
    own[group] = by[group]
    return math.sqrt(max(float(own @ covariance @ own), 0.0))
