"""Depth, points and cameras of a recording's messages, whichever schema they have: ROS, Foxglove, or OAK's."""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np

from siloscope.errors import InputError
from siloscope.io.recordings import ros_messages
from siloscope.io.recordings.compressed_depth import CompressedImage, read_compressed_image
from siloscope.io.recordings.protobuf import messages_of
from siloscope.io.recordings.recording import Entry, Recording, Topic
from siloscope.io.recordings.ros_messages import CameraInfo, Image, PointCloud
from siloscope.io.recordings.wire import Header

IMAGES = ("sensor_msgs/Image", "foxglove.RawImage", "dai.proto.img_frame.ImgFrame")
COMPRESSED = ("sensor_msgs/CompressedImage", "foxglove.CompressedImage")
CLOUDS = ("sensor_msgs/PointCloud2", "foxglove.PointCloud")
CAMERAS = ("sensor_msgs/CameraInfo", "foxglove.CameraCalibration")
OAK = "dai.proto.img_frame.ImgFrame"

_NUMBERS = {1: "u1", 2: "i1", 3: "u2", 4: "i2", 5: "u4", 6: "i4", 7: "f4", 8: "f8"}
"""Foxglove's numeric types."""
_OAK_RAW16 = 14
_OAK_FISHEYE = 1


def image(recording: Recording, topic: Topic, entry: Entry) -> Image:
    """An image with its pixels undecoded; raises `InputError` for other messages."""
    if not _has_names(topic):
        return ros_messages.read_image(recording.read(topic, entry))
    fields = _fields(recording, topic, entry)
    return _oak_image(fields) if topic.type == OAK else _foxglove_image(fields)


def compressed(recording: Recording, topic: Topic, entry: Entry) -> CompressedImage:
    """A compressed image."""
    if not _has_names(topic):
        return read_compressed_image(recording.read(topic, entry))
    fields = _fields(recording, topic, entry)
    return CompressedImage(_header(fields), _text(fields, "format"), _bytes(fields, "data"))


def cloud(recording: Recording, topic: Topic, entry: Entry) -> PointCloud:
    """A cloud with its points undecoded."""
    if not _has_names(topic):
        return ros_messages.read_point_cloud(recording.read(topic, entry))
    fields = _fields(recording, topic, entry)
    step, data = _whole(fields, "point_stride"), _bytes(fields, "data")
    listed = fields.get("fields")
    columns = tuple(_column(field) for field in (listed if isinstance(listed, list) else ()))
    count = len(data) // step if step else 0
    return PointCloud(_header(fields), 1, count, columns, False, step, 0, data)


def camera_info(recording: Recording, topic: Topic, entry: Entry) -> CameraInfo:
    """The camera of a stream; OAK's images bring their own."""
    if not _has_names(topic):
        return ros_messages.read_camera_info(recording.read(topic, entry))
    fields = _fields(recording, topic, entry)
    if topic.type == OAK:
        return _oak_camera(fields)
    d, k, p = (tuple(_numbers(fields, key)) for key in ("D", "K", "P"))
    if len(k) != 9:
        raise InputError(f"{topic.name}: the calibration's K has {len(k)} numbers, not 9")
    size = _whole(fields, "height"), _whole(fields, "width")
    p = p if len(p) == 12 else (0.0,) * 12
    return CameraInfo(_header(fields), *size, _text(fields, "distortion_model"), d, k, p, (0, 0), (0, 0, 0, 0))


def header(recording: Recording, topic: Topic, entry: Entry) -> Header:
    """Time and frame of a message."""
    if not _has_names(topic):
        return recording.read(topic, entry).header()
    return _header(_fields(recording, topic, entry))


def _has_names(topic: Topic) -> bool:
    """Whether the fields are named in the message or its schema, rather than in a fixed order."""
    return topic.encoding in ("protobuf", "json")


def _fields(recording: Recording, topic: Topic, entry: Entry) -> dict[str, Any]:
    wire = recording.read(topic, entry)
    data = wire.take(wire.left)
    if topic.encoding == "protobuf":
        return messages_of(topic.schema).read(topic.type, data)
    try:
        fields = json.loads(bytes(data))
    except (ValueError, RecursionError) as error:
        raise InputError(f"a message is no JSON ({error})") from None
    if not isinstance(fields, dict):
        raise InputError("a message in JSON has no named fields")
    return fields


