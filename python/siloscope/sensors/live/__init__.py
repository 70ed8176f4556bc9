"""Live depth cameras: frames as they come, the newest first, and which way to turn the camera for more wall.

The maker's SDK runs in a process of its own: where it crashes, the program says so and goes on.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import partial
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError, SiloscopeError, UsageError
from siloscope.types.camera import Camera
from siloscope.types.estimate import Estimate
from siloscope.types.frame import Frame

CYLINDER, CONE = 1, 2
_STRIP = 0.15
"""Share of the image's width or height that a turn brings in on one side and takes away on the other."""
_WORTH = 0.2
"""Least gain, as share of such a strip, for which a turn is advised."""
_PATIENCE_S = 20.0


class Sensor(Protocol):
    """A depth camera that is running."""

    def newest(self) -> Frame:
        """The newest frame, waited for if need be; raises `InputError` where none comes."""


OpenSensor = Callable[[], AbstractContextManager[Sensor]]
"""Starts a camera; it is called in the camera's own process and so has to be importable."""


def sensor(name: str, serial: str | None = None) -> OpenSensor:
    """The way to start a camera by the maker's name, ``realsense`` or ``orbbec``; of several by its serial number.

    Raises `UsageError` for other makers, and for a serial number of an Orbbec camera.
    """
    if name == "realsense":
        from siloscope.sensors.live.realsense import open_first as realsense

        return realsense if serial is None else partial(realsense, serial)
    if name == "orbbec" and serial is None:
        from siloscope.sensors.live.orbbec import open_first as orbbec

        return orbbec
    if name == "orbbec":
        raise UsageError(f"orbbec:{serial}: an Orbbec camera is not chosen by a serial number; connect one, say orbbec")
    raise UsageError(f"unknown kind of camera '{name}'; known are realsense and orbbec")


class SensorProcess:
    """A camera in a process of its own; use it in a ``with`` statement.

    Iterating gives the newest frame each time, so a slow consumer skips frames instead of falling behind.
    """

    def __init__(self, open_sensor: OpenSensor) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, open_sensor), daemon=True)
        self._process.start()
        self._camera: Camera | None = None
        theirs.close()

    def __iter__(self) -> Iterator[Frame]:
        while True:
            yield self._next()

    def _next(self) -> Frame:
        try:
            self._pipe.send(None)
            if not self._pipe.poll(_PATIENCE_S):
                raise InputError(f"the camera sent no frame for {_PATIENCE_S:.0f} s; check its cable and start again")
            answer = self._pipe.recv()
        except (EOFError, OSError):
            self._process.join(1)
            raise InputError(
                f"the camera's driver ended unexpectedly (exit code {self._process.exitcode}); plug the camera in again"
            ) from None
        if not isinstance(answer, Frame):
            raise InputError(str(answer))
        if answer.camera != self._camera:
            self._camera = answer.camera
        # One camera object, whose rays are then computed once.
        return replace(answer, camera=self._camera)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._pipe.close()
        self._process.join(2)
        if self._process.is_alive():
            self._process.kill()


def _serve(pipe: Connection, open_sensor: OpenSensor) -> None:
    """Answers every request with the newest frame, or with the sentence that says why there is none."""
    try:
        with open_sensor() as camera:
            while True:
                pipe.recv()
                pipe.send(camera.newest())
    except (EOFError, OSError, KeyboardInterrupt):
        return
    except SiloscopeError as error:
        _tell(pipe, str(error))
    except Exception as error:
        _tell(pipe, f"the camera's driver failed: {error}; plug the camera in again")


def _tell(pipe: Connection, sentence: str) -> None:
    try:
        pipe.send(sentence)
        pipe.recv()
    except (EOFError, OSError):
        return


_TURNS = {"left": (0, -1), "right": (0, 1), "up": (-1, 0), "down": (1, 0)}


def turn_for_more_wall(estimate: Estimate, frame: Frame) -> str | None:
    """Which way to turn the camera to see more wall: left, right, up, down as in its image; None where none is better.

    Turned to one side, the camera loses a strip of the image on the other side and gains one beyond the near edge,
    which looks much like the strip inside it. The advice is the side where that strip shows most more wall than the
    one given up; for a refused frame, the side that is measured more.
    """
    wall = _wall(estimate, frame)
    if wall is None:
        return None
    gains = {name: _gain(wall, *toward) for name, toward in _TURNS.items()}
    best = max(gains, key=lambda name: gains[name])
    return best if gains[best] >= _WORTH else None


def _wall(estimate: Estimate, frame: Frame) -> NDArray[np.bool_] | None:
    """Pixels (H, W) on the wall; without labels, pixels that are measured."""
    if estimate.ok and estimate.details is not None and estimate.details.labels is not None:
        wall: NDArray[np.bool_] = np.isin(estimate.details.labels, (CYLINDER, CONE))
        return wall
    if frame.depth is None:
        return None
    depth = np.nan_to_num(frame.depth, nan=0.0)
    measured: NDArray[np.bool_] = (depth > 0) & (depth != 65535)
    return measured


def _gain(wall: NDArray[np.bool_], down: int, right: int) -> float:
    """Share of wall in the strip at the edge turned to, less that in the strip at the other edge."""
    image = wall if down else wall.T
    width = max(1, round(len(image) * _STRIP))
    first, last = float(image[:width].mean()), float(image[-width:].mean())
    return (last - first) * (down + right)
