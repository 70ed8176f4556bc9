"""What a frame, its camera and its unit say against the sensor's profile, before any fit."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.estimation.inputs import Prepared, PreparedDepth
from siloscope.sensors import SensorProfile
from siloscope.types.camera import Camera
from siloscope.types.frame import Frame
from siloscope.types.intrinsics import CALIBRATED
from siloscope.types.remark import Remark

CONTRADICTION = 5.0
"""Standard deviations from what is expected that are no chance."""

SAMPLES = 5_000
"""Pixels, evenly spread, from which the frame's depths are judged."""

MOST_BEYOND = 0.05
"""Fraction of the depths that a right frame may have beyond the sensor's range; the room is for false returns."""

MOST_TOO_NEAR = 0.25
"""The same before its nearest depth, where dust, a rim or the wall beside the camera may lie."""

LEEWAY = math.sqrt(2.0)
"""Factor by which a sensor may measure beyond its nominal range, with more noise: halfway, as a ratio, to the least
mistake in a unit, 2. It measures nothing before its nearest depth. A unit that is not its own has no leeway."""

SAME_UNIT = 0.01
"""Fraction by which two units of one sensor may differ, as written."""

MILLIMETRE = 0.001
"""The unit in which ROS and most exporters store depth, whatever the sensor's own is, m."""

OFF_CENTRE = 0.12
"""Distance of a principal point from the middle of its image, as a fraction of the side, that no sensor has: an Azure
Kinect's narrow mode, cut out of a larger image, reaches 0.106, others 0.05."""

UNEQUAL = CONTRADICTION * math.sqrt(2.0) * CALIBRATED.f
"""Fraction by which fx and fy of square pixels can't differ: 5 deviations of two calibrated focal lengths."""

LINES = 48
"""Of about so many rows, and columns, as evenly spread, runs are counted: they tell the fraction of all."""
RUN = 16
"""Equal pixels in a row that are no chance where values have noise."""

FILLED = 0.06
"""Fraction of the pixels in such runs, one way, above which holes were filled; an unfiltered D435 has 0.04."""

ONE_WAY = 4.0
"""Least ratio of long runs one way to those the other way, and to runs half as long."""

COARSE = 0.5
"""Fraction of equal neighbours beside the runs above which the values are coarse, and runs no sign."""

KINECT_RAW = 2047
"""Raw value of the first Kinect's 11-bit disparity that means no measurement."""


def input_remarks(
    data: Any, prepared: Prepared, profile: SensorProfile, depth_unit: float | None
) -> tuple[Remark, ...]:
    """Every remark on a frame, as given and as prepared."""
    if not isinstance(prepared, PreparedDepth):
        return tuple(_turned(prepared))
    if prepared.turn is not None:
        return (*_turned(prepared), *range_remarks(prepared.depth, profile))
    frame = data if isinstance(data, Frame) else Frame(depth=np.asarray(data), depth_unit=depth_unit)
    unit = _unit(frame, profile, depth_unit)
    leeway = 1.0 if any(remark.code == "unusual-depth-unit" for remark in unit) else LEEWAY
    return (
        *_kinect_raw(frame.depth),
        *hole_remarks(prepared.depth),
        *range_remarks(prepared.depth, profile, leeway),
        *unit,
        *camera_remarks(prepared.camera),
    )


def _turned(prepared: Prepared) -> Iterator[Remark]:
    """A note of a cloud that was turned because its points do not lie along z."""
    turn = prepared.turn
    if turn is not None and turn.turns and not turn.given:
        yield Remark("axes-found", f"right, down and forward are its {turn}")


