"""Recordings of Orbbec's SDK and Viewer (``.bag``), versions 1 and 2.

They are ROS 1 bags whose messages go on after the fields that ROS knows, and differ between versions of the SDK: what
follows the image is taken as far as it goes.
"""

from __future__ import annotations

import math
import re
import struct
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.errors import InputError
from siloscope.io.recordings import gravity, ros_messages
from siloscope.io.recordings.recorded import RecordedSource
from siloscope.io.recordings.recording import Entry, Recording, Topic, or_none
from siloscope.io.recordings.streams import Stream
from siloscope.io.recordings.wire import Wire
from siloscope.io.source import Options, check_image_size
from siloscope.types.camera import Camera
from siloscope.types.frame import Frame

_FRAMES = re.compile(r"/(cam\d*)/sensor_(\d+)/frameType_(\d+)$")
_DEPTH_SENSOR, _ACCEL_SENSOR = 3, 4
_DEPTH_STREAM, _ACCEL_STREAM = 3, 4
DISTORTION = ("none", "modified brown conrady", "inverse brown conrady", "brown conrady", "rational", "kannala brandt")
"""Distortion models in the SDK's numbering."""
_YEAR_2001_US, _YEAR_2100_US = 1e15, 4.1e15
_PRECISION_LEVEL, _FLEXIBLE_UNIT = 75, 176
_UNITS_MM = (1.0, 0.8, 0.4, 0.1, 0.2, 0.5, 0.05)
"""Millimetres per raw unit of the SDK's depth precision levels."""


def is_orbbec(recording: Recording) -> bool:
    """Whether the topics are those of Orbbec's SDK."""
    return any(re.match(r"/cam\d*/(sensor_\d+/frameType_|streamProfileType_)", name) for name in recording.topics)


class OrbbecSource(RecordedSource):
    """One depth stream of an Orbbec recording."""

    def __init__(self, path: Path, format: str, options: Options, recording: Recording) -> None:
        self._start = 0.0
        super().__init__(path, format, options, recording, _streams_of(recording))
        self._camera_name = self.stream.name.split("/")[0]
        self.provenance.update(_device(recording, self._camera_name))
        self.file_depth_unit, self._unit_from = self._unit()
        profile = or_none(_profile, recording, self._camera_name, _DEPTH_STREAM)
        if profile and not options.cameras:
            self.file_camera = _camera(f"{self.name}, stream profile", profile)
            self.provenance["camera_from"] = "stream profile"
        self._start = self._start_time()
        self.timestamps = [self._time(entry) for entry in self.stream.topic.entries]
        self.gravity, self.provenance["gravity_from"] = self._gravity()

    def _time(self, entry: Entry) -> float:
        return self._start + entry.time_ns / 1e9

    def _decode(self, entry: Entry) -> Frame:
        image = _image(self.recording, self.stream.topic, entry)
        if image.encoding == "RVL":
            image = image._replace(data=_unpacked(image))
        elif image.encoding not in ("mono16", "Z16"):
            raise InputError(
                f"depth is stored as '{image.encoding or 'unknown'}', which is not read; "
                "record with format Y16, Z16 or RVL"
            )
        # The SDK gives the step in bytes of a pixel, or 0; the pixels are always packed.
        image = image._replace(step=image.width * 2, big_endian=False)
        told = _tail_unit(image)
        return Frame(
            depth=ros_messages.depth_pixels(image._replace(encoding="mono16")),
            depth_unit=told,
            timestamp=self._time(entry),
            provenance={"depth_unit_from": "image" if told else self._unit_from},
        )

    def _unit(self) -> tuple[float | None, str]:
        properties = _properties(self.recording, self._camera_name)
        flexible = properties.get(_FLEXIBLE_UNIT, b"")
        if len(flexible) >= 4 and _possible(millimetres := struct.unpack("<f", flexible[:4])[0]):
            return millimetres * 1e-3, "property: depth unit"
        level = int.from_bytes(properties.get(_PRECISION_LEVEL, b"\xff")[:4], "little")
        if level < len(_UNITS_MM):
            return _UNITS_MM[level] * 1e-3, "property: depth precision level"
        return 0.001, "SDK default (1 mm) as the camera has no setting for it"

    def _start_time(self) -> float:
        """Difference of the computer's clock, in seconds since 1970, to that of the device; 0 where not recorded."""
        entry = self.stream.topic.entries[0]
        image = or_none(_image, self.recording, self.stream.topic, entry)
        if image is None or len(image.tail) < 28:
            return 0.0
        (system_us,) = struct.unpack("<Q", image.tail[20:28])
        return system_us / 1e6 - entry.time_ns / 1e9 if _YEAR_2001_US < system_us < _YEAR_2100_US else 0.0

    def _gravity(self) -> tuple[NDArray[np.float64] | None, str]:
        name = f"/{self._camera_name}/sensor_{_ACCEL_SENSOR}/"
        topics = [topic for topic in self.recording.of_type("sensor_msgs/Imu") if topic.name.startswith(name)]
        if not topics:
            return None, "no accelerometer recorded"
        rotation = or_none(_accel_rotation, self.recording, self._camera_name)
        if rotation is None:
            return None, "the accelerometer's extrinsics are not recorded"
        found, how = gravity.at_rest(gravity.accelerations(self.recording, topics[0]))
        return None if found is None else rotation @ found, how


