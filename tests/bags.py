"""Recordings for tests, written by the `rosbags` library: an encoder that shares nothing with our decoders."""

from __future__ import annotations

import io
import struct
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Picture
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

Message = tuple[str, int, Any]
"""Topic, time in nanoseconds, and the message (an object of the type store)."""

ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
START_NS = 1_700_000_000_000_000_000


class Maker:
    """Builds messages of either ROS generation."""

    def __init__(self, ros: int) -> None:
        self.store = ROS1 if ros == 1 else ROS2
        self.ros = ros

    def new(self, name: str, *values: Any) -> Any:
        return self.store.types[name](*values)

    def header(self, frame: str, time_ns: int = START_NS) -> Any:
        stamp = self.new("builtin_interfaces/msg/Time", time_ns // 10**9, time_ns % 10**9)
        return self.new("std_msgs/msg/Header", *([7] if self.ros == 1 else []), stamp, frame)

    def image(self, depth: NDArray[Any], encoding: str, frame: str = "optical", pad: int = 0) -> Any:
        rows = np.ascontiguousarray(depth).view(np.uint8).reshape(depth.shape[0], -1)
        rows = np.pad(rows, ((0, 0), (0, pad)))
        big = int(depth.dtype.byteorder == ">")
        height, width = depth.shape
        fields = height, width, encoding, big, rows.shape[1], rows.ravel()
        return self.new("sensor_msgs/msg/Image", self.header(frame), *fields)

    def compressed(self, format: str, data: bytes, frame: str = "optical") -> Any:
        pixels = np.frombuffer(data, np.uint8)
        return self.new("sensor_msgs/msg/CompressedImage", self.header(frame), format, pixels)

    def camera_info(
        self,
        size: tuple[int, int],
        k: Iterable[float],
        d: Iterable[float] = (),
        model: str = "plumb_bob",
        frame: str = "optical",
        p: Iterable[float] = (0.0,) * 12,
        binning: tuple[int, int] = (0, 0),
        roi: tuple[int, int, int, int] = (0, 0, 0, 0),
    ) -> Any:
        matrices = (np.array(list(m), dtype=float) for m in (d, k, np.eye(3).ravel(), p))
        region = self.new("sensor_msgs/msg/RegionOfInterest", *roi, False)
        fields = (size[1], size[0], model, *matrices, *binning, region)
        return self.new("sensor_msgs/msg/CameraInfo", self.header(frame), *fields)

    def imu(self, acceleration: Iterable[float], frame: str = "optical") -> Any:
        zeros = np.zeros(9)
        vector = self.new("geometry_msgs/msg/Vector3", *acceleration)
        still = self.new("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
        turn = self.new("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)
        return self.new("sensor_msgs/msg/Imu", self.header(frame), turn, zeros, still, zeros, vector, zeros)

    def transform(self, parent: str, child: str, quaternion: Iterable[float]) -> Any:
        move = self.new("geometry_msgs/msg/Vector3", 0.1, 0.2, 0.3)
        turn = self.new("geometry_msgs/msg/Quaternion", *quaternion)
        both = self.new("geometry_msgs/msg/Transform", move, turn)
        stamped = self.new("geometry_msgs/msg/TransformStamped", self.header(parent), child, both)
        return self.new("tf2_msgs/msg/TFMessage", [stamped])

    def cloud(self, points: NDArray[Any], pad: int = 0) -> Any:
        kind = {"float32": 7, "float64": 8}[points.dtype.name]
        size = points.dtype.itemsize
        height, width = (1, len(points)) if points.ndim == 2 else points.shape[:2]
        fields = [self.new("sensor_msgs/msg/PointField", n, i * size, kind, 1) for i, n in enumerate("xyz")]
        rows = np.ascontiguousarray(points).view(np.uint8).reshape(height * width, 3 * size)
        data = np.pad(rows, ((0, 0), (0, pad))).ravel()
        step = 3 * size + pad
        layout = height, width, fields, False, step, step * width, data, False
        return self.new("sensor_msgs/msg/PointCloud2", self.header("optical"), *layout)

    def write(self, path: Path, messages: Iterable[Message], **options: Any) -> Path:
        """Writes a bag; ROS 1 takes ``compression``, ROS 2 ``mcap`` (bool), ``compression`` and its ``mode``."""
        with self._writer(path, options) as writer:
            topics: dict[str, Any] = {}
            for topic, time_ns, message in messages:
                kind = message.__msgtype__
                if topic not in topics:
                    topics[topic] = writer.add_connection(topic, kind, typestore=self.store)
                if self.ros == 1:
                    data = self.store.serialize_ros1(message, kind)
                else:
                    data = self.store.serialize_cdr(message, kind)
                writer.write(topics[topic], time_ns, data)
        return path

    def _writer(self, path: Path, options: dict[str, Any]) -> AbstractContextManager[Any]:
        compression = options.get("compression")
        if self.ros == 1:
            bag = rosbag1.Writer(path)
            if compression:
                bag.set_compression(rosbag1.Writer.CompressionFormat[compression.upper()])
            return bag
        plugin = rosbag2.StoragePlugin.MCAP if options.get("mcap") else rosbag2.StoragePlugin.SQLITE3
        folder = rosbag2.Writer(path, version=9, storage_plugin=plugin)
        if compression:
            kind = rosbag2.CompressionFormat[compression.upper()]
            folder.set_compression(rosbag2.CompressionMode[options.get("mode", "STORAGE")], kind)
        return folder


def png16(raw: NDArray[np.uint16]) -> bytes:
    """A 16-bit grey PNG."""
    buffer = io.BytesIO()
    Picture.fromarray(raw).save(buffer, "PNG")
    return buffer.getvalue()


def quantised(depth: NDArray[np.float32], a: float, b: float) -> bytes:
    """32FC1 depth as ``compressedDepth`` stores it: header with A and B, PNG of the inverse depth."""
    with np.errstate(divide="ignore"):
        q = np.where(depth > 0, a / depth + b, 0).astype(np.uint16)
    return struct.pack("<iff", 0, a, b) + png16(q)


# --- Orbbec: ROS 1 bags with messages that go on after their declared fields.


def orbbec(
    path: Path,
    frames: Iterable[NDArray[np.uint16]],
    *,
    unit: float | None = None,
    bit_size: bool = True,
    properties: dict[int, bytes] | None = None,
    accel: NDArray[np.float64] | None = None,
    encoding: str = "mono16",
    packed: Callable[[NDArray[np.uint16]], bytes] = lambda raw: raw.astype("<u2").tobytes(),
    camera: str = "cam",
    fx: float = 57.0,
    distortion: tuple[float, ...] = (0.0,) * 8,
    model: int = 0,
) -> Path:
    """A recording as Orbbec's SDK writes it; `unit` None leaves out everything after the image."""
    raws: list[tuple[str, str, bytes]] = []
    frames = list(frames)
    for number, raw in enumerate(frames):
        image = _orbbec_image(raw.shape, packed(raw), number, unit, bit_size, encoding)
        raws.append((f"/{camera}/sensor_3/frameType_3", "sensor_msgs/msg/Image", image))
    if accel is not None:
        raws.append((f"/{camera}/sensor_4/frameType_4", "sensor_msgs/msg/Imu", _orbbec_imu(accel)))
        raws.append((f"/{camera}/streamProfileType_4", "custom_msg/msg/OBImuStreamProfileInfo", _accel_profile()))
    height, width = frames[0].shape
    profile = _head() + struct.pack("<BB12f", 3, 8, *np.eye(3).ravel(), 0, 0, 0)
    profile += struct.pack("<HHH4f8fB", width, height, 30, fx, 57.25, 31.5, 23.25, *distortion, model)
    raws.append((f"/{camera}/streamProfileType_3", "custom_msg/msg/OBStreamProfileInfo", profile))
    raws.append((f"/{camera}/deviceInfo", "custom_msg/msg/OBDeviceInfo", _device_info()))
    for number, value in (properties or {}).items():
        data = _head() + struct.pack("<II", number, len(value)) + value + struct.pack("<I", len(value))
        raws.append((f"/{camera}/property", "custom_msg/msg/OBProperty", data))
    with rosbag1.Writer(path) as bag:
        topics: dict[str, Any] = {}
        for count, (topic, kind, data) in enumerate(raws):
            if topic not in topics:
                md5 = "060021388200f6f0f447d0fcd9c64743"
                topics[topic] = bag.add_connection(topic, kind, msgdef="Header header", md5sum=md5)
            bag.write(topics[topic], 1_000_000_000 + 33_000_000 * count, data)
    return path


SYSTEM_US = 1_700_000_000_000_000


def _head(frame: bytes = b"") -> bytes:
    return struct.pack("<III", 0, 1, 0) + struct.pack("<I", len(frame)) + frame


def _text(text: str) -> bytes:
    return struct.pack("<I", len(text)) + text.encode()


def _orbbec_image(
    shape: tuple[int, ...], pixels: bytes, number: int, unit: float | None, bit_size: bool, encoding: str
) -> bytes:
    height, width = shape
    data = _head() + struct.pack("<II", height, width) + _text(encoding) + struct.pack("<BI", 0, width * 2)
    data += struct.pack("<I", len(pixels)) + pixels
    if unit is None:
        return data
    times = number, 1_000_000 + 33_000 * number, SYSTEM_US + 33_000 * number, SYSTEM_US + 33_000 * number
    data += struct.pack("<f4Q", unit, *times) + struct.pack("<I", 4) + b"meta" + struct.pack("<I", 4)
    return data + (b"\x10" if bit_size else b"")


def _orbbec_imu(accel: NDArray[np.float64]) -> bytes:
    zeros = [0.0] * 9
    data = _head() + struct.pack("<4d9d3d9d", 0, 0, 0, 1, *zeros, 0, 0, 0, *zeros)
    data += struct.pack("<3d9d", *accel, *zeros)
    return data + struct.pack("<I", 0) + struct.pack("<IQf3Q", 0, 1, 25.0, 1, 1, 1)


def _accel_profile() -> bytes:
    """Its rotation takes the accelerometer's x, y, z to the camera's y, z, x."""
    rotation = [0, 0, 1, 1, 0, 0, 0, 1, 0]
    data = _head() + struct.pack("<6B", 4, 1, 1, 1, 0, 0) + struct.pack("<12f", *rotation, 0, 0, 0)
    return data + struct.pack("<3d", 0, 0, 0) + struct.pack("<24d", *[0.0] * 24)


def _device_info() -> bytes:
    data = _head() + _text("Orbbec Astra 2") + _text("Orbbec Astra 2") + _text("MX6600")
    data += struct.pack("<HH", 0x2BC5, 0x0660) + _text("1-2") + _text("AARY123") + _text("2.8.20") + _text("1.0")
    return data + _text("2.0.0") + _text("USB3.1") + struct.pack("<HB", 1, 0) + _text("") + _text("")
