"""Recordings of the RealSense SDK and Viewer: ``.bag`` (to 2.58) and ``.db3`` (from 2.59).

They look like ROS bags but mean other things: mono16 (or 16UC1) depth is in the sensor's own unit, which stands
after the image, in its metadata, or among the options; camera models have other names; message times count from the
start of the recording.
"""

from __future__ import annotations

import math
import re
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.io.recordings import gravity, ros_messages
from siloscope.io.recordings.compressed_depth import decompress, read_compressed_image
from siloscope.io.recordings.recorded import RecordedSource
from siloscope.io.recordings.recording import Entry, Recording, Topic, or_none
from siloscope.io.recordings.streams import Stream
from siloscope.io.recordings.wire import Wire
from siloscope.io.source import Options
from siloscope.types.camera import Camera
from siloscope.types.frame import Frame

_DEPTH = re.compile(r"/(device_\d+/sensor_\d+/Depth_\d+)/image/data(/compressedDepth)?$")
_ACCEL = re.compile(r"/(device_\d+/sensor_\d+/Accel_\d+)/imu/data$")


def is_realsense(recording: Recording) -> bool:
    """Whether the topics are those of the RealSense SDK."""
    return any(re.match(r"/device_\d+/(sensor_\d+/|info$)", name) for name in recording.topics)


class RealSenseSource(RecordedSource):
    """One depth stream of a RealSense recording."""

    def __init__(self, path: Path, format: str, options: Options, recording: Recording) -> None:
        self._start = 0.0
        super().__init__(path, format, options, recording, _streams_of(recording))
        self._base = f"/{self.stream.name}"
        self.provenance.update(_device(recording, self._base))
        self.file_depth_unit = self._unit_option()
        if not options.cameras:
            self.file_camera = _camera(recording, self._base)
            self.provenance["camera_from"] = "recording"
        self._units = self._metadata_units()
        self._start = self._start_time()
        self.timestamps = [self._time(entry) for entry in self.stream.topic.entries]
        self.gravity, self.provenance["gravity_from"] = self._gravity()

    def _time(self, entry: Entry) -> float:
        return self._start + entry.time_ns / 1e9

    def _decode(self, entry: Entry) -> Frame:
        wire = self.recording.read(self.stream.topic, entry)
        unit = self._units.get(entry.time_ns)
        if self.stream.topic.type == "sensor_msgs/CompressedImage":
            depth = decompress(read_compressed_image(wire), transported=True)
        else:
            image = ros_messages.read_image(wire)
            unit, depth = _unit_after(image) or unit, ros_messages.depth_pixels(image)
        origin = {"depth_unit_from": "recording"} if unit or self.file_depth_unit else {}
        return Frame(depth=depth, depth_unit=unit, timestamp=self._time(entry), provenance=origin)

    def _unit_option(self) -> float | None:
        sensor = self._base.rsplit("/", 1)[0]
        for name in (f"{sensor}/option/Depth_Units/value", f"{sensor}/option/Depth Units/value"):
            unit = or_none(_number, self.recording, name)
            if unit is not None and _plausible(unit):
                return float(unit)
        return None

    def _metadata_units(self) -> dict[int, float]:
        """Units of the single frames, by their time, from the metadata of a ``.db3``."""
        topic = self.recording.topics.get(f"{self._base}/image/metadata")
        if topic is None or topic.type != "std_msgs/String":
            return {}
        told = {entry.time_ns: _pairs_at(self.recording, topic, entry).get("depth_units") for entry in topic.entries}
        units = {time: _float(text) for time, text in told.items()}
        return {time: unit for time, unit in units.items() if unit is not None and _plausible(unit)}

    def _start_time(self) -> float:
        """Time of the recording's start in seconds since 1970; 0 where only relative times are known."""
        topic = self.recording.topics.get(f"{self._base}/image/metadata")
        if topic is None:
            return 0.0
        for entry in topic.entries[:100]:
            now = _float(_pairs_at(self.recording, topic, entry).get("system_time"))
            if now:
                return now * 1e-3 - entry.time_ns / 1e9
        return 0.0

    def _gravity(self) -> tuple[NDArray[np.float64] | None, str]:
        topics = [t for t in self.recording.of_type("sensor_msgs/Imu") if _ACCEL.match(t.name)]
        if not topics:
            return None, "no accelerometer recorded"
        accel = topics[0]
        found, how = gravity.at_rest(gravity.accelerations(self.recording, accel))
        if found is None:
            return None, how
        depth_r = rotations(self.recording, self._base)
        accel_r = rotations(self.recording, accel.name.removesuffix("/imu/data"))
        shared = depth_r.keys() & accel_r.keys()
        if not shared:
            # The SDK turns accelerometer data to the depth camera's axes; only small misalignments remain.
            return found, f"{how}; its extrinsics are not recorded, taken to have the depth camera's axes"
        group = min(shared)
        return depth_r[group] @ accel_r[group].T @ found, how


