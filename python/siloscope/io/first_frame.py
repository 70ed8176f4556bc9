"""The first frame of a source in numbers, as stored: range of the depth, share without measurement, extent."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError
from siloscope.io.source import FrameSource, Item
from siloscope.types.frame import Frame

_NO_MEASUREMENT = 65535


def look(source: FrameSource) -> dict[str, Any] | None:
    """What the first readable frame holds, as plain data; None where there is none to be read.

    ``invalid`` is the fraction of pixels or points without measurement. A depth image has ``depth``: ``least``,
    ``median`` and ``most`` in ``unit`` (``m``, or ``raw`` where no unit is known). Points have ``extent``: least and
    most of x, y and z in metres. Where no frame can be read, ``error`` says why the first one can't.
    """
    why: str | None = None
    for item in _before_damage(source):
        try:
            with np.errstate(all="ignore"):
                return _numbers(source._completed(item), source.depth_unit)
        except InputError as error:
            why = why or str(error)
    return {"error": why} if why else None


def _before_damage(source: FrameSource) -> Iterator[Item]:
    with suppress(InputError):
        yield from source._items()


def _numbers(frame: Frame, unit: float | None) -> dict[str, Any] | None:
    if frame.points is not None:
        return _of_points(frame.points.reshape(-1, 3))
    return None if frame.depth is None else _of_depth(frame.depth, frame.depth_unit if unit is None else unit)


def _of_depth(depth: NDArray[Any], unit: float | None) -> dict[str, Any]:
    raw = depth.dtype.kind in "iu"
    valid = depth[np.isfinite(depth) & (depth > 0) & ((depth != _NO_MEASUREMENT) | (not raw))]
    scale = (unit or 1.0) if raw else 1.0
    numbers = {} if not valid.size else {"least": valid.min(), "median": np.median(valid), "most": valid.max()}
    told = {key: float(value) * scale for key, value in numbers.items()}
    known = "raw" if raw and unit is None else "m"
    return {"pixels": int(depth.size), "invalid": _fraction(valid.size, depth.size), "depth": {"unit": known, **told}}


def _of_points(points: NDArray[Any]) -> dict[str, Any]:
    valid = points[np.isfinite(points).all(axis=1)]
    ends = (valid.min(axis=0), valid.max(axis=0)) if len(valid) else None
    extent = {axis: [float(end[i]) for end in ends] for i, axis in enumerate("xyz")} if ends else None
    return {"points": len(points), "invalid": _fraction(len(valid), len(points)), "extent": extent}


def _fraction(valid: int, all: int) -> float:
    return 1.0 - valid / all if all else 1.0