def _header(fields: dict[str, Any]) -> Header:
    stamp = fields.get("timestamp") or fields.get("ts")
    stamp = stamp if isinstance(stamp, dict) else {}
    parts = [stamp.get(a, stamp.get(b, 0)) for a, b in (("seconds", "sec"), ("nanos", "nsec"))]
    seconds, nanoseconds = (part if isinstance(part, int | float) else 0 for part in parts)
    return Header(seconds + nanoseconds * 1e-9, _text(fields, "frame_id"))


def _text(fields: dict[str, Any], key: str) -> str:
    value = fields.get(key, "")
    return value if isinstance(value, str) else ""


def _whole(fields: dict[str, Any], key: str) -> int:
    """A count; Protocol Buffers leave out what is 0."""
    value = fields.get(key, 0)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 1 << 32:
        raise InputError(f"field {key} of a message is {value!r}, no count")
    return value


def _bytes(fields: dict[str, Any], key: str) -> memoryview:
    value = fields.get(key, b"")
    if not isinstance(value, str):
        return memoryview(value if isinstance(value, bytes | memoryview) else b"")
    try:
        return memoryview(base64.b64decode(value, validate=True))
    except ValueError as error:
        raise InputError(f"field {key} of a message is no base64 ({error})") from None


def _numbers(fields: dict[str, Any], key: str) -> list[float]:
    values = fields.get(key) or []
    if not isinstance(values, list) or len(values) > 100 or not all(isinstance(v, int | float) for v in values):
        raise InputError(f"field {key} of a message is no short list of numbers")
    return [float(value) for value in values]


def _foxglove_image(fields: dict[str, Any]) -> Image:
    height, width, step = (_whole(fields, key) for key in ("height", "width", "step"))
    return Image(
        _header(fields), height, width, _text(fields, "encoding"), False, step, _bytes(fields, "data"), memoryview(b"")
    )


def _column(field: Any) -> ros_messages.Field:
    if not isinstance(field, dict):
        raise InputError("a field of the point cloud is damaged")
    kind = field.get("type", 0)
    return ros_messages.Field(_text(field, "name"), _whole(field, "offset"), _NUMBERS.get(kind, ""))


def _oak_image(fields: dict[str, Any]) -> Image:
    """OAK's depth: 16 bits a pixel, millimetres."""
    told = fields.get("fb")
    specs = told if isinstance(told, dict) else {}
    kind = "16UC1" if specs.get("type", 0) == _OAK_RAW16 else f"OAK type {specs.get('type', 0)}"
    height, width = _whole(specs, "height"), _whole(specs, "width")
    data = _bytes(fields, "data")
    if kind == "16UC1" and not len(data):
        raise InputError("only the frames' metadata are recorded; record with RecordMessage")
    return Image(_header(fields), height, width, kind, False, _whole(specs, "stride"), data, memoryview(b""))


def _oak_camera(fields: dict[str, Any]) -> CameraInfo:
    """Intrinsics of the source, taken through the image's crops and scales: ``K = T · K_source``."""
    told = fields.get("transformation")
    known = told if isinstance(told, dict) else {}
    source, change = (_matrix(known.get(key)) for key in ("sourceIntrinsicMatrix", "transformationMatrix"))
    k = change @ source
    if not np.all(np.isfinite(k)) or not k[2, 2]:
        raise InputError("the image's transformation is damaged")
    k /= k[2, 2]
    coefficients = known.get("distortionCoefficients")
    d = _numbers(coefficients, "values") if isinstance(coefficients, dict) else []
    while d and d[-1] == 0:
        d.pop()
    fisheye = known.get("distortionModel", 0) == _OAK_FISHEYE
    model = "equidistant" if fisheye else "rational_polynomial" if len(d) > 5 else "plumb_bob"
    size = _whole(known, "height"), _whole(known, "width")
    return CameraInfo(_header(fields), *size, model, tuple(d), tuple(k.ravel()), (0.0,) * 12, (0, 0), (0, 0, 0, 0))


def _matrix(value: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    arrays = value.get("arrays") if isinstance(value, dict) else None
    rows = [_numbers(row, "values") for row in arrays or () if isinstance(row, dict)]
    if len(rows) != 3 or any(len(row) != 3 for row in rows):
        raise InputError("the image brings no intrinsics")
    return np.array(rows)
