"""One frame in, the pose out: every method behind one function."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from siloscope import sensors, surface
from siloscope.camera import Camera
from siloscope.errors import InputError, UsageError
from siloscope.estimate import Estimate
from siloscope.frame import Frame
from siloscope.region import depth_metres
from siloscope.sensors import SensorProfile


def locate(
    frame: Frame | ArrayLike,
    camera: Camera | None = None,
    *,
    method: str = "surface",
    sensor: str | Path | SensorProfile | None = None,
    depth_unit: float | None = None,
    diameter: float | None = None,
    gravity: ArrayLike | None = None,
    mask: ArrayLike | None = None,
    grid: float = 0.05,
    neighbours: int = 30,
    threads: int = 1,
) -> Estimate:
    """Find the silo's axis in one frame, and so the camera's pose in the silo.

    Parameters
    ----------
    frame : Frame, or array
        A frame as `siloscope.frames` gives it; or depth (H, W), floating point in metres or uint16 in raw units.
    camera : Camera
        Intrinsics of a depth array; wins over the frame's own.
    method : str
        One of `METHODS`: ``surface`` fits the wall itself.
    sensor : str, path or SensorProfile, optional
        The sensor's depth error (`siloscope.sensors.names`); without it bias and noise are estimated with the pose.
    depth_unit : float, optional
        Metres per raw unit; required for uint16 depth unless the frame has it.
    diameter : float, optional
        Inner diameter of the cylinder by tape, metres: fixes the depth's scale.
    gravity : (3,), optional
        Direction of gravity in the camera frame, any length; the frame's own unless given.
    mask : boolean array of the frame's shape, optional
        What belongs to the silo; all unless given.
    grid : float
        Edge of the voxel grid's cells, metres (step 1).
    neighbours : int
        Neighbours k of normals and shape tensors (step 2).
    threads : int
        Threads to use.

    Returns
    -------
    Estimate
        With status ``refused`` and a reason where the frame does not show enough wall.

    Raises
    ------
    InputError
        Where the frame can't be used: no camera, a camera of another size, no unit, another shape of mask.
    UsageError
        For an unknown method or sensor, or a setting outside its bounds.
    """
    if method not in METHODS:
        raise UsageError(f"unknown method '{method}'; known are {', '.join(METHODS)}")
    known = _masked(_completed(_as_frame(frame), camera, depth_unit), mask)
    down = _gravity(known.gravity if gravity is None else gravity)
    settings = Settings(sensors.load(sensor), diameter, down, grid, neighbours, threads)
    return METHODS[method](known, settings)


@dataclass(frozen=True)
class Settings:
    """The settings of `locate`, checked."""

    profile: SensorProfile
    diameter: float | None
    gravity: NDArray[np.float64] | None
    grid: float
    neighbours: int
    threads: int

    def __post_init__(self) -> None:
        if self.diameter is not None:
            _check("diameter", self.diameter, 0.001, 200.0, "the cylinder's inner diameter in metres")
        _check("grid", self.grid, 1e-4, 100.0, "the edge of a cell in metres, such as 0.05")
        _check("neighbours", self.neighbours, 6, 1000, "a number of points, such as 30")
        _check("threads", self.threads, 1, 256, "a number of threads")


def _check(name: str, value: float, low: float, high: float, remedy: str) -> None:
    if not (math.isfinite(value) and low <= value <= high):
        raise UsageError(f"{name} {value} is not between {low:g} and {high:g}; give {remedy}")


def _as_frame(frame: Frame | ArrayLike) -> Frame:
    if isinstance(frame, Frame):
        return frame
    values = np.asarray(frame)
    if values.ndim != 2 or values.dtype.kind not in "fu":
        raise InputError(
            f"depth of shape {values.shape} and type {values.dtype} can't be used; give (H, W) floating-point metres "
            "or uint16 raw units"
        )
    return Frame(depth=values)


def _completed(frame: Frame, camera: Camera | None, depth_unit: float | None) -> Frame:
    """The frame with what the caller says, checked."""
    frame = replace(frame, camera=camera or frame.camera, depth_unit=depth_unit or frame.depth_unit)
    if frame.depth is None:
        return frame
    if frame.camera is None:
        raise InputError(f"{frame.source}: a depth image needs its camera; give the intrinsics with --camera FILE")
    height, width = frame.depth.shape
    if (frame.camera.width, frame.camera.height) != (width, height):
        raise InputError(
            f"{frame.source}: the frame is {width} x {height} pixels but the camera {frame.camera.width} x "
            f"{frame.camera.height}; give the camera of this stream"
        )
    if frame.depth.dtype.kind == "u" and frame.depth_unit is None:
        raise InputError(f"{frame.source}: raw depth needs its unit; give depth_unit in metres, such as 0.001")
    if not np.isfinite(frame.camera.rays()).any():
        raise InputError(f"{frame.source}: the camera's distortion can't be undone; check its coefficients")
    return frame


def _masked(frame: Frame, mask: ArrayLike | None) -> Frame:
    if frame.depth is None:
        return frame
    chosen = np.ones(frame.depth.shape, np.bool_) if mask is None else np.asarray(mask, np.bool_)
    if chosen.shape != frame.depth.shape:
        raise InputError(f"{frame.source}: the mask has the shape {chosen.shape}, the frame {frame.depth.shape}")
    masked = replace(frame, depth=np.where(chosen, frame.depth, frame.depth.dtype.type(0)))
    if not np.isfinite(depth_metres(masked)).any():
        raise InputError(f"{frame.source}: no pixel has a depth; check the stream, the mask, and what the sensor saw")
    return masked


def _gravity(gravity: ArrayLike | None) -> NDArray[np.float64] | None:
    if gravity is None:
        return None
    down = np.asarray(gravity, np.float64)
    if down.shape != (3,) or not np.isfinite(down).all() or not np.any(down):
        raise UsageError(f"gravity {gravity} is no direction; give x, y, z in the camera frame")
    return down


def _surface(frame: Frame, settings: Settings) -> Estimate:
    if frame.depth is None or frame.camera is None:
        raise InputError(f"{frame.source}: method surface reads depth images; convert the cloud or use another method")
    depth = np.ascontiguousarray(depth_metres(frame), np.float32)
    config: dict[str, Any] = {"sensor": settings.profile.to_dict(), "diameter": settings.diameter}
    return surface.fit_depth(
        depth, frame.camera, settings.profile, diameter=settings.diameter, gravity=settings.gravity, config=config
    )


METHODS: dict[str, Callable[..., Estimate]] = {"surface": _surface}
"""Methods by name."""
