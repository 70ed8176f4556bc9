"""Brings a decoded frame to the terms of the user: camera, unit, ray length. The user's word wins over the file's."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError
from siloscope.io.camera_sizes import Known, choose
from siloscope.io.orientation import Turn, optical
from siloscope.types.frame import Frame

FARTHEST_M = 100.0
"""Median depth above which floating-point "metres" are taken for some other unit."""

WIDEST_M = 200.0
"""Extent above which points of a format that has no units are taken for some other unit than metres."""

NEAREST_M = 0.05
"""Median depth, or extent of points, below which a given unit is not meant for values that are metres already."""

_UNITLESS_CLOUDS = ("ply", "pcd", "xyz", "obj", "off", "npy", "npz", "folder")


@dataclass(frozen=True)
class Options:
    """What the user says about the input; it always wins over what the file says.

    Attributes
    ----------
    cameras : tuple of Camera or Intrinsics
        Empty, or the user's camera; several where their file lists a resolution each. The frame's size chooses, and
        scales what it is an exact ratio of.
    depth_unit : float or None
        Metres per raw unit. It also scales floating-point depth and points, unless they are metres already.
    camera_depth_unit : float or None
        Metres per raw unit as the user's camera file has it; wins over the file's own, for raw units only.
    stream : str or None
        Which of several streams, by name or a part of it that fits only one.
    ray_length : bool
        The file's depth is the length of the ray, not z.
    turn : Turn or None
        The axes of a cloud's file that are right, down and forward; None leaves them to be found.
    beside : bool
        Whether to take the camera from a file beside the frame, where the format has no place for one.
    """

    cameras: tuple[Known, ...] = ()
    depth_unit: float | None = None
    camera_depth_unit: float | None = None
    stream: str | None = None
    ray_length: bool = False
    beside: bool = True
    turn: Turn | None = None


class UnknownUnit(InputError):
    """The depth's unit is not known: concerns every frame of the source, so iterating ends."""


def finish(frame: Frame, options: Options) -> Frame:
    """The frame with the user's camera, unit and ray length applied and checked; raises `InputError`."""
    frame = _with_unit(frame, options)
    frame = _with_camera(frame, options.cameras)
    if options.turn is not None:
        frame = optical(frame, options.turn)
    return _z_from_ray_length(frame) if options.ray_length else frame


def _with_unit(frame: Frame, options: Options) -> Frame:
    given = options.depth_unit
    if frame.points is not None:
        return _with_metric_points(frame, frame.points, given)
    depth = frame.depth
    if depth is None:
        return frame
    if np.issubdtype(depth.dtype, np.floating):
        return _with_metres(frame, depth, given)
    if given is not None:
        return _with_raw_units(_with_origin(frame, depth_unit_from="given"), depth, given)
    if options.camera_depth_unit is not None:
        frame = _with_origin(frame, depth_unit_from="given camera file")
    return _with_raw_units(frame, depth, options.camera_depth_unit)


def _with_origin(frame: Frame, **known: Any) -> Frame:
    return replace(frame, provenance={**frame.provenance, **known})


def _with_metric_points(frame: Frame, points: NDArray[Any], given: float | None) -> Frame:
    extent = _extent(points)
    if given is not None:
        factor, frame = _factor(frame, extent, given)
        return replace(frame, points=points * points.dtype.type(factor), depth_unit=None)
    if frame.provenance.get("format") in _UNITLESS_CLOUDS and extent > WIDEST_M:
        raise UnknownUnit(
            f"{frame.source}: coordinates are metres, but the points are spread over {extent:.4g}; "
            "give --depth-unit (0.001 for millimetres, 1 if these are metres)"
        )
    return replace(frame, depth_unit=None)


