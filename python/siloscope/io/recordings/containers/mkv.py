"""Matroska recordings of Azure Kinect and Femto cameras (``k4arecorder``).

Depth is a track of raw 16-bit big-endian pictures in millimetres, the calibration an attached JSON file, and the
accelerometer a track of its own; no codec is needed, only Matroska's elements.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError
from siloscope.io.recordings import gravity, ros_messages
from siloscope.io.recordings.containers.file_recording import FileRecording, Place
from siloscope.io.recordings.recorded import RecordedSource
from siloscope.io.recordings.recording import Entry, Topic, or_none
from siloscope.io.recordings.streams import Stream
from siloscope.io.recordings.wire import Wire
from siloscope.io.source import Format, Options, check_image_size
from siloscope.types.camera import Camera
from siloscope.types.frame import Frame

MAGIC = b"\x1a\x45\xdf\xa3"
_SEGMENT, _INFO, _TRACKS, _ATTACHMENTS, _TAGS, _CLUSTER = (
    0x18538067, 0x1549A966, 0x1654AE6B, 0x1941A469, 0x1254C367, 0x1F43B675,
)  # fmt: skip
_SCALE, _DATE = 0x2AD7B1, 0x4461
_TRACK, _NUMBER, _NAME, _CODEC, _PRIVATE = 0xAE, 0xD7, 0x536E, 0x86, 0x63A2
_ATTACHED, _FILE_NAME, _FILE_DATA = 0x61A7, 0x466E, 0x465C
_TAG, _SIMPLE_TAG, _TAG_NAME, _TAG_STRING = 0x7373, 0x67C8, 0x45A3, 0x4487
_CLUSTER_TIME, _SIMPLE_BLOCK, _GROUP, _BLOCK = 0xE7, 0xA3, 0xA0, 0xA1
_LARGEST_METADATA = 1 << 24
_SECONDS_1970_TO_2001 = 978_307_200
_MODES = {(640, 576): (1024, 192, 180), (320, 288): (512, 96, 90), (1024, 1024): (1024, 0, 0), (512, 512): (512, 0, 0)}
"""Size of the depth image: side of the binned sensor, and the image's corner on it (k4a's depth modes)."""


class Element(NamedTuple):
    """One element: its number, and where its content lies; that of a cut-off one ends behind the file."""

    id: int
    start: int
    end: int


class Mkv(FileRecording):
    """A Matroska file with the tracks and attachments of ``k4arecorder``."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.sizes: dict[str, tuple[int, int, str]] = {}
        self.attachments: dict[str, bytes] = {}
        self.tags: dict[str, str] = {}
        self.start_ns = 0
        self._scale_ns = 1_000_000
        self._tracks: dict[int, Topic] = {}
        self._read_index()

    def _index(self) -> None:
        readers = {
            _INFO: self._read_info,
            _TRACKS: self._read_tracks,
            _ATTACHMENTS: self._read_attachments,
            _TAGS: self._read_tags,
            _CLUSTER: self._read_cluster,
        }
        for segment in self._elements(0, self.size):
            if segment.id == _SEGMENT:
                for element in self._elements(segment.start, segment.end):
                    if reader := readers.get(element.id):
                        reader(element)

    def _elements(self, at: int, end: int) -> Iterator[Element]:
        """Elements between two places; raises `InputError` after the one in which the file ends."""
        while at < min(end, self.size):
            head = self._bytes(at, min(12, self.size - at))
            number, length = _variable(head, keep_mark=True)
            size, more = _variable(head[length:], keep_mark=False)
            start = at + length + more
            unknown = size == (1 << 7 * more) - 1
            at = end if unknown else start + size
            yield Element(number, start, at)
            if at > self.size:
                raise InputError("the recording is cut off; frames before are read")
            if at > end:
                raise InputError("an element runs over the end of its parent; frames before are read")

    def _content(self, element: Element) -> bytes:
        size = element.end - element.start
        if size > _LARGEST_METADATA:
            raise InputError(f"a description is declared {size} bytes long; the file is damaged")
        return self._bytes(element.start, size)

    def _values(self, parent: Element) -> dict[int, bytes]:
        """Contents of the small elements in a parent; of repeated ones the last."""
        return {element.id: self._content(element) for element in self._elements(parent.start, parent.end)}

    def _read_info(self, info: Element) -> None:
        values = self._values(info)
        self._scale_ns = int.from_bytes(values.get(_SCALE, b""), "big") or 1_000_000
        date = values.get(_DATE, b"")
        if len(date) == 8:
            self.start_ns = _SECONDS_1970_TO_2001 * 10**9 + int.from_bytes(date, "big", signed=True)

    def _read_tracks(self, tracks: Element) -> None:
        for track in self._elements(tracks.start, tracks.end):
            if track.id == _TRACK:
                values = self._values(track)
                name, codec = (values.get(key, b"").decode("utf-8", "replace") for key in (_NAME, _CODEC))
                self._tracks[int.from_bytes(values.get(_NUMBER, b""), "big")] = self.declare(name, codec, "ros1")
                picture = values.get(_PRIVATE, b"")
                if len(picture) >= 20:
                    width, height = struct.unpack_from("<ii", picture, 4)
                    self.sizes[name] = width, abs(height), picture[16:20].decode("ascii", "replace")

    def _read_attachments(self, attachments: Element) -> None:
        for element in self._elements(attachments.start, attachments.end):
            if element.id == _ATTACHED:
                values = self._values(element)
                name = values.get(_FILE_NAME, b"").decode("utf-8", "replace")
                self.attachments[name] = values.get(_FILE_DATA, b"")

    def _read_tags(self, tags: Element) -> None:
        for tag in self._elements(tags.start, tags.end):
            for simple in self._elements(tag.start, tag.end) if tag.id == _TAG else ():
                if simple.id == _SIMPLE_TAG:
                    values = self._values(simple)
                    name, value = (values.get(key, b"").decode("utf-8", "replace") for key in (_TAG_NAME, _TAG_STRING))
                    self.tags[name] = value

    def _read_cluster(self, cluster: Element) -> None:
        time = 0
        for element in self._elements(cluster.start, cluster.end):
            if element.id == _CLUSTER_TIME:
                time = int.from_bytes(self._content(element)[:8], "big")
            elif element.id == _SIMPLE_BLOCK:
                self._add_block(element, time)
            elif element.id == _GROUP:
                for inner in self._elements(element.start, element.end):
                    if inner.id == _BLOCK:
                        self._add_block(inner, time)

    def _add_block(self, block: Element, cluster_time: int) -> None:
        head = self._bytes(block.start, min(12, block.end - block.start))
        number, length = _variable(head, keep_mark=False)
        if len(head) < length + 3:
            raise InputError("a block is damaged; frames before are read")
        (time,) = struct.unpack_from(">h", head, length)
        laced = head[length + 2] & 0x06
        topic = self._tracks.get(number)
        if topic and not laced and block.end <= self.size:
            where = Place(None, block.start + length + 3, block.end)
            topic.entries.append(Entry((cluster_time + time) * self._scale_ns, where))


