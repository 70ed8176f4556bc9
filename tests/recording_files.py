"""Small recordings and clouds, made from scratch or by other libraries: what tests read and mutate."""

from __future__ import annotations

import importlib
import importlib.util
import io
import json
import struct
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import foxglove_files as foxglove
from bags import START_NS, Maker, Message, orbbec, png16, quantised
from siloscope import _core

DATA = Path(__file__).parent / "data"
RAW = np.random.default_rng(3).integers(300, 6000, (2, 12, 16), dtype=np.uint16)
METRES = (RAW[0] / 1000).astype(np.float32)
K = (57.0, 0.0, 7.5, 0.0, 57.25, 5.25, 0.0, 0.0, 1.0)


def _messages(maker: Maker) -> list[Message]:
    """One depth stream with all that stands beside one."""
    found: list[Message] = (
        [
            ("/tf_static", START_NS, maker.transform("base", "imu", (0.0, 0.0, 0.6, 0.8))),
            ("/tf_static", START_NS, maker.transform("base", "optical", (0.6, 0.0, 0.0, 0.8))),
        ]
        if maker.ros == 2
        else []
    )
    for number, raw in enumerate(RAW):
        time_ns = START_NS + number * 33_000_000
        found.append(("/camera/depth/image_raw", time_ns, maker.image(raw, "16UC1")))
        found.append(("/camera/depth/camera_info", time_ns, maker.camera_info((16, 12), K, (0.01,) * 5)))
        found.append(("/imu", time_ns, maker.imu((0.0, -9.8, 0.2), frame="imu" if maker.ros == 2 else "optical")))
    return found