def range_remarks(depth: NDArray[np.float32], profile: SensorProfile, leeway: float = LEEWAY) -> tuple[Remark, ...]:
    """What a profile's range says of the depths (H, W), metres, 0 for none, once its own error is taken off.

    A warning where some lie beyond it, a refusal where they do so by more than the leeway, or lie too near.
    """
    near, far = profile.range
    step = max(1, round(math.sqrt(depth.size / SAMPLES)))
    sample = depth[::step, ::step].astype(np.float64)
    seen = profile.true_depth(sample[sample > 0.0])
    if not len(seen):
        return ()
    too_near = bool(np.mean(seen < near) > MOST_TOO_NEAR)
    if not too_near and np.mean(seen > far) <= MOST_BEYOND:
        return ()
    low, high = np.quantile(seen, (0.05, 0.95))
    figures = f"90 % of it from {low:.2f} to {high:.2f} m, {profile.name} measures {near:g} to {far:g} m"
    return (Remark("outside-sensor-range", figures, too_near or bool(np.mean(seen > leeway * far) > MOST_BEYOND)),)


def _unit(frame: Frame, profile: SensorProfile, depth_unit: float | None) -> tuple[Remark, ...]:
    """A remark where the caller names another unit than the sensor's makers; a recording's own is always right."""
    given = depth_unit is not None or frame.provenance.get("depth_unit_from") == "given"
    unit, usual = frame.depth_unit if depth_unit is None else depth_unit, profile.depth_unit
    if not given or unit is None or usual is None or frame.depth is None or frame.depth.dtype.kind == "f":
        return ()
    if abs(unit / usual - 1.0) < SAME_UNIT:
        return ()
    code = "millimetre-depth-unit" if abs(unit / MILLIMETRE - 1.0) < SAME_UNIT else "unusual-depth-unit"
    return (Remark(code, f"{unit:g} m, not {usual:g} m as usual with {profile.name}"),)


def _kinect_raw(depth: NDArray[Any] | None) -> Iterator[Remark]:
    """A refusal of the first Kinect's raw disparity: 11 bits, all set where nothing was measured."""
    if depth is None or depth.dtype.kind not in "iu" or int(depth.max(initial=0)) != KINECT_RAW:
        return
    fraction = float(np.mean(depth == KINECT_RAW))
    if fraction > 0.005:
        yield Remark("kinect-raw", f"its largest value, {KINECT_RAW}, has {100 * fraction:.1f} % of the pixels", True)


def hole_remarks(depth: NDArray[np.float32]) -> Iterator[Remark]:
    """A warning of a frame (H, W) whose holes were filled with the value beside them, along rows or along columns.

    Coarse sensors repeat values too, both ways and in runs of every length; filled holes are long runs among noise.
    """
    found = (_core.equal_runs(image[:: max(1, len(image) // LINES)], RUN) for image in (depth, depth.T))
    (filled, shorter, equal), (other, *_) = sorted(map(_fractions, found), reverse=True)
    one_way = filled > FILLED and filled > ONE_WAY * max(other, shorter)
    if one_way and equal - filled < COARSE * (1.0 - filled):
        yield Remark("hole-filled", f"{100 * filled:.0f} % of the pixels repeat the value beside them in long rows")


def _fractions(runs: _core.EqualRuns) -> tuple[float, float, float]:
    """Fractions of the measured pixels: in runs of `RUN` equal ones or more along a row, in runs of half that, and
    equal to the one before."""
    seen = max(runs.measured, 1)
    return runs.long / seen, runs.half / seen, runs.equal / seen


def camera_remarks(camera: Camera) -> tuple[Remark, ...]:
    """Warnings of intrinsics that no sensor has: pixels that are not square, a principal point aside."""
    return (*_square(camera), *_centred(camera))


def _square(camera: Camera) -> Iterator[Remark]:
    off = abs(math.log(camera.fx / camera.fy))
    if off > UNEQUAL:
        yield Remark("focal-lengths-differ", f"fx {camera.fx:.5g} and fy {camera.fy:.5g}, {100 * off:.1f} % apart")


def _centred(camera: Camera) -> Iterator[Remark]:
    aside = [(c + 0.5) / side - 0.5 for c, side in ((camera.cx, camera.width), (camera.cy, camera.height))]
    if max(map(abs, aside)) > OFF_CENTRE:
        place = f"{camera.cx:.5g}, {camera.cy:.5g} in an image of {camera.width} x {camera.height}"
        yield Remark("principal-point-aside", f"{place}: {100 * max(map(abs, aside)):.0f} % off the middle")
