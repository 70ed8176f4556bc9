"""The door: whatever a caller calls a frame, checked and brought into one form. No silent defaults."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from siloscope import _core
from siloscope.errors import InputError, UsageError
from siloscope.estimation.pixel_lattice import image_of
from siloscope.estimation.virtual_image import camera_at_origin, image_from_origin
from siloscope.io.orientation import Turn, optical, turn_of
from siloscope.sensors import SensorProfile
from siloscope.types.camera import Camera
from siloscope.types.frame import Frame

LONGEST = 1000.0
"""Depth in metres beyond which a floating-point frame can't be in metres."""

FARTHEST_CLOUD = 10_000.0
"""Distance of a cloud from the origin, m, from which on the origin can't be its sensor."""

PIXELS, RESAMPLED = "the image that its rays are of", "resampled as seen from the origin"
"""How a cloud became a depth image."""

FROM_ORIGIN = "from the origin"
"""Where the rays of a cloud that is no camera's begin, if it was seen from one place."""

SENTINEL = 65535
"""Raw 16-bit depth that means "no measurement"."""


@dataclass(frozen=True, eq=False)
class PreparedDepth:
    """A depth image as the methods take it: `depth` float32 (H, W), C-contiguous, metres, 0 for "no measurement"."""

    depth: NDArray[np.float32]
    camera: Camera
    gravity: NDArray[np.float64] | None
    config: dict[str, Any]
    turn: Turn | None = None
    """How the cloud was turned that it was made of; None for images."""
    camera_given: bool = False
    """Whether the caller gave the camera; a recording's own is of its stream."""


@dataclass(frozen=True, eq=False)
class PreparedPoints:
    """A cloud as the methods take it: `points` float64 (N, 3) in the optical frame, metres, finite rows only."""

    points: NDArray[np.float64]
    gravity: NDArray[np.float64] | None
    config: dict[str, Any]
    turn: Turn | None = None
    """How it was turned."""
    camera: Camera | None = None
    """One in whose place a sensor at the origin has seen them; None where none is known to have."""


Prepared = PreparedDepth | PreparedPoints
"""A frame as the methods take it."""


def prepare(
    data: Frame | ArrayLike,
    camera: Camera | None,
    profile: SensorProfile,
    *,
    depth_unit: float | None = None,
    mask: ArrayLike | None = None,
    crop: Sequence[float] | None = None,
    clouds: str = "points",
) -> Prepared:
    """Check a frame and bring it into one form.

    A cloud is turned to the optical frame. `clouds` says what becomes of it then: "points" leave it one, and "as is"
    does so in its own frame; "rays" leave it one and find the camera; "pixels" make the depth image of it that it was,
    where its rays are a pinhole camera's; "resampled" make one of any cloud that was seen from its origin.

    Raises
    ------
    InputError
        For what can't be used: a wrong type or shape, raw units without `depth_unit`, a missing camera or one of
        another size, floats that can't be metres, a mask of another shape, no valid measurement at all.
    UsageError
        For a crop box that is none.
    """
    frame = data if isinstance(data, Frame) else _frame(data, camera)
    given = camera is not None or str(frame.provenance.get("camera_from", "")).startswith("given")
    frame = replace(
        frame, camera=camera or frame.camera, depth_unit=frame.depth_unit if depth_unit is None else depth_unit
    )
    config: dict[str, Any] = {"crop": None if crop is None else list(crop), "masked": mask is not None}
    box = None if crop is None else crop_box(crop)
    if frame.points is not None:
        turned = frame if clouds == "as is" else optical(frame)
        return _prepare_points(turned, mask, box, config, clouds)
    return replace(_prepare_depth(frame, profile, mask, box, config), camera_given=given)


def _prepare_points(
    frame: Frame,
    mask: ArrayLike | None,
    box: NDArray[np.float64] | None,
    config: dict[str, Any],
    clouds: str,
) -> Prepared:
    turn = turn_of(frame)
    config = config | {"axes": None if turn is None else str(turn)}
    points = _points(frame.points, frame.source)
    kept = _mask(mask, np.asarray(frame.points).shape[:-1], frame.source)
    if kept is not None:
        points = points[kept.reshape(-1)]
    points = points[np.isfinite(points).all(axis=1)]
    points = points if box is None else points[within(points, box)]
    _not_empty(len(points), frame.source)
    _near_the_sensor(points, frame.source)
    found, how = (None if clouds in ("points", "as is") else image_of(points)), PIXELS
    if found is None and clouds == "resampled":
        found, how = image_from_origin(points), RESAMPLED
    if found is not None and clouds != "rays":
        return PreparedDepth(*found, frame.gravity, config | {"cloud": how}, turn)
    camera = None if found is None else found[1]
    if camera is None and clouds in ("rays", "resampled"):
        camera = camera_at_origin(points)
        config = config if camera is None else config | {"rays": FROM_ORIGIN}
    return PreparedPoints(np.ascontiguousarray(points), frame.gravity, config, turn, camera)