def _in_folder(make: Callable[[Path], Any]) -> bytes:
    """The one file that `make` writes at a path, or in a folder there."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "made"
        make(path)
        files = [file for file in path.iterdir() if file.suffix != ".yaml"] if path.is_dir() else [path]
        return files[0].read_bytes()


def ros1(compression: str | None) -> bytes:
    """A ROS 1 bag."""
    maker = Maker(1)
    return _in_folder(lambda path: maker.write(path, _messages(maker), compression=compression))


def ros2(mcap: bool, compression: str | None = None) -> bytes:
    """A file of a ROS 2 bag."""
    maker = Maker(2)
    return _in_folder(lambda path: maker.write(path, _messages(maker), mcap=mcap, compression=compression))


def compressed_depth() -> bytes:
    """A ROS 1 bag with quantised floating-point depth."""
    maker = Maker(1)
    image = maker.compressed("32FC1; compressedDepth png", quantised(METRES, 10_100.0, -1009.0))
    return _in_folder(lambda path: maker.write(path, [("/depth/image/compressedDepth", START_NS, image)]))


def compressed_rvl() -> bytes:
    """A ROS 1 bag with depth as RVL."""
    maker = Maker(1)
    image = maker.compressed("16UC1; compressedDepth rvl", foxglove.transported(RAW[0]))
    return _in_folder(lambda path: maker.write(path, [("/depth/image/compressedDepth", START_NS, image)]))


def compressed_raw() -> bytes:
    """A ROS 2 file with depth as PNG."""
    maker = Maker(2)
    image = maker.compressed("16UC1; compressedDepth png", bytes(12) + png16(RAW[0]))
    return _in_folder(lambda path: maker.write(path, [("/depth/image/compressedDepth", START_NS, image)], mcap=True))


def clouds() -> bytes:
    """A ROS 1 bag with an organised cloud."""
    maker = Maker(1)
    points = np.random.default_rng(4).normal(size=(12, 16, 3)).astype(np.float32)
    return _in_folder(lambda path: maker.write(path, [("/points", START_NS, maker.cloud(points))]))


def orbbec_bag() -> bytes:
    """An Orbbec recording with unit, accelerometer and extrinsics."""
    properties = {176: struct.pack("<f", 0.25), 75: struct.pack("<i", 1)}
    accel = np.array([-9.8, 0.1, 0.2])
    return _in_folder(lambda path: orbbec(path, RAW, unit=0.0, properties=properties, accel=accel))


# --- Matroska, as k4arecorder lays it out.


def _element(number: int, content: bytes) -> bytes:
    name = number.to_bytes((number.bit_length() + 7) // 8, "big")
    return name + (len(content) | 1 << 56).to_bytes(8, "big") + content


def _calibration() -> bytes:
    parameters = [0.5, 0.5, 0.49, 0.49, 0.5, -0.02, 0.003, 0.9, 0.08, -0.01, 0, 0, -7e-5, 2e-5]
    model = {"ModelParameters": parameters, "ModelType": "CALIBRATION_LensDistortionModelBrownConrady"}
    camera = {"Purpose": "CALIBRATION_CameraPurposeDepth", "Intrinsics": model}
    rotation = {"Rotation": [0, 0, -1, -1, 0, 0, 0, 1, 0]}
    imu = {"SensorType": "CALIBRATION_InertialSensorType_Accelerometer", "Rt": rotation}
    return json.dumps({"CalibrationInformation": {"Cameras": [camera], "InertialSensors": [imu]}}).encode()


def mkv(frames: int = 1) -> bytes:
    """A recording of the narrow field of view, binned: the smallest there is (320 x 288)."""
    depth = np.random.default_rng(5).integers(200, 4000, (288, 320)).astype(">u2")
    picture = struct.pack("<iiihh4s", 40, 320, 288, 1, 16, b"b16g") + bytes(20)
    tracks = [
        _element(0xD7, b"\x01") + _element(0x536E, b"DEPTH") + _element(0x63A2, picture),
        _element(0xD7, b"\x02") + _element(0x536E, b"IMU") + _element(0x86, b"S_K4A/IMU"),
    ]
    attached = _element(0x466E, b"calibration.json") + _element(0x465C, _calibration())
    tag = _element(0x67C8, _element(0x45A3, b"K4A_DEVICE_SERIAL_NUMBER") + _element(0x4487, b"0001"))
    sample = struct.pack("<Q3fQ3f", 5, -0.1, 0.2, -9.8, 5, 0, 0, 0)
    clusters = b""
    for number in range(frames):
        imu = _element(0xA0, _element(0xA1, b"\x82\x00\x00\x00" + sample))
        block = _element(0xA3, b"\x81\x00\x01\x80" + depth.tobytes())
        clusters += _element(0x1F43B675, _element(0xE7, (33 * number).to_bytes(2, "big")) + imu + block)
    segment = (
        _element(0x1549A966, _element(0x2AD7B1, (1_000_000).to_bytes(4, "big")) + _element(0x4461, bytes(7) + b"\x01"))
        + _element(0x1654AE6B, b"".join(_element(0xAE, track) for track in tracks))
        + _element(0x1941A469, _element(0x61A7, attached))
        + _element(0x1254C367, _element(0x7373, tag))
        + clusters
    )
    return _element(0x1A45DFA3, _element(0x4282, b"matroska")) + _element(0x18538067, segment)


# --- E57, laid out by hand: two scans, floats and 11-bit integers.

_E57_XML = """<?xml version="1.0" encoding="UTF-8"?>
<e57Root type="Structure" xmlns="http://www.astm.org/COMMIT/E57/2010-e57-v1.0"><data3D type="Vector">
<vectorChild type="Structure"><name type="String">floats</name>
<points type="CompressedVector" fileOffset="{0}" recordCount="30"><prototype type="Structure">
<cartesianX type="Float" precision="single"/><cartesianY type="Float" precision="single"/><cartesianZ type="Float"/>
<cartesianInvalidState type="Integer" minimum="0" maximum="2"/></prototype></points></vectorChild>
<vectorChild type="Structure"><points type="CompressedVector" fileOffset="{1}" recordCount="40">
<prototype type="Structure">
<sphericalRange type="ScaledInteger" minimum="-1000" maximum="1000" scale="0.001" offset="2"/>
<sphericalAzimuth type="Float"/><sphericalElevation type="Float" precision="single"/></prototype></points></vectorChild>
</data3D></e57Root>"""


def e57() -> bytes:
    """An E57 file."""
    rng = np.random.default_rng(8)
    floats = rng.normal(size=(3, 40))
    flags = np.packbits(np.zeros(60, np.uint8), bitorder="little").tobytes()
    xy = floats[:2, :30].astype("<f4")
    first = [xy[0].tobytes(), xy[1].tobytes(), floats[2, :30].tobytes(), flags]
    ranges = rng.integers(0, 2001, 40)
    bits = (ranges[:, None] >> np.arange(11) & 1).astype(np.uint8)
    packed = np.packbits(bits, bitorder="little").tobytes()
    second = [packed, floats[1].tobytes(), floats[2].astype("<f4").tobytes()]
    logical = bytearray(48)
    places = []
    for columns in (first, second):
        places.append(_physical(len(logical)))
        logical += _section(columns, len(logical))
    xml_at = len(logical)
    xml = _E57_XML.format(*places).encode()
    logical += xml
    logical += bytes(-len(logical) % 1020)
    pages = len(logical) // 1020
    logical[:48] = b"ASTM-E57" + struct.pack("<IIQQQQ", 1, 0, pages * 1024, _physical(xml_at), len(xml), 1024)
    return b"".join(_page(bytes(logical[i * 1020 : (i + 1) * 1020])) for i in range(pages))


def _physical(logical: int) -> int:
    return logical + logical // 1020 * 4


def _page(content: bytes) -> bytes:
    return content + _core.checksum(content).to_bytes(4, "big")


def _section(columns: list[bytes], at: int) -> bytes:
    sizes = b"".join(struct.pack("<H", len(column)) for column in columns)
    packet = struct.pack("<H", len(columns)) + sizes + b"".join(columns)
    packet += bytes(-(len(packet) + 4) % 4)
    packet = struct.pack("<BBH", 1, 0, len(packet) + 3) + packet
    return struct.pack("<B7xQQQ", 1, 32 + len(packet), _physical(at + 32), 0) + packet


# --- Foxglove and OAK.


def _foxglove(encoding: str) -> bytes:
    """An image with its calibration, a compressed one and a cloud."""
    points = np.random.default_rng(4).normal(size=(60, 3)).astype(np.float32)
    return foxglove.mcap(
        [
            ("/cam/calibration", "foxglove.CameraCalibration", foxglove.calibration((16, 12), K)),
            ("/cam/image", "foxglove.RawImage", foxglove.raw_image(RAW[0])),
            ("/points", "foxglove.PointCloud", foxglove.point_cloud(points)),
        ],
        encoding,
    )


def _oak() -> bytes:
    """An OAK's depth."""
    frame = foxglove.oak_frame(RAW[0], np.array(K).reshape(3, 3), np.eye(3))
    return foxglove.mcap([("depth", "dai.proto.img_frame.ImgFrame", frame)])