def _extent(points: NDArray[Any]) -> float:
    """Longest side of the box around the points without the outer tenths, which outliers may fill."""
    few = points.reshape(-1, 3)[:: max(1, points.size // 12_288)].astype(np.float64)
    few = few[np.isfinite(few).all(axis=1)]
    return float(np.ptp(np.percentile(few, [10, 90], axis=0), axis=0).max()) if len(few) else 0.0


def _with_metres(frame: Frame, depth: NDArray[Any], given: float | None) -> Frame:
    median = _median(depth)
    if given is not None:
        factor, frame = _factor(frame, median, given)
        return replace(frame, depth=depth * depth.dtype.type(factor), depth_unit=None)
    if median > FARTHEST_M:
        raise UnknownUnit(
            f"{frame.source}: floating-point depth is metres, but the median is {median:.4g}; "
            "give --depth-unit (0.001 for millimetres, 1 if these are metres)"
        )
    return replace(frame, depth_unit=None)


def _factor(frame: Frame, size: float, given: float) -> tuple[float, Frame]:
    """What floating-point values are multiplied by: the given unit, or 1 where that would leave millimetres of them,
    since then they are metres already, as floating point is unless it can't be."""
    if 0.0 < size * given < NEAREST_M:
        return 1.0, _with_origin(frame, depth_unit_from="not applied: floating point is metres")
    return given, _with_origin(frame, depth_unit=given, depth_unit_from="given")


def _median(depth: NDArray[Any]) -> float:
    few = depth.reshape(-1)[:: max(1, depth.size // 4096)]
    few = few[np.isfinite(few) & (few > 0)]
    return float(np.median(few)) if few.size else 0.0


def _with_raw_units(frame: Frame, depth: NDArray[Any], given: float | None) -> Frame:
    unit = frame.depth_unit if given is None else given
    if unit is None:
        raise UnknownUnit(
            f"{frame.source}: the depth is in raw units and nothing says what one unit is; give --depth-unit in "
            "metres (0.001 for millimetres as most sensors and ROS write, 0.0002 for TUM, 0.00025 for some RealSense)"
        )
    if not (np.isfinite(unit) and 0 < unit <= 1):
        raise UnknownUnit(f"{frame.source}: a depth unit of {unit} m is not possible; give --depth-unit in metres")
    possible = depth.dtype != np.uint16 or 65_535 * unit > FARTHEST_M
    if possible and (median := _median(depth) * unit) > FARTHEST_M:
        raise UnknownUnit(
            f"{frame.source}: a depth unit of {unit} m puts the median depth at {median:.4g} m; give --depth-unit in "
            "metres per raw unit, such as 0.001"
        )
    raw = _as_uint16(depth)
    frame = _with_origin(frame, depth_unit=float(unit))
    if raw is None:
        return replace(frame, depth=depth * float(unit), depth_unit=None)
    return replace(frame, depth=raw, depth_unit=float(unit))


def _as_uint16(depth: NDArray[Any]) -> NDArray[np.uint16] | None:
    """Integers of another width as 16-bit raw units, in which 65535 is no measurement; None where they don't fit."""
    if depth.dtype == np.uint16:
        return depth
    return np.maximum(depth, 0).astype(np.uint16) if depth.max(initial=0) <= 65_535 else None


def _with_camera(frame: Frame, given: tuple[Known, ...]) -> Frame:
    size = _size(frame)
    if size is None:
        return frame
    if given:
        camera, how = choose(frame.source, given, size)
        frame = _with_origin(frame, camera_from=f"given, {how}" if how else "given")
        return replace(frame, camera=camera)
    if frame.camera is not None and (frame.camera.width, frame.camera.height) != size:
        raise InputError(
            f"{frame.source}: the frame is {size[0]} x {size[1]} pixels but the camera "
            f"{frame.camera.width} x {frame.camera.height}; give the camera of this stream with --camera"
        )
    return frame


def _size(frame: Frame) -> tuple[int, int] | None:
    """Width and height in pixels; None for points in no order."""
    if frame.depth is not None:
        return frame.depth.shape[1], frame.depth.shape[0]
    if frame.points is not None and frame.points.ndim == 3:
        return frame.points.shape[1], frame.points.shape[0]
    return None


def _z_from_ray_length(frame: Frame) -> Frame:
    """Depth z = length / |(x/z, y/z, 1)| of the pixel's ray."""
    if frame.depth is None:
        raise InputError(f"{frame.source}: points have no ray length; leave --ray-length out")
    if frame.camera is None:
        raise InputError(f"{frame.source}: ray lengths need the camera to become z; give --camera")
    stretch = np.sqrt(1.0 + np.sum(frame.camera.rays() ** 2, axis=2))
    metres = np.where(frame.depth == 65535, 0, frame.depth) if frame.depth.dtype == np.uint16 else frame.depth
    depth = metres * (frame.depth_unit or 1.0) / stretch
    return replace(_with_origin(frame, ray_length=True), depth=depth, depth_unit=None)