def _variable(data: bytes, keep_mark: bool) -> tuple[int, int]:
    """An EBML number of variable length, and its length in bytes."""
    first = data[0] if data else 0
    length = 9 - first.bit_length()
    if length > 8 or len(data) < length:
        raise InputError("an element is damaged; frames before are read")
    value = int.from_bytes(data[:length], "big")
    return value if keep_mark else value & ((1 << 7 * length) - 1), length


class MkvSource(RecordedSource):
    """The depth track."""

    def __init__(self, path: Path, options: Options) -> None:
        recording = Mkv(path)
        try:
            self.mkv = recording
            super().__init__(path, "mkv", options, recording, _streams_of(recording))
            self.file_depth_unit = 0.001
            self.provenance.update(_device(recording))
            self.timestamps = [self._time(entry) for entry in self.stream.topic.entries]
            calibration = _calibration(recording)
            if not options.cameras:
                self.file_camera = _camera(self.name, calibration, recording.sizes[self.stream.name][:2])
                self.provenance["camera_from"] = "calibration.json attached"
            self.gravity, self.provenance["gravity_from"] = _gravity(recording, calibration)
        except BaseException:
            recording.close()
            raise

    def _time(self, entry: Entry) -> float:
        return (self.mkv.start_ns + entry.time_ns) / 1e9

    def _decode(self, entry: Entry) -> Frame:
        width, height, _ = self.mkv.sizes[self.stream.name]
        wire = self.recording.read(self.stream.topic, entry)
        if wire.left != width * height * 2:
            raise InputError(
                f"a picture of {width} x {height} pixels takes {width * height * 2} bytes, not {wire.left}"
            )
        depth = np.frombuffer(wire.take(wire.left), ">u2").reshape(height, width).astype(np.uint16)
        origin = {"depth_unit_from": "k4arecorder (millimetres)"}
        return Frame(depth=depth, timestamp=self._time(entry), provenance=origin)


