"""Content of a bin that is not round: a given pose, the corners of its outline, and the surface as it is seen."""

from __future__ import annotations

import math
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.content.density import Density
from siloscope.content.extras import seen_points
from siloscope.content.knowledge import TYPICAL_NOISE, WALL_STD
from siloscope.errors import UsageError
from siloscope.estimation.inputs import Prepared
from siloscope.reasons import CONTENT_REMARKS, sentence
from siloscope.sensors import UNKNOWN, SensorProfile
from siloscope.types.calibration import Calibration
from siloscope.types.content import Content, Level, Parts
from siloscope.types.floor import Floor
from siloscope.types.pose import SiloPose
from siloscope.types.remark import Remark
from siloscope.types.surface_map import SurfaceMap
from siloscope.vessel.limits import LENGTH_STD
from siloscope.vessel.vessel import Vessel

FINENESS = 240
"""Places along the longer side of the outline's box at which the surface is integrated."""

LEAST_SEEN = 0.05
"""Fraction of the outline that must be seen."""

UP = (0.0, 0.0, -1.0)
"""In the silo frame, whose z points down."""


POSE_STD = (5e-3, LENGTH_STD)
"""Standard deviations of a given pose's angles, rad (a phone's level), and of its place, m."""

TURN, SHIFT = 1e-5, 1e-5
"""Half the steps of the central differences by a pose's angles, rad, and place, m."""


@dataclass(frozen=True, eq=False)
class PlacedPose:
    """The camera's pose in a bin with an outline, and how well it is known."""

    pose: SiloPose
    covariance: NDArray[np.float64]
    """(4, 4) of r_x, r_y, t_x, t_y."""
    assumed: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        pose: SiloPose | None,
        std: tuple[float, float] | None,
        calibration: Calibration | str | PathLike[str] | None,
    ) -> PlacedPose:
        """A given pose, else a calibration's.

        Raises
        ------
        UsageError
            Where there is none: such a bin has no axis that a frame could show.
        """
        if pose is not None:
            angle, place = std or POSE_STD
            if not (angle >= 0.0 and place >= 0.0 and math.isfinite(angle + place)):
                raise UsageError(f"the pose's deviations must be 0 or more, got {angle} rad and {place} m")
            said = () if std else (f"the given pose to {1e3 * angle:g} mrad and {1e3 * place:g} mm",)
            return cls(pose, np.diag([angle**2] * 2 + [place**2] * 2), said)
        silo = Calibration.load(calibration) if isinstance(calibration, str | PathLike) else calibration
        if silo is None or silo.pose is None:
            raise UsageError("a bin with an outline has no axis to be found; give --pose r_x,r_y,t_x,t_y")
        return cls(silo.pose, np.zeros((4, 4)) if silo.covariance is None else silo.covariance)


def outlined(
    prepared: Prepared,
    placed: PlacedPose,
    vessel: Vessel,
    profile: SensorProfile | None,
    density: Density | None,
    source: str,
) -> Content:
    """The ullage in an outline, and the content over a flat floor that `cylinder` (the bin's depth) and `top` place.

    Parameters
    ----------
    prepared : PreparedDepth or PreparedPoints
        The frame.
    placed : PlacedPose
        The camera's.
    vessel : Vessel
        With an outline; its heights are those of the bin's upright walls.
    profile : SensorProfile, optional
        The sensor's bias and noise.
    density : Density, optional
        For the mass.
    source : str
        Name of the frame.
    """
    sensor = profile or UNKNOWN
    seen_by_camera = seen_points(prepared, sensor.bias)
    noise = _noise(sensor.noise or TYPICAL_NOISE, seen_by_camera)
    points = placed.pose.to_silo(seen_by_camera)
    corners = np.array(vessel.outline or ())
    inside = within(points[:, :2], corners)
    core = _core.content_relief(np.ascontiguousarray(points[inside]), UP, None, noise)
    surface = None if core is None else SurfaceMap(core, core.ceiling)
    x, y, area = _places(corners)
    seen = 0.0 if surface is None else float(_at(surface, surface.seen, x, y).mean())
    if surface is None or seen < LEAST_SEEN:
        remark = Remark("too-little-seen", f"{100 * seen:.0f} % of the outline is seen", True)
        message = sentence(CONTENT_REMARKS[remark.code], f" ({remark.seen})")
        return Content("refused", remark.code, message, quality=(remark,), source=source)
    z = -surface.height(_in_map(surface, x, y))
    top = 0.0 if vessel.top is None else vessel.fill_top or 0.0
    noise_std, unseen_std = _deviations(surface, x, y, area)
    edge = _length(corners) * WALL_STD * (float(np.mean(z)) - top)
    top_std = 0.0 if vessel.top is None else LENGTH_STD * area * len(x)
    by = area * len(x) * _by_pose(surface, placed.pose, x, y, z)
    pose_std = math.sqrt(max(float(by @ placed.covariance @ by), 0.0))
    parts = Parts(pose_std, math.hypot(edge, top_std), 0.0, noise_std, unseen_std, 0.0)
    std = math.hypot(*parts.to_dict().values())
    ullage = float((z - top).sum() * area)
    base: dict[str, Any] = {
        "ullage": ullage,
        "ullage_std": std,
        "ullage_parts": parts,
        "coverage": seen,
        "surface": surface,
        "shape": surface.shape,
        "source": source,
        "assumed": placed.assumed,
    }
    depth = vessel.sheet.cylinder
    told = vessel.sheet.bottom == "flat" or vessel.sheet.cone == 0.0
    flat = told and depth is not None and vessel.top is not None
    floor = (vessel.top or 0.0) + (depth or 0.0) if flat else float(z.max())
    mean, low, high = (float(floor - v) for v in (z.mean(), z.max(), z.min()))
    level = Level(mean, low, high, std=std / (area * len(x)))
    if not flat:
        remark = Remark(
            "bottom-unknown", "of a bin with an outline: bottom flat, cylinder (its depth) and top place it"
        )
        missing = ("bottom",) if vessel.sheet.bottom != "flat" else ("top",) if vessel.top is None else ("cylinder",)
        said = f"Volume unavailable: {remark.seen}."
        return Content(
            "ok", None, said, level=level, height_datum="lowest-seen", quality=(remark,), missing=missing, **base
        )
    capacity = (floor - top) * area * len(x)
    volume = capacity - ullage
    mass = None if density is None else density.loose * volume
    mass_std = None if density is None else math.hypot(density.loose * std, density.std * volume)
    return Content("ok", volume=volume, volume_std=std, parts=parts, capacity=capacity, capacity_from="datasheet",
                   level=level, height_datum="floor", floor=Floor("flat", "datasheet"), mass=mass, mass_std=mass_std,
                   density=None if density is None else density.to_dict(), **base)  # fmt: skip