def _streams_of(recording: Recording) -> list[Stream]:
    topics = recording.of_type("sensor_msgs/Image", "sensor_msgs/CompressedImage")
    return [_stream(recording, topic, match[1]) for topic in topics if (match := _DEPTH.match(topic.name))]


def _stream(recording: Recording, topic: Topic, name: str) -> Stream:
    camera = or_none(_camera, recording, f"/{name}")
    return Stream(name, "depth", topic, (camera.width, camera.height) if camera else None, "uint16")


def _unit_after(image: ros_messages.Image) -> float | None:
    """The unit that newer recorders put after the declared fields; their frame id is the version flag 1."""
    if image.header.frame_id != "1" or len(image.tail) < 4:
        return None
    unit = float(struct.unpack("<f", image.tail[:4])[0])
    return unit if _plausible(unit) else None


def _plausible(unit: float) -> bool:
    return math.isfinite(unit) and 0 < unit <= 1


def _float(text: str | None) -> float | None:
    try:
        value = float(text or "")
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _number(recording: Recording, name: str) -> float | None:
    wire = recording.first(name)
    if wire is None:
        return None
    return _float(wire.string()) if recording.topics[name].type == "std_msgs/String" else wire.f32()


def _pairs(wire: Wire, kind: str) -> dict[str, str]:
    """``key=value;…`` of a String, or the one pair of a KeyValue."""
    if kind == "diagnostic_msgs/KeyValue":
        return {wire.string(): wire.string()}
    parts = (part.partition("=") for part in wire.string().split(";") if "=" in part)
    return {key.strip(): value.strip() for key, _, value in parts}


def _pairs_at(recording: Recording, topic: Topic, entry: Entry) -> dict[str, str]:
    message = or_none(recording.read, topic, entry)
    return (or_none(_pairs, message, topic.type) if message else None) or {}


def _device(recording: Recording, base: str) -> dict[str, Any]:
    """Name, serial number and firmware of the camera."""
    topic = recording.topics.get("/" + base.split("/")[1] + "/info")
    pairs: dict[str, str] = {}
    if topic:
        for entry in topic.entries[:100]:
            pairs |= _pairs_at(recording, topic, entry)
    names = {"Name": "device", "Serial Number": "serial_number", "Firmware Version": "firmware"}
    return {ours: pairs[theirs] for theirs, ours in names.items() if theirs in pairs}


def _camera(recording: Recording, base: str) -> Camera | None:
    return _camera_from_text(recording, base) or _camera_from_info(recording, base)


def _camera_from_text(recording: Recording, base: str) -> Camera | None:
    """The ``width=…;fx=…;model=…`` of a ``.db3``: unlike its camera_info, it names the real distortion model."""
    wire = recording.first(f"{base}/camera_info")
    if wire is None or recording.topics[f"{base}/camera_info"].type != "std_msgs/String":
        return None
    told = _pairs(wire, "std_msgs/String")
    numbers = [_float(told.get(key)) for key in ("width", "height", "fx", "fy", "ppx", "ppy")]
    if None in numbers:
        return None
    width, height, fx, fy, cx, cy = (float(number or 0) for number in numbers)
    d = tuple(_float(text) or 0.0 for text in told.get("coeffs", "").split(","))
    name = f"{recording.name}, {base[1:]}"
    return ros_messages.camera(name, (int(width), int(height)), (fx, fy, cx, cy), told.get("model", ""), d)


def _camera_from_info(recording: Recording, base: str) -> Camera | None:
    for name in (f"{base}/info/camera_info", f"{base}/image/camera_info"):
        wire = recording.first(name)
        if wire is not None:
            return ros_messages.read_camera_info(wire).camera(f"{recording.name}, {name}")
    return None


def rotations(recording: Recording, base: str) -> dict[str, NDArray[np.float64]]:
    """Rotations from reference frames, by their name, to the stream's own frame: ``v_stream = R @ v_reference``."""
    start = f"{base}/tf/"
    found: dict[str, NDArray[np.float64]] = {}
    for name, topic in recording.topics.items():
        if name.startswith(start):
            rotation = or_none(rotation_of_topic, recording, topic)
            if rotation is not None:
                found[name.removeprefix(start)] = rotation
    return found


def rotation_of_topic(recording: Recording, topic: Topic) -> NDArray[np.float64] | None:
    wire, kind = recording.first(topic.name), topic.type
    if wire is None:
        return None
    if kind == "geometry_msgs/Transform":
        wire.floats(3)
        return ros_messages.rotation_of(wire.floats(4))
    numbers = [_float(text) for text in _pairs(wire, kind).get("rotation", "").split(",")]
    if len(numbers) != 9 or None in numbers:
        return None
    # The SDK stores rotations column by column.
    return np.array(numbers, dtype=np.float64).reshape(3, 3).T
