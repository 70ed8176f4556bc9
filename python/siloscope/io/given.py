"""Frames as a caller gives them: paths to open, or frames already."""

from __future__ import annotations

from os import PathLike
from typing import Any

from numpy.typing import ArrayLike

from siloscope.io import open as open_frames
from siloscope.types.camera import Camera
from siloscope.types.frame import Frame


def given_frames(frames: Any, camera: Camera | None = None, depth_unit: float | None = None) -> Any:
    """The frame source of one path or several; anything else as it is."""
    if is_path(frames):
        return open_frames(frames, camera=camera, depth_unit=depth_unit)
    return frames


def given_frame(
    frame: Frame | ArrayLike | str | PathLike[str], camera: Camera | None = None, depth_unit: float | None = None
) -> Frame | ArrayLike:
    """The first frame of one path; anything else as it is."""
    if not isinstance(frame, str | PathLike):
        return frame
    with open_frames(frame, camera=camera, depth_unit=depth_unit) as source:
        return source[0]


def is_path(frames: Any) -> bool:
    """Whether a caller means files: a path, or a list of nothing but paths."""
    if isinstance(frames, str | PathLike):
        return True
    return isinstance(frames, list | tuple) and bool(frames) and all(isinstance(f, str | PathLike) for f in frames)
