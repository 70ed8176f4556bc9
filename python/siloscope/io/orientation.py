"""Clouds in whatever frame they were written, turned to the optical one: x right, y down, z forward."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError, UsageError
from siloscope.types.frame import Frame

Matrix = NDArray[np.float64]

NAMES = ("x", "y", "z")
SIGNED = tuple(sign + name for name in NAMES for sign in ("", "-"))
"""Names of the six directions along the axes."""

TURNED = "optical_axes"
"""Entry of a frame's provenance: the file's axes that are right, down and forward."""

AHEAD = 0.9
"""Fraction of the points that lie before a camera along the axis on which it looks."""

SAMPLES = 20_000
"""Points from which the axis is found."""

OPTICAL_AXES = {
    "z": ("x", "y", "z"),
    "-z": ("x", "-y", "-z"),
    "x": ("-y", "-z", "x"),
    "-x": ("y", "-z", "-x"),
    "y": ("x", "-z", "y"),
    "-y": ("x", "z", "-y"),
}
"""Axes of the file that are right, down and forward, by the axis on which it looks: the optical frame itself, OpenGL's
and Viewer's (y up, z backwards; also a frame with z up over which the sensor hangs), ROS's body (x forward, z up), and
the like."""


NAMED_AXES = {"oak": ("x", "-y", "z")}
"""Axes that have a name: OAK cameras' spatial coordinates, x right, y up, z forward, a left-handed frame. Such a cloud
is mirrored to the optical frame, and no cloud shows by itself that it needs to be."""


@dataclass(frozen=True)
class Turn:
    """How a cloud was turned to the optical frame."""

    axes: tuple[str, str, str]
    """Axes of the file that are right, down and forward."""
    given: bool = True
    """Whether the user gave them."""

    @property
    def rotation(self) -> Matrix:
        """(3, 3): ``p_optical = rotation @ p_file``; a reflection for a left-handed file's frame."""
        return np.stack([_unit(name) for name in self.axes])

    @property
    def turns(self) -> bool:
        """Whether it changes anything."""
        return self.axes != OPTICAL_AXES["z"]

    def __str__(self) -> str:
        return ",".join(self.axes)


def checked_axes(axes: str | None, up: str | None) -> Turn | None:
    """The turn that the caller gives; None where it is to be found.

    Raises
    ------
    UsageError
        For names that are no axes, axes that are no right-handed frame, or both settings together.
    """
    if axes is not None and up is not None:
        raise UsageError("axes and up were both given; give one of them")
    if up is not None:
        if up not in SIGNED:
            raise UsageError(f"up '{up}' is no axis; give one of {', '.join(SIGNED)}")
        return Turn(OPTICAL_AXES[_opposite(up)])
    if axes is None:
        return None
    if axes in NAMED_AXES:
        return Turn(NAMED_AXES[axes])
    names = tuple(part.strip() for part in axes.split(","))
    if len(names) != 3 or any(name not in SIGNED for name in names):
        raise UsageError(
            f"axes '{axes}': give the file's axes that are right, down and forward, such as x,-y,-z, or oak"
        )
    turn = Turn((names[0], names[1], names[2]))
    if round(float(np.linalg.det(turn.rotation))) != 1:
        raise UsageError(f"axes '{axes}' are no right-handed frame; one of the signs is wrong (OAK's are named oak)")
    return turn


def found_turn(points: NDArray[Any], gravity: Matrix | None = None) -> Turn:
    """The turn to the axis along which nearly all of the points (..., 3) lie ahead.

    Where they lie all round it is the axis nearest to gravity, which a silo's sensor looks along, if that is known.
    """
    flat = np.asarray(points, np.float64).reshape(-1, 3)
    flat = flat[:: max(1, len(flat) // SAMPLES)]
    flat = flat[np.isfinite(flat).all(axis=1) & (flat != 0.0).any(axis=1)]
    ahead = {name: float(np.mean(flat @ _unit(name) > 0.0)) if len(flat) else 0.0 for name in OPTICAL_AXES}
    best = "z" if ahead["z"] >= AHEAD else max(OPTICAL_AXES, key=lambda name: ahead[name])
    if ahead[best] < AHEAD:
        best = "z" if gravity is None else max(OPTICAL_AXES, key=lambda name: float(gravity @ _unit(name)))
    return Turn(OPTICAL_AXES[best], False)


def optical(frame: Frame, given: Turn | None = None) -> Frame:
    """A frame with its points in the optical frame; its provenance says how they were turned, and they are only once.

    Raises
    ------
    InputError
        For points that are none.
    UsageError
        Where axes are given for an image, which is in the optical frame by what it is.
    """
    if frame.points is None:
        if given is not None and given.turns:
            raise UsageError(f"{frame.source}: axes are for clouds; a depth image has x right, y down and z forward")
        return frame
    if turn_of(frame) is not None:
        return frame
    if np.asarray(frame.points).dtype.kind not in "fiu" or np.shape(frame.points)[-1:] != (3,):
        raise InputError(f"{frame.source}: points of shape {np.shape(frame.points)}; give (N, 3) or (H, W, 3) numbers")
    turn = given or found_turn(frame.points, frame.gravity)
    known = {**frame.provenance, TURNED: str(turn), "turned_by": "given axes" if turn.given else "where points lie"}
    if not turn.turns:
        return replace(frame, provenance=known)
    rotation = turn.rotation
    gravity = None if frame.gravity is None else rotation @ frame.gravity
    points = np.asarray(frame.points, np.float64) @ rotation.T
    return replace(frame, points=points, gravity=gravity, camera=None, provenance=known)


def turn_of(frame: Frame) -> Turn | None:
    """How a frame was turned by `optical`; None where it was not asked."""
    axes = frame.provenance.get(TURNED)
    if not isinstance(axes, str):
        return None
    right, down, forward = axes.split(",")
    return Turn((right, down, forward), frame.provenance.get("turned_by") == "given axes")


def _unit(name: str) -> Matrix:
    vector = np.zeros(3)
    vector[NAMES.index(name[-1])] = -1.0 if name.startswith("-") else 1.0
    return vector


def _opposite(name: str) -> str:
    return name[1:] if name.startswith("-") else f"-{name}"