def _by_pose(
    surface: SurfaceMap, pose: SiloPose, x: NDArray[np.float64], y: NDArray[np.float64], z: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Derivatives (4,) of the mean height z over places by the pose: the surface moves with its points."""
    step = surface.cell
    falls = [
        (surface.height(_in_map(surface, x - a, y - b)) - surface.height(_in_map(surface, x + a, y + b))) / (2.0 * step)
        for a, b in ((step, 0.0), (0.0, step))
    ]
    T = pose.T_silo_camera
    seen = (np.column_stack([x, y, z]) - T[:3, 3]) @ T[:3, :3]
    made = []
    for k, half in enumerate((TURN, TURN, SHIFT, SHIFT)):
        values = np.array([pose.r_x, pose.r_y, pose.t_x, pose.t_y])
        ends = [SiloPose(*(values + sign * half * np.eye(4)[k])).to_silo(seen) for sign in (1.0, -1.0)]
        dx, dy, dz = ((ends[0] - ends[1]) / (2.0 * half)).T
        made.append(float((dz - falls[0] * dx - falls[1] * dy).mean()))
    return np.array(made)


def _noise(law: tuple[float, ...], points: NDArray[np.float64]) -> float:
    """Standard deviation of a point at the frame's usual distance, m."""
    far = float(np.median(np.linalg.norm(points, axis=1))) if len(points) else 1.0
    return float(max(law[0], law[1] + law[2] * far + law[3] * far**2 + law[4] * far ** law[5]))


def within(places: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which places (N, 2) lie in a polygon, by the even-odd rule."""
    x, y = places.T
    inside = np.zeros(len(places), np.bool_)
    for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        crosses = (y0 > y) != (y1 > y)
        with np.errstate(divide="ignore", invalid="ignore"):
            inside ^= crosses & (x < (x1 - x0) * (y - y0) / (y1 - y0) + x0)
    return inside


def _places(corners: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Places on a grid within the outline, and the area of each so that they fill it."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    step = float((high - low).max()) / FINENESS
    lines = [np.arange(a + step / 2.0, b, step) for a, b in zip(low, high, strict=True)]
    x, y = (v.ravel() for v in np.meshgrid(*lines))
    kept = within(np.column_stack([x, y]), corners)
    a, b = corners, np.roll(corners, -1, axis=0)
    whole = 0.5 * abs(float((a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1]).sum()))
    return x[kept], y[kept], whole / max(int(kept.sum()), 1)


def _length(corners: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(corners - np.roll(corners, -1, axis=0), axis=1).sum())


def _in_map(surface: SurfaceMap, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places of the silo frame in the map's own axes."""
    return np.asarray(np.column_stack([x, y]) @ surface.axes[:2, :2].T)


def _at(
    surface: SurfaceMap, values: NDArray[np.generic], x: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.float64]:
    rows, columns = surface.cells(_in_map(surface, x, y))
    return np.asarray(values[rows, columns], np.float64)


def _deviations(
    surface: SurfaceMap, x: NDArray[np.float64], y: NDArray[np.float64], area: float
) -> tuple[float, float]:
    """What the seen cells' noise (apart from each other) and the unseen ones (all together) leave, m³."""
    rows, columns = surface.cells(_in_map(surface, x, y))
    side = len(surface.x)
    share = np.bincount(rows * side + columns, minlength=side * side).reshape(side, side) * area
    std = np.nan_to_num(surface.std) * share
    seen = surface.seen
    return float(np.sqrt((std[seen] ** 2).sum())), float(std[~seen].sum())
