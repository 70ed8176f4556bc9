"""A depth camera at this machine, by its maker's SDK, which runs in a process of its own."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from siloscope.errors import InputError
from siloscope.io.writers import write_npz
from siloscope.monitor.clock import EARLIEST, SECOND
from siloscope.monitor.live.captures import Capture
from siloscope.sensors.live import OpenSensor, SensorProcess
from siloscope.types.frame import Frame

SETTLE_S = 1.0
"""Frames of the first second after a start are left out: exposure is still being set."""

HELD_S = 60.0
"""Between frames that follow more closely the camera stays on; else it is off and cool."""


class DeviceSource:
    """The newest frame of a camera, with its intrinsics, unit and gravity in the file."""

    poll_s: float | None = None

    def __init__(self, open_sensor: OpenSensor) -> None:
        self._open = open_sensor
        self._process: SensorProcess | None = None

    def captures(self, wanted_s: float, stopped: Callable[[], bool]) -> Iterator[Capture]:
        """One frame."""
        try:
            frame = self._newest(stopped)
        except BaseException:
            self.close()
            raise
        if wanted_s > HELD_S or stopped():
            self.close()
        yield Capture(file_of(frame), _time(frame), frame.source)

    def _newest(self, stopped: Callable[[], bool]) -> Frame:
        if self._process is not None:
            return next(iter(self._process))
        self._process = SensorProcess(self._open)
        frames = iter(self._process)
        frame = next(frames)
        end = time.monotonic() + SETTLE_S
        while time.monotonic() < end and not stopped():
            frame = next(frames)
        return frame

    def close(self) -> None:
        """Turns the camera off."""
        process, self._process = self._process, None
        if process is not None:
            process.__exit__(None, None, None)


def file_of(frame: Frame) -> bytes:
    """A frame as a file that says all of itself."""
    if frame.depth is None:
        raise InputError(f"{frame.source}: has no depth image")
    times = None if frame.timestamp is None else [frame.timestamp]
    with TemporaryDirectory(prefix="siloscope-live-") as name:
        path = Path(name) / "frame.npz"
        unit, gravity = frame.depth_unit, frame.gravity
        write_npz(path, frame.depth, camera=frame.camera, depth_unit=unit, timestamps=times, gravity=gravity)
        return path.read_bytes()


def _time(frame: Frame) -> int | None:
    """The frame's own time, where its clock was ever set."""
    if frame.timestamp is None or frame.timestamp * SECOND < EARLIEST:
        return None
    return int(frame.timestamp * SECOND)