# --- By other libraries.


def las(compressed: bool) -> bytes:
    """A LAS or LAZ file."""
    laspy = importlib.import_module("laspy")
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.scales, header.offsets = np.full(3, 0.001), np.array([500_000.0, 4_000_000.0, 100.0])
    cloud = laspy.LasData(header)
    points = np.random.default_rng(9).uniform(0, 10, (500, 3)) + header.offsets
    cloud.x, cloud.y, cloud.z = points.T
    buffer = io.BytesIO()
    cloud.write(buffer, do_compress=compressed)
    return buffer.getvalue()


def exr() -> bytes:
    """An EXR image with colour and depth."""
    library = importlib.import_module("OpenEXR")
    channels = {"R": METRES, "G": METRES, "B": METRES, "Depth.Z": METRES}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "depth.exr"
        library.File({}, channels).write(str(path))
        return path.read_bytes()


MAKERS: dict[str, Callable[[], bytes]] = {
    "realsense.bag": (DATA / "realsense.bag").read_bytes,
    "realsense.db3": (DATA / "realsense.db3").read_bytes,
    "orbbec.bag": orbbec_bag,
    "ros1.bag": lambda: ros1(None),
    "ros1-lz4.bag": lambda: ros1("lz4"),
    "ros1-bz2.bag": lambda: ros1("bz2"),
    "ros1-quantised.bag": compressed_depth,
    "ros1-cloud.bag": clouds,
    "ros2.db3": lambda: ros2(mcap=False),
    "ros2.mcap": lambda: ros2(mcap=True),
    "ros2-zstd.mcap": lambda: ros2(mcap=True, compression="zstd"),
    "ros2-png.mcap": compressed_raw,
    "ros1-rvl.bag": compressed_rvl,
    "foxglove.mcap": lambda: _foxglove("protobuf"),
    "foxglove-json.mcap": lambda: _foxglove("json"),
    "oak.mcap": _oak,
    "kinect.mkv": mkv,
    "cloud.e57": e57,
}
"""Good files by name."""

if importlib.util.find_spec("laspy") and importlib.util.find_spec("lazrs"):
    MAKERS |= {"cloud.las": lambda: las(compressed=False), "cloud.laz": lambda: las(compressed=True)}
if importlib.util.find_spec("OpenEXR"):
    MAKERS["depth.exr"] = exr


def with_checksums(data: bytes) -> bytes:
    """The checksums of E57 pages made right again, so that damage reaches what is behind them."""
    if data.startswith(b"ASTM-E57"):
        pages = [data[at : at + 1020] for at in range(0, len(data) // 1024 * 1024, 1024)]
        return b"".join(_page(page) for page in pages) + data[len(data) // 1024 * 1024 :]
    return data