def _streams_of(recording: Mkv) -> list[Stream]:
    topic = recording.topics.get("DEPTH")
    if topic is None or not topic.entries:
        if recording.damage:
            raise InputError(recording.damage)
        names = ", ".join(recording.topics) or "none"
        raise InputError(f"{recording.name}: no DEPTH track as k4arecorder writes it; the tracks are: {names}")
    width, height, pixels = recording.sizes.get("DEPTH", (0, 0, "nothing"))
    if pixels != "b16g":
        raise InputError(f"{recording.name}: the DEPTH track is '{pixels}', not b16g; only raw 16-bit depth is read")
    check_image_size(recording.name, width, height)
    return [Stream("DEPTH", "depth", topic, (width, height), "uint16")]


def _device(recording: Mkv) -> dict[str, Any]:
    names = {
        "K4A_DEVICE_SERIAL_NUMBER": "serial_number",
        "K4A_DEPTH_FIRMWARE_VERSION": "firmware",
        "K4A_DEPTH_MODE": "depth_mode",
    }
    return {ours: recording.tags[theirs] for theirs, ours in names.items() if theirs in recording.tags}


def _calibration(recording: Mkv) -> dict[str, Any]:
    """The ``CalibrationInformation`` attached; empty where there is none."""
    for data in recording.attachments.values():
        try:
            inside = json.loads(data.rstrip(b"\0"))
        except (ValueError, RecursionError):
            continue
        if isinstance(inside, dict) and isinstance(inside.get("CalibrationInformation"), dict):
            return dict(inside["CalibrationInformation"])
    return {}


def _camera(name: str, calibration: dict[str, Any], size: tuple[int, int]) -> Camera | None:
    """Intrinsics of the depth mode: those of the whole sensor, binned and cropped."""
    depth = _part(calibration, "Cameras", "Purpose", "Depth")
    if depth is None or size not in _MODES:
        return None
    side, left, top = _MODES[size]
    model = str(depth.get("Intrinsics", {}).get("ModelType"))
    numbers = _numbers(depth.get("Intrinsics", {}).get("ModelParameters"), 14)
    if numbers is None:
        return None
    cx, cy, fx, fy, k1, k2, k3, k4, k5, k6, x_shift, y_shift, p2, p1 = numbers.tolist()
    if not model.endswith("BrownConrady") or x_shift or y_shift:
        raise InputError(f"{name}: unknown distortion model '{model}'; give the camera with --camera FILE")
    focal = fx * side, fy * side, cx * side - left - 0.5, cy * side - top - 0.5
    return ros_messages.camera(name, size, focal, "rational", (k1, k2, p1, p2, k3, k4, k5, k6))


def _part(calibration: dict[str, Any], group: str, key: str, ending: str) -> dict[str, Any] | None:
    parts = calibration.get(group)
    for part in parts if isinstance(parts, list) else ():
        if isinstance(part, dict) and str(part.get(key)).endswith(ending):
            return part
    return None


def _numbers(value: Any, count: int) -> NDArray[np.float64] | None:
    if not isinstance(value, list) or len(value) < count:
        return None
    if not all(isinstance(number, int | float) and not isinstance(number, bool) for number in value[:count]):
        return None
    return np.array(value[:count], dtype=np.float64)


def _gravity(recording: Mkv, calibration: dict[str, Any]) -> tuple[NDArray[np.float64] | None, str]:
    """Gravity from the IMU track; the calibration's rotation takes depth to accelerometer coordinates."""
    topic = recording.topics.get("IMU")
    if topic is None or not topic.entries:
        return None, "no accelerometer recorded"
    accelerometer = _part(calibration, "InertialSensors", "SensorType", "Accelerometer") or {}
    rotation = _numbers(accelerometer.get("Rt", {}).get("Rotation"), 9)
    if rotation is None:
        return None, "the accelerometer's extrinsics are not recorded"
    few = topic.entries[:: max(1, len(topic.entries) // 500)]
    samples = [sample for entry in few if (sample := or_none(_acceleration, recording.read(topic, entry))) is not None]
    found, how = gravity.at_rest(np.array(samples).reshape(-1, 3))
    return None if found is None else rotation.reshape(3, 3).T @ found, how


def _acceleration(wire: Wire) -> NDArray[np.float64]:
    wire.u64()
    return wire.floats(3, 4)


FORMAT = Format("mkv", lambda head, path: head.startswith(MAGIC), MkvSource)
