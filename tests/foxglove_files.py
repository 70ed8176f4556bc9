"""MCAP files with Foxglove's and OAK's messages, written by the `mcap` library and an encoder of our own; RVL."""

from __future__ import annotations

import base64
import io
import json
import struct
from collections.abc import Iterable
from typing import Any

import numpy as np
from mcap.writer import Writer
from numpy.typing import NDArray

from bags import START_NS

Value = tuple[int, str, Any]
"""Number, kind and value of a field of a message in Protocol Buffers."""

_KINDS = {"double": 1, "float": 2, "int64": 3, "int32": 5, "fixed32": 7, "string": 9, "message": 11, "bytes": 12}
_KINDS |= {"uint32": 13, "enum": 14}
_STAMP = [("seconds", 1, "int64", False, ""), ("nanos", 2, "int32", False, "")]
_FLOATS = [("values", 1, "float", True, "")]

Layout = list[tuple[str, int, str, bool, str]]
"""Name, number, kind, whether repeated, and the message's name, of every field."""

MESSAGES: dict[str, Layout] = {
    "google.protobuf.Timestamp": _STAMP,
    "foxglove.RawImage": [
        ("timestamp", 1, "message", False, "google.protobuf.Timestamp"),
        ("frame_id", 7, "string", False, ""),
        ("width", 2, "fixed32", False, ""),
        ("height", 3, "fixed32", False, ""),
        ("encoding", 4, "string", False, ""),
        ("step", 5, "fixed32", False, ""),
        ("data", 6, "bytes", False, ""),
    ],
    "foxglove.CompressedImage": [
        ("timestamp", 1, "message", False, "google.protobuf.Timestamp"),
        ("frame_id", 4, "string", False, ""),
        ("data", 2, "bytes", False, ""),
        ("format", 3, "string", False, ""),
    ],
    "foxglove.PackedElementField": [
        ("name", 1, "string", False, ""),
        ("offset", 2, "fixed32", False, ""),
        ("type", 3, "enum", False, ""),
    ],
    "foxglove.PointCloud": [
        ("timestamp", 1, "message", False, "google.protobuf.Timestamp"),
        ("frame_id", 2, "string", False, ""),
        ("point_stride", 4, "fixed32", False, ""),
        ("fields", 5, "message", True, "foxglove.PackedElementField"),
        ("data", 6, "bytes", False, ""),
    ],
    "foxglove.CameraCalibration": [
        ("timestamp", 1, "message", False, "google.protobuf.Timestamp"),
        ("frame_id", 9, "string", False, ""),
        ("width", 2, "fixed32", False, ""),
        ("height", 3, "fixed32", False, ""),
        ("distortion_model", 4, "string", False, ""),
        ("D", 5, "double", True, ""),
        ("K", 6, "double", True, ""),
        ("P", 8, "double", True, ""),
    ],
    "dai.proto.common.FloatArray": _FLOATS,
    "dai.proto.common.TransformationMatrix": [("arrays", 1, "message", True, "dai.proto.common.FloatArray")],
    "dai.proto.common.ImgTransformation": [
        ("transformationMatrix", 1, "message", False, "dai.proto.common.TransformationMatrix"),
        ("sourceIntrinsicMatrix", 2, "message", False, "dai.proto.common.TransformationMatrix"),
        ("distortionModel", 3, "enum", False, ""),
        ("distortionCoefficients", 4, "message", False, "dai.proto.common.FloatArray"),
        ("width", 7, "uint32", False, ""),
        ("height", 8, "uint32", False, ""),
    ],
    "dai.proto.img_frame.Specs": [
        ("type", 1, "enum", False, ""),
        ("width", 2, "uint32", False, ""),
        ("height", 3, "uint32", False, ""),
        ("stride", 4, "uint32", False, ""),
    ],
    "dai.proto.img_frame.ImgFrame": [
        ("fb", 4, "message", False, "dai.proto.img_frame.Specs"),
        ("transformation", 9, "message", False, "dai.proto.common.ImgTransformation"),
        ("data", 11, "bytes", False, ""),
    ],
}


def _varint(value: int) -> bytes:
    out = b""
    while value > 0x7F:
        out, value = out + bytes([value & 0x7F | 0x80]), value >> 7
    return out + bytes([value])


def _delimited(number: int, data: bytes) -> bytes:
    return _varint(number << 3 | 2) + _varint(len(data)) + data


def encoded(name: str, fields: dict[str, Any]) -> bytes:
    """A message in Protocol Buffers; repeated numbers are packed."""
    out = b""
    for key, number, kind, repeated, message in MESSAGES[name]:
        if key in fields:
            out += _field(number, kind, repeated, message, fields[key])
    return out


def _field(number: int, kind: str, repeated: bool, message: str, value: Any) -> bytes:
    if kind == "message":
        return b"".join(_delimited(number, encoded(message, one)) for one in (value if repeated else [value]))
    if kind in ("string", "bytes"):
        return _delimited(number, value.encode() if isinstance(value, str) else bytes(value))
    if kind in ("double", "float"):
        return _delimited(number, np.asarray(value, "<f8" if kind == "double" else "<f4").tobytes())
    if kind == "fixed32":
        return _varint(number << 3 | 5) + struct.pack("<I", value)
    return _varint(number << 3) + _varint(value)


def descriptors() -> bytes:
    """A ``FileDescriptorSet`` of all messages, one file a package."""
    out = b""
    for package in dict.fromkeys(name.rsplit(".", 1)[0] for name in MESSAGES):
        file = _delimited(1, f"{package}.proto".encode()) + _delimited(2, package.encode())
        for name, layout in MESSAGES.items():
            if name.rsplit(".", 1)[0] == package:
                file += _delimited(4, _described(name.rsplit(".", 1)[1], layout))
        out += _delimited(1, file)
    return out


