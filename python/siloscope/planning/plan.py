"""Compares places, picks one, and says which levels a calibration needs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from siloscope import sensors
from siloscope.calibrate import calibrate
from siloscope.errors import UsageError
from siloscope.planning.expectation import Expected, View, axis_std, expected, with_content
from siloscope.planning.places import Placement, placements
from siloscope.sensors import SensorProfile
from siloscope.types.by_value import ByValue
from siloscope.types.calibration import Calibration
from siloscope.types.camera import Camera
from siloscope.types.intrinsics import IntrinsicsStd
from siloscope.vessel.vessel import Vessel, load

SCHEMA = "siloscope.plan/1"
LEVELS = (0.1, 0.35, 0.6, 0.85)
"""Levels at which a place is looked at, as fractions of the height from the lowest point to the upper edge."""
DROP = 0.1
"""Metres from the wall's upper edge down to the camera, where the vessel file has no `top`."""
WORTH = 0.95
"""A further level is worth a frame if it brings the deviation below this fraction of what it was."""


@dataclass(frozen=True, eq=False, repr=False)
class Place(ByValue):
    """A placement with what it would give at every level."""

    placement: Placement
    levels: tuple[Expected, ...]

    @property
    def answered(self) -> int:
        """Levels at which one frame alone is answered."""
        return sum(one.reason is None for one in self.levels)

    @property
    def worst_volume_std(self) -> float | None:
        """Largest deviation of the volume over the levels with one, m³."""
        return max((one.volume_std for one in self.levels if one.volume_std is not None), default=None)

    @property
    def best_axis_std(self) -> float | None:
        """Smallest deviation of the axis over the levels: that of a calibration is no larger. m."""
        return min((one.axis_std for one in self.levels if one.axis_std is not None), default=None)

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            **self.placement.to_dict(),
            "answered": self.answered,
            "worst_volume_std_m3": self.worst_volume_std,
            "best_axis_std_m": self.best_axis_std,
            "levels": [one.to_dict() for one in self.levels],
        }


@dataclass(frozen=True, eq=False, repr=False)
class Plan(ByValue):
    """All places, best first, and how to calibrate at the best."""

    view: View
    drop: float
    places: tuple[Place, ...]
    calibration_levels: tuple[tuple[float, float], ...]
    """Levels of which a calibration needs a frame, most useful first, each with the deviation of the axis then, m."""
    assumed: tuple[str, ...]

    @property
    def best(self) -> Place:
        """Where to hang the camera."""
        return self.places[0]

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "schema": SCHEMA,
            "vessel": self.view.vessel.to_dict(),
            "sensor": self.view.sensor.name,
            "drop": self.drop,
            "best": self.best.to_dict(),
            "places": [place.to_dict() for place in self.places],
            "calibration_levels": [{"level": level, "axis_std_m": std} for level, std in self.calibration_levels],
            "assumed": list(self.assumed),
        }


def plan(
    vessel: Vessel | str | Path,
    sensor: str | Path | SensorProfile,
    camera: Camera | None = None,
    *,
    drop: float | None = None,
    levels: Sequence[float] = LEVELS,
    intrinsics: str | IntrinsicsStd | None = None,
    progress: Callable[[Iterable[Any], str, int], Iterable[Any]] | None = None,
) -> Plan:
    """Compare places for a camera under a vessel's roof by the deviations to expect there.

    Every place is judged by the covariance of the surface fit of a frame with one draw of the noise: what noise,
    bias, form of the wall and intrinsics leave open. Places are ordered by how many levels are answered, then by the
    volume's deviation, or the axis' where there is none.

    Parameters
    ----------
    vessel : Vessel or path
        With diameter, cylinder and bottom.
    sensor : str, path or SensorProfile
        Its error profile.
    camera : Camera, optional
        Intrinsics; the first of the profile's nominal ones unless given.
    drop : float, optional
        Metres from the wall's upper edge down to the camera; the vessel's `top`, or 0.1.
    levels : sequence of float
        Where the feed meets the wall, as fractions of the height from the lowest point to the upper edge, 0 to 1.
    intrinsics : {"exact", "calibrated", "nominal"} or IntrinsicsStd, optional
        As for `siloscope.locate`.
    progress : callable, optional
        Called with what is run through, a label and the number.

    Raises
    ------
    UsageError
        If the vessel lacks lengths, no camera is known, a level can't be, or no place is answered at any level.
    """
    about = vessel if isinstance(vessel, Vessel) else load(vessel)
    if not levels or any(not 0.0 <= level < 1.0 for level in levels):
        raise UsageError("levels must lie between 0 and below 1: fractions of the height up to the upper edge")
    down, assumed = _drop(about, drop)
    profile = sensor if isinstance(sensor, SensorProfile) else sensors.load(sensor)
    view = View.of(about, down, profile, camera, intrinsics)
    every = list(placements(view.inside))
    shown = progress(every, "planning", len(every)) if progress else every
    places = sorted((_place(view, placement, levels) for placement in shown), key=_rank)
    if not places[0].answered:
        raise UsageError("no place under the roof shows enough wall at any level; try a camera with a wider view")
    return Plan(view, down, tuple(places), _calibration_levels(places[0], view), assumed)


def _drop(vessel: Vessel, drop: float | None) -> tuple[float, tuple[str, ...]]:
    if drop is not None:
        if not drop > 0.0:
            raise UsageError(f"drop must be above 0 m: the camera hangs below the wall's upper edge, got {drop:g}")
        return drop, ()
    if vessel.top is not None and vessel.top < 0.0:
        return -vessel.top, ()
    return DROP, (f"the camera hangs {DROP:g} m below the wall's upper edge",)


def _place(view: View, placement: Placement, levels: Sequence[float]) -> Place:
    seen = [expected(view, placement, level) for level in levels]
    calibration = _calibration(seen, view)
    if calibration is not None:
        seen = [with_content(view, one, calibration) for one in seen]
    return Place(placement, tuple(seen))


def _calibration(seen: Iterable[Expected], view: View) -> Calibration | None:
    """What the answered levels would fuse to."""
    answered = [one.estimate for one in seen if one.reason is None and one.estimate is not None]
    made = calibrate(answered, camera=view.camera, sensor=view.sensor, bottom=_bottom(view)) if answered else None
    return made if made is not None and made.pose is not None else None


def _bottom(view: View) -> str | None:
    sheet = view.vessel.sheet
    return sheet.bottom or ("cone" if sheet.cone else None)


def _rank(place: Place) -> tuple[float, float, float]:
    volume, axis = place.worst_volume_std, place.best_axis_std
    far = float("inf")
    return -place.answered, far if volume is None else volume, far if axis is None else axis


def _calibration_levels(place: Place, view: View) -> tuple[tuple[float, float], ...]:
    """Greedy choice: the level that helps most, then the next, while one is worth its frame."""
    left = [one for one in place.levels if one.axis_std is not None]
    chosen: list[Expected] = []
    made: list[tuple[float, float]] = []
    while left:
        stds = [(_axis_std([*chosen, one], view), one) for one in left]
        std, best = min(stds, key=lambda pair: pair[0])
        if made and std > WORTH * made[-1][1]:
            break
        chosen.append(best)
        left.remove(best)
        made.append((best.level, std))
    return tuple(made)


def _axis_std(seen: Sequence[Expected], view: View) -> float:
    calibration = _calibration(seen, view)
    if calibration is None or calibration.covariance is None:
        return float("inf")
    return axis_std(calibration.covariance, view.inside.lowest)