def _prepare_depth(
    frame: Frame,
    profile: SensorProfile,
    mask: ArrayLike | None,
    box: NDArray[np.float64] | None,
    config: dict[str, Any],
) -> PreparedDepth:
    depth = metres(frame)
    chosen = frame.camera
    if chosen is None:
        chosen = _nominal_camera(depth, profile, frame.source)
        config["intrinsics"] = f"nominal of {profile.name}"
    height, width = depth.shape
    if (chosen.width, chosen.height) != (width, height):
        raise InputError(
            f"{frame.source}: the frame is {width}x{height} pixels but the camera {chosen.width}x{chosen.height}; "
            "give the camera file of this stream"
        )
    if chosen.distortion_model != "none" and not np.isfinite(chosen.rays()).all():
        raise InputError(f"{frame.source}: the camera's distortion can't be undone; check its coefficients")
    if profile.map is not None:
        depth = profile.map.corrected(depth)
    kept = _mask(mask, depth.shape, frame.source)
    if kept is not None:
        depth = np.where(kept, depth, np.float32(0))
    if box is not None:
        rays = chosen.rays()
        points = np.dstack([rays[..., 0] * depth, rays[..., 1] * depth, depth])
        depth = np.where(within(points, box), depth, np.float32(0))
    if (kept is not None or box is not None) and not (depth > 0).any():
        raise InputError(f"{frame.source}: mask and crop leave no pixel with a depth; check them against the picture")
    return PreparedDepth(np.ascontiguousarray(depth, np.float32), chosen, frame.gravity, config)


def _frame(data: ArrayLike, camera: Camera | None) -> Frame:
    """An array as a frame: (H, W) is depth, (H, W, 3) and (N, 3) are points; what is masked is no measurement."""
    if isinstance(data, np.ma.MaskedArray):
        data = data.filled(np.nan if data.dtype.kind == "f" else 0)
    try:
        array = np.asarray(data)
    except (ValueError, TypeError) as error:
        raise InputError(f"frame: not an array ({error}); give (H, W) depth or (N, 3) points") from None
    _numeric(array, "frame")
    is_points = array.ndim == 3 or (array.ndim == 2 and array.shape[1] == 3 and (camera is None or camera.width != 3))
    if array.ndim not in (2, 3) or (array.ndim == 3 and array.shape[2] != 3):
        raise InputError(f"frame: shape {array.shape} is neither (H, W) depth nor (N, 3) or (H, W, 3) points")
    return Frame(points=array) if is_points else Frame(depth=array, camera=camera)


def _numeric(array: NDArray[Any], source: str) -> None:
    if array.dtype.kind not in "fiu":
        raise InputError(f"{source}: values of type {array.dtype} are no measurements; give floats or integers")
    if array.size == 0:
        raise InputError(f"{source}: the frame is empty (shape {array.shape}); give one with pixels")


def metres(frame: Frame) -> NDArray[np.float32]:
    """Depth of a frame, float32 (H, W) in metres, 0 for "no measurement".

    Raises `InputError` for raw units without a depth unit, floats that can't be metres, and frames in which every value
    is invalid. Zeros everywhere are a frame in which the sensor saw nothing, and pass.
    """
    if frame.depth is None:
        raise InputError(f"{frame.source}: neither depth nor points; give a frame with one of them")
    depth = np.asarray(frame.depth)
    _numeric(depth, frame.source)
    if depth.ndim != 2:
        raise InputError(f"{frame.source}: depth of shape {depth.shape}; give one image (H, W)")
    raw = depth.dtype.kind in "iu"
    unit = _unit(frame.depth_unit, frame.source) if raw else 1.0
    if raw and depth.dtype != np.uint16:
        depth, unit = _narrowed(depth, unit)
    elif not raw and depth.dtype not in (np.float32, np.float64):
        depth = depth.astype(np.float64)
    known = _core.depth_metres(depth, unit)
    if not raw and known.any_measured:
        _not_millimetres(known.depth, frame.source)
    if not known.any_measured and (depth != 0).any():
        raise InputError(f"{frame.source}: every depth is invalid (NaN, negative or {SENTINEL}); check the recording")
    return known.depth


