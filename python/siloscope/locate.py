"""`locate`: one frame in, the camera's pose in its silo out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from siloscope import sensors
from siloscope.errors import UsageError
from siloscope.estimation import shape_tensor, surface
from siloscope.estimation.inputs import Prepared, PreparedDepth, PreparedPoints, prepare
from siloscope.estimation.priors import CLOUD, Priors
from siloscope.estimation.steps import NEIGHBOURS
from siloscope.sensors import SensorProfile
from siloscope.types.camera import Camera, is_number
from siloscope.types.estimate import Estimate
from siloscope.types.frame import Frame

Number = float | None


@dataclass(frozen=True)
class Settings:
    """What the caller asks for, checked."""

    profile: SensorProfile
    diameter: Number
    gravity: NDArray[np.float64] | None
    grid: Number
    neighbours: int
    threads: int
    start: Estimate | None
    ratios: bool


def locate(
    data: Frame | ArrayLike,
    camera: Camera | None = None,
    *,
    method: str = "surface",
    sensor: str | Path | SensorProfile | None = None,
    depth_unit: Number = None,
    diameter: Number = None,
    gravity: ArrayLike | None = None,
    mask: ArrayLike | None = None,
    crop: Sequence[float] | None = None,
    grid: Number = None,
    neighbours: int = NEIGHBOURS,
    threads: int = 1,
    start: Estimate | None = None,
    ratios: bool = True,
) -> Estimate:
    """Find the silo's axis in one frame, and with it the camera's pose (Eqs. 5–7).

    Parameters
    ----------
    data : Frame, or array
        A depth image (H, W), floats in metres or unsigned integers in raw units; or points (N, 3) or (H, W, 3) in the
        camera frame, metres. 0, NaN, negative depths and raw 65535 are "no measurement".
    camera : Camera, optional
        Intrinsics; wins over the frame's own. Without any, the sensor profile's nominal ones for the image's size.
    method : {"surface", "shape-tensor"}
        Cylinder and cone fitted to the wall, or the six steps of the paper's section 2.3.
    sensor : str, path or SensorProfile, optional
        Profile of the depth error (`siloscope.sensors.names()`); without one it is estimated from the frame.
    depth_unit : float, optional
        Metres per raw unit; required for integer depth whose frame does not tell.
    diameter : float, optional
        Inner diameter of the silo's cylinder in metres, which fixes the scale of a sensor that is not known.
    gravity : array (3,), optional
        Direction of gravity in the camera frame, any length; z is positive, as the camera looks down.
    mask : array of bool, optional
        True where the silo is, of the frame's shape.
    crop : (xmin, xmax, ymin, ymax, zmin, zmax), optional
        Box in the camera frame, metres; only points inside are used.
    grid : float, optional
        Side of the voxel grid's cells, m; 0.05 (step 1), or less for small clouds.
    neighbours : int
        Neighbours for normals and shape tensors (method ``shape-tensor``).
    threads : int
        Threads for what can be shared; the answer does not depend on it.
    start : Estimate, optional
        An answer for another frame of the same camera in the same silo (method ``surface``, depth images). The wall is
        looked for there first, which is quicker; a frame that does not plainly confirm it is searched as without.
    ratios : bool
        Whether to work out how much of the frame is cylinder, cone and feed (method ``surface``).

    Returns
    -------
    Estimate
        With status "refused" and a reason where the frame does not show enough wall for a trustworthy answer.

    Raises
    ------
    InputError
        For a frame that can't be used.
    UsageError
        For settings that can't be.
    """
    run = METHODS.get(method)
    if run is None:
        raise UsageError(f"unknown method '{method}'; known are {', '.join(METHODS)}")
    profile = sensors.load(sensor)
    settings = Settings(
        profile,
        _bounded("diameter", diameter, 0.01, 200.0),
        _downwards(gravity),
        _bounded("grid", grid, 1e-4, 10.0),
        int(_whole("neighbours", neighbours, 6, 500)),
        int(_whole("threads", threads, 1, 256)),
        start,
        ratios,
    )
    prepared = prepare(data, camera, profile, depth_unit=depth_unit, mask=mask, crop=crop)
    if settings.gravity is None and prepared.gravity is not None:
        settings = replace(settings, gravity=_direction(prepared.gravity))
    return run(prepared, settings, _config(method, prepared, settings))


def _surface(frame: Prepared, settings: Settings, config: dict[str, Any]) -> Estimate:
    profile = CLOUD if isinstance(frame, PreparedPoints) else settings.profile
    priors = Priors(profile, settings.diameter, settings.gravity)
    if isinstance(frame, PreparedPoints):
        return surface.fit_points(frame.points, priors, grid=settings.grid, threads=settings.threads, config=config)
    start, ratios = settings.start, settings.ratios
    return surface.fit_depth(frame.depth, frame.camera, priors, start=start, ratios=ratios, config=config)


def _shape_tensor(frame: Prepared, settings: Settings, config: dict[str, Any]) -> Estimate:
    chosen = shape_tensor.Settings(grid=settings.grid, neighbours=settings.neighbours, threads=settings.threads)
    if isinstance(frame, PreparedPoints):
        return shape_tensor.fit_points(frame.points, chosen, config)
    return shape_tensor.fit_depth(frame.depth, frame.camera, chosen, config)


METHODS: dict[str, Callable[[Prepared, Settings, dict[str, Any]], Estimate]] = {
    "surface": _surface,
    "shape-tensor": _shape_tensor,
}
"""The methods by name."""


def _config(method: str, prepared: Prepared, settings: Settings) -> dict[str, Any]:
    """The effective settings, written beside every result."""
    return {
        "method": method,
        "sensor": settings.profile.to_dict(),
        "diameter": settings.diameter,
        "gravity": None if settings.gravity is None else settings.gravity.tolist(),
        "grid": settings.grid,
        "neighbours": settings.neighbours,
        "threads": settings.threads,
        "camera": prepared.camera.to_dict() if isinstance(prepared, PreparedDepth) else None,
        **prepared.config,
    }


def _bounded(name: str, value: Number, least: float, most: float) -> Number:
    if value is None:
        return None
    if not is_number(value) or not least <= value <= most:
        raise UsageError(f"{name} must be between {least:g} and {most:g} m, got {value}")
    return float(value)


def _whole(name: str, value: float, least: int, most: int) -> float:
    if not is_number(value) or not least <= value <= most or value != int(value):
        raise UsageError(f"{name} must be a whole number between {least} and {most}, got {value}")
    return value


def _downwards(gravity: ArrayLike | None) -> NDArray[np.float64] | None:
    """Gravity as a caller gives it, who may mistake an accelerometer's reading for it."""
    vector = _direction(gravity)
    if vector is not None and vector[2] < 0.0:
        raise UsageError(
            f"gravity {vector.tolist()} points out of the camera's back; an accelerometer at rest reads minus gravity: "
            "turn all three signs"
        )
    return vector


def _direction(gravity: ArrayLike | None) -> NDArray[np.float64] | None:
    if gravity is None:
        return None
    try:
        vector = np.asarray(gravity, np.float64)
    except (TypeError, ValueError):
        vector = np.empty(0)
    if vector.shape != (3,) or not (np.abs(vector) < 1e100).all() or not np.linalg.norm(vector) > 0:
        raise UsageError(f"gravity must be three numbers, not all zero, got {gravity}")
    return vector
