"""A live RealSense camera by `pyrealsense2` (extra ``realsense``), or its recording played by the SDK."""

from __future__ import annotations

from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError
from siloscope.io.extras import need
from siloscope.io.recordings.gravity import at_rest
from siloscope.io.recordings.ros_messages import camera
from siloscope.types.camera import Camera
from siloscope.types.frame import Frame

_WAIT_MS = 5000
_SAMPLES = 200
"""Accelerometer samples kept: some seconds."""
_PREFERRED = ((848, 480), (640, 480))


class RealSense:
    """The depth sensor of a device, running; use it in a ``with`` statement.

    `device` is an ``rs.device``: of the context, ``rs.software_device`` or a recording that the SDK plays.
    """

    def __init__(self, device: Any, rs: Any) -> None:
        self._rs, self._device = rs, device
        self.name = _info(device, rs.camera_info.name)
        self._depth_sensor, self._depth = self._choose(rs.stream.depth, rs.format.z16)
        if self._depth is None:
            raise InputError(f"{self.name}: this device has no depth stream; connect a depth camera")
        self._accel_sensor, self._accel = self._choose(rs.stream.accel, rs.format.motion_xyz32f)
        self._frames, self._motions = rs.frame_queue(1), rs.frame_queue(_SAMPLES)
        self._samples: list[NDArray[np.float64]] = []
        self._running: list[Any] = []
        self.camera = self._intrinsics()

    def _choose(self, stream: Any, form: Any) -> tuple[Any, Any]:
        """A sensor and its profile of a stream; of several the default one, else one of usual size."""
        for sensor in self._device.query_sensors():
            found = [p for p in sensor.get_stream_profiles() if (p.stream_type(), p.format()) == (stream, form)]
            if found:
                return sensor, min(found, key=self._rank)
        return None, None

    def _rank(self, profile: Any) -> tuple[bool, int, int]:
        size = (0, 0)
        if profile.is_video_stream_profile():
            video = profile.as_video_stream_profile()
            size = video.width(), video.height()
        usual = _PREFERRED.index(size) if size in _PREFERRED else len(_PREFERRED)
        return not profile.is_default(), usual, abs(profile.fps() - 30)

    def _intrinsics(self) -> Camera:
        lens = self._depth.as_video_stream_profile().get_intrinsics()
        model = str(lens.model).rsplit(".", 1)[-1]
        focal = lens.fx, lens.fy, lens.ppx, lens.ppy
        return camera(self.name, (lens.width, lens.height), focal, model, tuple(lens.coeffs))

    def __enter__(self) -> Self:
        pairs = [(self._depth_sensor, self._depth, self._frames), (self._accel_sensor, self._accel, self._motions)]
        try:
            for sensor, profile, queue in pairs:
                if profile is not None:
                    sensor.open(profile)
                    sensor.start(queue)
                    self._running.append(sensor)
        except RuntimeError as error:
            self.__exit__(None, None, None)
            raise InputError(f"{self.name}: can't be started ({error}); is another program using it?") from None
        return self

    def newest(self) -> Frame:
        """The newest depth frame, with gravity where the accelerometer is at rest."""
        arrived, frame = self._frames.try_wait_for_frame(_WAIT_MS)
        if not arrived:
            raise InputError(f"{self.name}: no depth frame for {_WAIT_MS / 1000:.0f} s; check its cable")
        depth = frame.as_depth_frame()
        pixels = np.asanyarray(depth.get_data()).copy()
        unit = float(depth.get_units()) or self._unit_option()
        gravity, how = self._gravity()
        return Frame(
            depth=pixels,
            camera=self.camera,
            depth_unit=unit,
            timestamp=self._time(frame),
            gravity=gravity,
            source=f"{self.name}, frame {frame.get_frame_number()}",
            provenance={"device": self.name, "gravity_from": how, "depth_unit_from": "SDK"},
        )

    def _unit_option(self) -> float | None:
        option = self._rs.option.depth_units
        return float(self._depth_sensor.get_option(option)) if self._depth_sensor.supports(option) else None

    def _time(self, frame: Any) -> float | None:
        """Seconds since 1970; None where the camera only counts from its own start."""
        domain = self._rs.timestamp_domain
        absolute = frame.get_frame_timestamp_domain() in (domain.system_time, domain.global_time)
        return float(frame.get_timestamp()) / 1000 if absolute else None

    def _gravity(self) -> tuple[NDArray[np.float64] | None, str]:
        if self._accel is None:
            return None, "no accelerometer"
        while (motion := self._motions.poll_for_frame()) and motion.is_motion_frame():
            data = motion.as_motion_frame().get_motion_data()
            self._samples = [*self._samples[1 - _SAMPLES :], np.array([data.x, data.y, data.z])]
        found, how = at_rest(np.array(self._samples).reshape(-1, 3))
        return None if found is None else self._rotation() @ found, how

    def _rotation(self) -> NDArray[np.float64]:
        """From the accelerometer to the depth camera; the SDK gives both the same axes where it knows no extrinsics."""
        try:
            extrinsics = self._accel.get_extrinsics_to(self._depth)
        except RuntimeError:
            return np.eye(3)
        return np.array(extrinsics.rotation, dtype=np.float64).reshape(3, 3).T

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for sensor in self._running:
            sensor.stop()
            sensor.close()
        self._running = []


def _info(device: Any, key: Any) -> str:
    return str(device.get_info(key)) if device.supports(key) else "RealSense"


def open_first(serial: str | None = None) -> RealSense:
    """The first camera connected, or the one of a serial number.

    Raises `InputError` where there is none, or the SDK is missing.
    """
    rs = need("pyrealsense2", "realsense", "a live RealSense camera")
    devices = [
        one for one in rs.context().query_devices() if serial in (None, _info(one, rs.camera_info.serial_number))
    ]
    if not devices:
        which = "" if serial is None else f" with the serial number {serial}"
        raise InputError(f"no RealSense camera{which} is connected; plug it into a USB 3 socket")
    return RealSense(devices[0], rs)
