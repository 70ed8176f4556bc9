"""Makes the RealSense recordings in this folder, and plays them, with the maker's own SDK and no camera.

`pip install pyrealsense2==2.56.5.9235`, then ``python make_realsense.py record realsense.bag``; with 2.59.1.11053
likewise ``realsense.db3``. The depth is that of `depth_frames`, in units of a quarter of a millimetre.
``play RECORDING OUT.npz`` saves the frames as the SDK plays them. The SDK crashes now and then while it cleans up,
so this ends without cleaning up.
"""

from __future__ import annotations

import os
import sys
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

UNIT = 0.00025
WIDTH, HEIGHT = 64, 48
ACCELERATION = (0.1, -9.7, 0.5)


def depth_frames() -> NDArray[np.uint16]:
    """Depth (3, H, W) of the recordings, in raw units: every bit is used."""
    return np.random.default_rng(5).integers(0, 65536, (3, HEIGHT, WIDTH)).astype(np.uint16)


def record(path: str, compressed: bool = True) -> None:
    """Records the frames, with an accelerometer at rest beside them."""
    import pyrealsense2 as rs

    device = rs.software_device()
    device.register_info(rs.camera_info.name, "Software D455")
    device.register_info(rs.camera_info.serial_number, "000123")
    depth_sensor, motion_sensor = device.add_sensor("Stereo Module"), device.add_sensor("Motion Module")
    depth_sensor.add_read_only_option(rs.option.depth_units, UNIT)
    depth = depth_sensor.add_video_stream(depth_stream(rs)).as_video_stream_profile()
    accel = motion_sensor.add_motion_stream(accel_stream(rs)).as_motion_stream_profile()
    recorder = rs.recorder(path, device, compressed)
    sensors, queue = recorder.query_sensors(), rs.frame_queue(50)
    for sensor, profile in zip(sensors, (depth, accel), strict=True):
        sensor.open(profile)
        sensor.start(queue)
    for number, pixels in enumerate(depth_frames()):
        depth_sensor.on_video_frame(video_frame(rs, depth, number, pixels))
        motion_sensor.on_motion_frame(motion_frame(rs, accel, number))
        time.sleep(0.05)
    time.sleep(0.3)
    for sensor in sensors:
        sensor.stop()
        sensor.close()


def depth_stream(rs: Any) -> Any:
    lens = rs.intrinsics()
    lens.width, lens.height, lens.fx, lens.fy, lens.ppx, lens.ppy = WIDTH, HEIGHT, 38.5, 38.75, 31.25, 23.5
    lens.model, lens.coeffs = rs.distortion.brown_conrady, [0.0] * 5
    stream = rs.video_stream()
    stream.type, stream.index, stream.uid, stream.fps = rs.stream.depth, 0, 1, 30
    stream.width, stream.height, stream.bpp, stream.fmt, stream.intrinsics = WIDTH, HEIGHT, 2, rs.format.z16, lens
    return stream


def accel_stream(rs: Any) -> Any:
    stream = rs.motion_stream()
    stream.type, stream.index, stream.uid, stream.fps = rs.stream.accel, 0, 2, 100
    stream.fmt, stream.intrinsics = rs.format.motion_xyz32f, rs.motion_device_intrinsic()
    return stream


def video_frame(rs: Any, profile: Any, number: int, pixels: NDArray[np.uint16]) -> Any:
    frame = rs.software_video_frame()
    frame.stride, frame.bpp, frame.pixels, frame.depth_units = WIDTH * 2, 2, pixels, UNIT
    return _stamped(rs, frame, profile, number)


def motion_frame(rs: Any, profile: Any, number: int) -> Any:
    frame, value = rs.software_motion_frame(), rs.vector()
    value.x, value.y, value.z = ACCELERATION
    frame.data = value
    return _stamped(rs, frame, profile, number)


def _stamped(rs: Any, frame: Any, profile: Any, number: int) -> Any:
    frame.timestamp, frame.frame_number = 1000.0 + 33 * number, number + 1
    frame.domain, frame.profile = rs.timestamp_domain.system_time, profile
    return frame


def play(path: str, out: str) -> None:
    """Saves units and depth of all frames as the SDK plays them."""
    import pyrealsense2 as rs

    device = rs.context().load_device(path)
    device.set_real_time(False)
    sensor, queue = device.query_sensors()[0], rs.frame_queue(50)
    sensor.open(sensor.get_stream_profiles()[0])
    sensor.start(queue)
    units: list[float] = []
    frames: list[Any] = []
    while len(frames) < len(depth_frames()):
        arrived, frame = queue.try_wait_for_frame(5000)
        if not arrived:
            os._exit(1)
        units.append(frame.as_depth_frame().get_units())
        frames.append(np.asanyarray(frame.get_data()).copy())
    np.savez(out, units=units, depth=frames)


if __name__ == "__main__":
    what, recording, *rest = sys.argv[1:]
    if what == "record":
        record(recording, compressed=rest != ["raw"])
    else:
        play(recording, rest[0])
    sys.stdout.flush()
    os._exit(0)