def _narrowed(depth: NDArray[np.integer[Any]], unit: float) -> tuple[NDArray[Any], float]:
    """Integers of another width as 16-bit raw units, or as metres where they don't fit; and the unit of either."""
    measured = np.maximum(depth, 0)
    return (measured.astype(np.uint16), unit) if measured.max() <= SENTINEL else (measured * unit, 1.0)


def _not_millimetres(known: NDArray[np.float32], source: str) -> None:
    """Refuses floats that can't be metres, judged by every 97th pixel."""
    thin = known.reshape(-1)[:: 97 if known.size > 9700 else 1]
    typical = float(np.median(thin[thin > 0])) if (thin > 0).any() else 0.0
    if typical > LONGEST:
        raise InputError(
            f"{source}: floating-point depth is taken as metres, but its median is {typical:.0f}; "
            "divide millimetres by 1000 first"
        )


def _unit(unit: float | None, source: str) -> float:
    if unit is None:
        raise InputError(
            f"{source}: depth in raw units and nothing says how long one is; give --depth-unit (metres: 0.001 for "
            "millimetres, 0.0002 for TUM, 0.00025 for an L515)"
        )
    if not (math.isfinite(unit) and 1e-7 <= unit <= 1.0):
        raise InputError(f"{source}: a depth unit of {unit} m can't be; give metres per raw unit, such as 0.001")
    return unit


def _nominal_camera(depth: NDArray[Any], profile: SensorProfile, source: str) -> Camera:
    height, width = depth.shape
    camera = profile.camera(width, height)
    if camera is None:
        raise InputError(
            f"{source}: no camera for this {width}x{height} image; give its intrinsics with --camera FILE, "
            "or a --sensor whose profile knows this size"
        )
    return camera


def _points(points: NDArray[Any] | None, source: str) -> NDArray[np.float64]:
    array = np.asarray(points)
    _numeric(array, source)
    if array.ndim not in (2, 3) or array.shape[-1] != 3:
        raise InputError(f"{source}: points of shape {array.shape}; give (N, 3) or (H, W, 3)")
    return array.reshape(-1, 3).astype(np.float64)


def _mask(mask: ArrayLike | None, shape: tuple[int, ...], source: str) -> NDArray[np.bool_] | None:
    if mask is None:
        return None
    array = np.asarray(mask)
    if array.shape != shape or array.dtype.kind not in "biu":
        raise InputError(f"{source}: the mask is {array.dtype} {array.shape}; give booleans of the shape {shape}")
    kept: NDArray[np.bool_] = array != 0
    return kept


def crop_box(crop: Sequence[float]) -> NDArray[np.float64]:
    """``xmin, xmax, ymin, ymax, zmin, zmax`` as an array (6,); raises `UsageError` where they are no box."""
    box = np.asarray(crop, np.float64)
    if box.shape != (6,) or not np.isfinite(box).all() or (box[0::2] >= box[1::2]).any():
        raise UsageError(f"crop {list(crop)}: give xmin,xmax,ymin,ymax,zmin,zmax in metres, each min below its max")
    return box


def within(points: NDArray[np.floating[Any]], box: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which points (..., 3) lie in a box of `crop_box`; NaN lies nowhere."""
    inside: NDArray[np.bool_] = np.all((points >= box[0::2]) & (points <= box[1::2]), axis=-1)
    return inside


def _not_empty(count: int, source: str) -> None:
    if count == 0:
        raise InputError(f"{source}: no valid point is left; check the file, the mask and the crop box")


def _near_the_sensor(points: NDArray[np.float64], source: str) -> None:
    """Refuses map coordinates: the origin is where the sensor is."""
    away = float(np.linalg.norm(np.median(points, axis=0)))
    if away > FARTHEST_CLOUD:
        raise InputError(
            f"{source}: the points lie {away / 1000:.0f} km from the origin, as map coordinates do; subtract the "
            "sensor's place from them"
        )
