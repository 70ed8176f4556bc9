"""Lossless depth in compressed topics, Foxglove's messages and OAK's; what isn't read is listed with the reason."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

import foxglove_files as foxglove
import siloscope
from bags import START_NS, Maker, png16
from foxglove_files import rvl, transported
from siloscope import Camera, Frame, InputError, _core
from siloscope.cli import main

RAW = np.random.default_rng(5).integers(400, 7000, (24, 32)).astype(np.uint16)
RAW[:2, 3:9] = 0
K = (31.5, 0.0, 15.75, 0.0, 31.75, 11.25, 0.0, 0.0, 1.0)
CAMERA = Camera(32, 24, 31.5, 31.75, 15.75, 11.25)


def written(folder: Path, content: bytes, name: str = "recording.mcap") -> Path:
    (folder / name).write_bytes(content)
    return folder / name


def only(path: Path, **options: Any) -> Frame:
    with siloscope.open(path, **options) as source:
        (frame,) = source
    return frame


def tiff(pixels: NDArray[Any], **options: Any) -> bytes:
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "TIFF", **options)
    return file.getvalue()


def bag(folder: Path, topic: str, format: str, data: bytes, ros: int = 1) -> Path:
    maker = Maker(ros)
    info = maker.camera_info((32, 24), K)
    messages = [(topic, START_NS, maker.compressed(format, data)), ("/kinect2/sd/camera_info", START_NS, info)]
    path = maker.write(folder / ("one.bag" if ros == 1 else "two"), messages, **({} if ros == 1 else {"mcap": True}))
    return path


LOSSLESS = {"16UC1; png compressed ": png16(RAW), "16UC1; tiff compressed": tiff(RAW)}


@pytest.mark.parametrize("ros", [1, 2])
@pytest.mark.parametrize(("format", "data"), LOSSLESS.items())
def test_png_and_tiff_by_the_compressed_transport(tmp_path: Path, ros: int, format: str, data: bytes) -> None:
    frame = only(bag(tmp_path, "/kinect2/sd/image_depth/compressed", format, data, ros))
    assert np.array_equal(np.asarray(frame.depth), RAW)
    assert (frame.depth_unit, frame.camera) == (0.001, CAMERA)


def test_metres_in_a_tiff(tmp_path: Path) -> None:
    metres = (RAW / 1000).astype(np.float32)
    frame = only(bag(tmp_path, "/depth/image/compressed", "32FC1; tiff compressed", tiff(metres)))
    assert np.array_equal(np.asarray(frame.depth), metres)
    assert frame.depth_unit is None


def test_rvl_of_raw_units_and_of_inverse_depth(tmp_path: Path) -> None:
    frame = only(bag(tmp_path, "/depth/image/compressedDepth", "16UC1; compressedDepth rvl", transported(RAW)))
    assert np.array_equal(np.asarray(frame.depth), RAW)
    a, b = 10_100.0, -1009.0
    metres = np.where(RAW > 0, RAW / 1000, np.nan)
    q = np.nan_to_num(a / metres + b).astype(np.uint16)
    second = bag(tmp_path, "/depth/image/compressedDepth", "32FC1; compressedDepth rvl", transported(q, a, b), ros=2)
    frame = only(second)
    assert np.allclose(np.asarray(frame.depth), metres, rtol=2e-3, equal_nan=True)


@pytest.mark.parametrize("kind", ["empty", "full", "steps"])
def test_rvl_gives_every_pixel_back(kind: str) -> None:
    raw = {
        "empty": np.zeros((5, 7)),
        "full": np.full((5, 7), 65_535),
        "steps": np.arange(35).reshape(5, 7) % 3 * 20_000,
    }
    pixels = raw[kind].astype(np.uint16)
    assert np.array_equal(_core.decompress_rvl(rvl(pixels), pixels.size), pixels.ravel())


@pytest.mark.parametrize(
    ("data", "count", "cause"),
    [
        (rvl(RAW)[:40], RAW.size, "breaks off after"),
        (rvl(RAW), RAW.size - 1, "a run of|are left"),
        (b"\0" * 8, 4, "a run of 0 pixels"),
        (b"", 50_000_000, "can't hold"),
        (b"\xff" * 64, 4, "breaks off"),
    ],
)
def test_damaged_rvl_is_refused(data: bytes, count: int, cause: str) -> None:
    with pytest.raises(ValueError, match=cause):
        _core.decompress_rvl(data, count)


@pytest.mark.parametrize("encoding", ["protobuf", "json"])
def test_foxglove_images_with_their_calibration(tmp_path: Path, encoding: str) -> None:
    camera = ("/cam/depth/calibration", "foxglove.CameraCalibration", foxglove.calibration((32, 24), K))
    images = {
        "raw": ("/cam/depth/image", "foxglove.RawImage", foxglove.raw_image(RAW)),
        "png": ("/cam/depth/image", "foxglove.CompressedImage", foxglove.compressed_image(png16(RAW))),
    }
    for name, message in images.items():
        frame = only(written(tmp_path, foxglove.mcap([camera, message], encoding), f"{name}.mcap"))
        assert np.array_equal(np.asarray(frame.depth), RAW)
        assert (frame.depth_unit, frame.camera) == (0.001, CAMERA)
        assert frame.provenance["frame_id"] == "optical"


@pytest.mark.parametrize("encoding", ["protobuf", "json"])
def test_foxglove_clouds(tmp_path: Path, encoding: str) -> None:
    points = np.random.default_rng(2).normal(size=(50, 3)).astype(np.float32)
    content = foxglove.mcap([("/points", "foxglove.PointCloud", foxglove.point_cloud(points))], encoding)
    assert np.array_equal(np.asarray(only(written(tmp_path, content)).points), points)


def test_oak_depth_takes_its_intrinsics_through_crop_and_scale(tmp_path: Path) -> None:
    source = np.array([[63.0, 0, 41.0], [0, 63.5, 27.0], [0, 0, 1]])
    change = np.array([[0.5, 0, -4.75], [0, 0.5, -2.25], [0, 0, 1]])
    frames = [("depth", "dai.proto.img_frame.ImgFrame", foxglove.oak_frame(RAW, source, change))] * 2
    with siloscope.open(written(tmp_path, foxglove.mcap(frames))) as recording:
        first, second = recording
    assert np.array_equal(np.asarray(first.depth), RAW)
    assert (second.depth_unit, second.camera) == (0.001, CAMERA)


def test_a_topic_that_is_not_read_says_why(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    maker = Maker(1)
    jpeg = io.BytesIO()
    Image.fromarray((RAW >> 8).astype(np.uint8)).save(jpeg, "JPEG")
    grey = io.BytesIO()
    Image.fromarray((RAW >> 8).astype(np.uint8)).save(grey, "PNG")
    colour = maker.image(np.zeros((24, 96), np.uint8), "rgb8")
    messages = [
        ("/depth/image/compressed", START_NS, maker.compressed("16UC1; jpeg compressed ", jpeg.getvalue())),
        ("/preview/compressed", START_NS, maker.compressed("8UC1; png compressed ", grey.getvalue())),
        ("/colour/image", START_NS, colour),
        ("/colour/image", START_NS + 1, colour),
        ("/imu", START_NS, maker.imu((0, 0, 9.8))),
        ("/infra1/image", START_NS, maker.image(RAW, "16UC1")),
    ]
    path = maker.write(tmp_path / "none.bag", messages)
    with pytest.raises(
        InputError, match=r"no depth and no points in this recording: /depth/image/compressed: compr.*JPEG"
    ):
        siloscope.open(path)
    assert main(["info", str(path), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    told = {topic["name"]: topic for topic in document["topics"]}
    assert (told["/colour/image"]["type"], told["/colour/image"]["messages"]) == ("sensor_msgs/Image", 2)
    assert not any(topic["read"] for topic in document["topics"])
    for name, why in {
        "/depth/image/compressed": "JPEG, which loses the distances",
        "/preview/compressed": "8-bit grey PNG is a picture",
        "/colour/image": r"a picture (rgb8), not depth",
        "/imu": "accelerometer",
        "/infra1/image": "infrared",
    }.items():
        assert why in told[name]["note"]
    assert main(["info", str(path)]) == 0
    shown = capsys.readouterr()
    assert "siloscope info" not in shown.out + shown.err
    assert shown.out.count("no depth and no points") == 1


def test_info_tells_the_first_frame_in_numbers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    maker = Maker(1)
    path = maker.write(tmp_path / "depth.bag", [("/depth/image_raw", START_NS, maker.image(RAW, "16UC1"))])
    assert main(["info", str(path), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    known = RAW[RAW > 0] / 1000
    assert document["first_frame"]["invalid"] == pytest.approx(np.mean(RAW == 0))
    assert document["first_frame"]["depth"]["median"] == pytest.approx(np.median(known))
    assert document["topics"][0]["note"] == "read"
    assert document["depth_unit"] == 0.001
    assert main(["info", str(path)]) == 0
    shown = capsys.readouterr().out
    assert f"depth {known.min():.3f} to {known.max():.3f} m" in shown
    assert f"{100 * np.mean(RAW == 0):.1f} % without measurement" in shown


def test_a_size_that_can_not_be_is_not_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "cloud.ply"
    head = "ply\nformat binary_little_endian 1.0\nelement vertex 900000000\n"
    path.write_bytes((head + "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n").encode() + b"1234")
    assert main(["info", str(path)]) == 0
    shown = capsys.readouterr().out
    assert "size unknown" in shown
    assert "can't be read" in shown
    assert "the header declares 900000000 vertices but the file holds 0" in shown


DEPTH = ("/depth", "foxglove.RawImage", foxglove.raw_image(RAW))
BAD: dict[str, tuple[bytes, str]] = {
    "no schema": (foxglove.mcap([DEPTH], described=b""), "does not describe its messages 'foxglove.RawImage'"),
    "short": (foxglove.mcap([(*DEPTH[:2], DEPTH[2] | {"height": 400})]), "bytes came"),
    "no base64": (
        foxglove.mcap([("/depth", "foxglove.RawImage", {**foxglove.raw_image(RAW), "data": "?"})], "json"), "base64"
    ),
    "OAK colour": (
        foxglove.mcap([("c", "dai.proto.img_frame.ImgFrame", foxglove.oak_frame(RAW, np.eye(3), np.eye(3), 8))]),
        "a picture",
    ),
    "OAK metadata": (
        foxglove.mcap(
            [("c", "dai.proto.img_frame.ImgFrame", foxglove.oak_frame(RAW, np.eye(3), np.eye(3)) | {"data": b""})]
        ),
        "only the frames' metadata",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("content", "cause"), BAD.values(), ids=BAD.keys())
def test_bad_messages_are_refused_with_the_file_s_name(tmp_path: Path, content: bytes, cause: str) -> None:
    with pytest.raises(InputError, match=rf"bad\.mcap.*({cause})"):
        list(siloscope.open(written(tmp_path, content, "bad.mcap")))