def _described(name: str, layout: Layout) -> bytes:
    out = _delimited(1, name.encode())
    for key, number, kind, repeated, message in layout:
        field = _delimited(1, key.encode()) + _varint(3 << 3) + _varint(number)
        field += _varint(4 << 3) + _varint(3 if repeated else 1) + _varint(5 << 3) + _varint(_KINDS[kind])
        out += _delimited(2, field + (_delimited(6, f".{message}".encode()) if message else b""))
    return out


def mcap(
    messages: Iterable[tuple[str, str, dict[str, Any]]], encoding: str = "protobuf", described: bytes | None = None
) -> bytes:
    """An MCAP file of (topic, type, fields); `described` stands in place of the messages' descriptors."""
    file = io.BytesIO()
    writer = Writer(file)
    writer.start()
    channels: dict[str, int] = {}
    for count, (topic, name, fields) in enumerate(messages):
        if topic not in channels:
            known = (descriptors() if encoding == "protobuf" else b"{}") if described is None else described
            schema = writer.register_schema(name, "protobuf" if encoding == "protobuf" else "jsonschema", known)
            channels[topic] = writer.register_channel(topic, encoding, schema)
        data = encoded(name, fields) if encoding == "protobuf" else json.dumps(_as_json(fields)).encode()
        time_ns = START_NS + count
        writer.add_message(channels[topic], log_time=time_ns, data=data, publish_time=time_ns)
    writer.finish()  # type: ignore[no-untyped-call]
    return file.getvalue()


def _as_json(value: Any) -> Any:
    if isinstance(value, bytes):
        return base64.b64encode(value).decode()
    if isinstance(value, dict):
        renamed = {"seconds": "sec", "nanos": "nsec"}
        return {renamed.get(key, key): _as_json(one) for key, one in value.items()}
    return [_as_json(one) for one in value] if isinstance(value, list | tuple) else value


STAMP = {"seconds": 1_700_000_000, "nanos": 500_000_000}


def raw_image(depth: NDArray[Any], encoding: str = "16UC1") -> dict[str, Any]:
    """The fields of a RawImage."""
    height, width = depth.shape
    step = width * depth.dtype.itemsize
    size = {"width": width, "height": height, "encoding": encoding, "step": step}
    return {"timestamp": STAMP, "frame_id": "optical", **size, "data": depth.tobytes()}


def compressed_image(data: bytes, format: str = "png") -> dict[str, Any]:
    """The fields of a CompressedImage."""
    return {"timestamp": STAMP, "frame_id": "optical", "data": data, "format": format}


def calibration(size: tuple[int, int], k: Iterable[float], d: Iterable[float] = ()) -> dict[str, Any]:
    """The fields of a CameraCalibration."""
    numbers = {"K": list(k), "D": list(d), "distortion_model": "plumb_bob"}
    return {"timestamp": STAMP, "frame_id": "optical", "width": size[0], "height": size[1], **numbers}


def point_cloud(points: NDArray[np.float32]) -> dict[str, Any]:
    """The fields of a PointCloud, x, y and z with four bytes between the points."""
    rows = np.zeros((len(points), 4), "<f4")
    rows[:, :3] = points
    fields = [{"name": name, "offset": 4 * i, "type": 7} for i, name in enumerate("xyz")]
    told = {"point_stride": 16, "fields": fields, "data": rows.tobytes()}
    return {"timestamp": STAMP, "frame_id": "optical", **told}


def oak_frame(raw: NDArray[np.uint16], source: NDArray[Any], change: NDArray[Any], kind: int = 14) -> dict[str, Any]:
    """The fields of an OAK's ImgFrame: intrinsics of the source and how the image was made from it."""
    height, width = raw.shape
    matrices = {
        name: {"arrays": [{"values": [float(value) for value in row]} for row in matrix]}
        for name, matrix in (("transformationMatrix", change), ("sourceIntrinsicMatrix", source))
    }
    specs = {"type": kind, "width": width, "height": height, "stride": 2 * width}
    return {"fb": specs, "transformation": {**matrices, "width": width, "height": height}, "data": raw.tobytes()}


def rvl(raw: NDArray[np.uint16]) -> bytes:
    """RVL as its paper describes it: runs of zeros and of steps, in pieces of three bits."""
    pieces: list[int] = []

    def put(number: int) -> None:
        while number > 7:
            pieces.append(number & 7 | 8)
            number >>= 3
        pieces.append(number)

    flat, at, last = raw.ravel().astype(int).tolist(), 0, 0
    while at < len(flat):
        zeros = next((i for i, value in enumerate(flat[at:]) if value), len(flat) - at)
        at += zeros
        measured = next((i for i, value in enumerate(flat[at:]) if not value), len(flat) - at)
        put(zeros)
        put(measured)
        for value in flat[at : at + measured]:
            put((value - last << 1) ^ (value - last >> 63))
            last = value
        at += measured
    pieces += [0] * (-len(pieces) % 8)
    words = [sum(piece << 28 - 4 * i for i, piece in enumerate(pieces[at : at + 8])) for at in range(0, len(pieces), 8)]
    return struct.pack(f"<{len(words)}I", *words)


def transported(raw: NDArray[np.uint16], a: float = 0.0, b: float = 0.0) -> bytes:
    """RVL as ``compressedDepth`` wraps it: header with A and B, width and height."""
    height, width = raw.shape
    return struct.pack("<iffII", 0, a, b, width, height) + rvl(raw)