def _streams_of(recording: Recording) -> list[Stream]:
    matches = [(topic, _FRAMES.match(topic.name)) for topic in recording.of_type("sensor_msgs/Image")]
    depth = [(topic, match[1]) for topic, match in matches if match and int(match[2]) == _DEPTH_SENSOR]
    return [_stream(recording, topic, f"{camera}/depth") for topic, camera in depth]


def _stream(recording: Recording, topic: Topic, name: str) -> Stream:
    image = or_none(_image, recording, topic, topic.entries[0])
    return Stream(name, "depth", topic, (image.width, image.height) if image else None, "uint16")


def _image(recording: Recording, topic: Topic, entry: Entry) -> ros_messages.Image:
    return ros_messages.read_image(recording.read(topic, entry))


def _unpacked(image: ros_messages.Image) -> memoryview:
    """The pixels of an image packed by RVL, whose bytes are the code alone; raises `InputError`."""
    check_image_size("RVL image", image.width, image.height)
    try:
        return memoryview(_core.decompress_rvl(bytes(image.data), image.width * image.height).tobytes())
    except ValueError as error:
        raise InputError(f"damaged RVL ({error}); record again") from None


def _tail_unit(image: ros_messages.Image) -> float | None:
    """The unit after the image, metres or millimetres by version of the SDK; None where it is 0 or missing."""
    if len(image.tail) < 4:
        return None
    unit = struct.unpack("<f", image.tail[:4])[0]
    if 1e-6 <= unit < 0.005:
        return float(unit)
    return unit * 1e-3 if _possible(unit) and unit >= 0.02 else None


def _possible(millimetres: float) -> bool:
    return math.isfinite(millimetres) and 0 < millimetres <= 100


class _Profile(NamedTuple):
    size: tuple[int, int]
    intrinsic: tuple[float, float, float, float]
    distortion: tuple[float, ...]
    """k1, k2, k3, k4, k5, k6, p1, p2."""
    model: int


def _profile(recording: Recording, camera: str, stream: int) -> _Profile | None:
    """The depth stream's profile: header, types, rotation, translation, size, rate, intrinsics, distortion, model."""
    wire = recording.first(f"/{camera}/streamProfileType_{stream}")
    if wire is None:
        return None
    wire.header()
    wire.take(2 + 4 * 12)
    size = wire.u16(), wire.u16()
    wire.u16()
    fx, fy, cx, cy = wire.floats(4, 4).tolist()
    return _Profile(size, (fx, fy, cx, cy), tuple(wire.floats(8, 4).tolist()), wire.u8())


def _camera(name: str, profile: _Profile) -> Camera:
    k1, k2, k3, k4, k5, k6, p1, p2 = profile.distortion
    model = DISTORTION[profile.model] if profile.model < len(DISTORTION) else str(profile.model)
    fisheye = model == "kannala brandt"
    d: tuple[float, ...] = (k1, k2, k3, k4) if fisheye else (k1, k2, p1, p2, k3, k4, k5, k6)
    return ros_messages.camera(name, profile.size, profile.intrinsic, model, () if model == "none" else d)


def _accel_rotation(recording: Recording, camera: str) -> NDArray[np.float64] | None:
    """Rotation from the accelerometer to the depth camera, from the accelerometer's profile."""
    wire = recording.first(f"/{camera}/streamProfileType_{_ACCEL_STREAM}")
    if wire is None:
        return None
    wire.header()
    wire.take(6)
    rotation = wire.floats(9, 4).reshape(3, 3)
    return rotation if np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3) else None


def _properties(recording: Recording, camera: str) -> dict[int, bytes]:
    topic = recording.topics.get(f"/{camera}/property")
    messages = (or_none(recording.read, topic, entry) for entry in topic.entries) if topic else ()
    return dict(pair for message in messages if message and (pair := or_none(_property, message)))


def _property(wire: Wire) -> tuple[int, bytes] | None:
    """Number and value; the number has one or four bytes by version of the SDK, and the length tells which."""
    wire.header()
    rest = bytes(wire.take(wire.left))
    for size in (4, 1):
        (length,) = struct.unpack("<I", rest[size : size + 4].ljust(4, b"\xff"))
        if len(rest) == size + 4 + length + 4:
            return int.from_bytes(rest[:size], "little"), rest[size + 4 : size + 4 + length]
    return None


def _device(recording: Recording, camera: str) -> dict[str, str]:
    """Name, serial number and firmware of the camera."""
    return or_none(_device_info, recording, camera) or {}


def _device_info(recording: Recording, camera: str) -> dict[str, str]:
    wire = recording.first(f"/{camera}/deviceInfo")
    if wire is None:
        return {}
    wire.header()
    name = wire.string()
    wire.string(), wire.string(), wire.u16(), wire.u16(), wire.string()
    return {"device": name, "serial_number": wire.string(), "firmware": wire.string()}
