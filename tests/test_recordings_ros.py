"""ROS 1 bags, ROS 2 bags and MCAP as ROS drivers write them, encoded by the `rosbags` library."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer

import realdata
import siloscope
from bags import START_NS, Maker, Message, png16, quantised
from siloscope import Camera, Frame, InputError
from siloscope.cli import main

RAW = np.random.default_rng(3).integers(0, 65536, (48, 64), dtype=np.uint16)
METRES = np.where(RAW % 7 == 0, 0, RAW / 20_000).astype(np.float32)
K = (57.0, 0.0, 31.5, 0.0, 57.25, 23.25, 0.0, 0.0, 1.0)
CAMERA = Camera(64, 48, 57.0, 57.25, 31.5, 23.25)
CONTAINERS: dict[str, dict[str, Any]] = {
    "ros1": {},
    "ros1-lz4": {"compression": "lz4"},
    "ros1-bz2": {"compression": "bz2"},
    "ros2": {},
    "ros2-messages-zstd": {"compression": "zstd", "mode": "MESSAGE"},
    "ros2-mcap": {"mcap": True},
    "ros2-mcap-zstd": {"mcap": True, "compression": "zstd"},
}
Write = Callable[[list[Message]], Path]


def maker_of(container: str) -> Maker:
    return Maker(int(container[3]))


def write(folder: Path, container: str, messages: list[Message]) -> Path:
    return maker_of(container).write(folder / f"{container}.bag", messages, **CONTAINERS[container])


def drivers_messages(maker: Maker, count: int = 3) -> list[Message]:
    messages: list[Message] = []
    for number in range(count):
        time_ns = START_NS + number * 33_000_000
        messages.append(("/camera/depth/image_raw", time_ns, maker.image(RAW + number, "16UC1", pad=6)))
        messages.append(("/camera/depth/camera_info", time_ns, maker.camera_info((64, 48), K, (0.0,) * 5)))
        messages.append(("/camera/color/image_raw", time_ns, maker.image(RAW, "mono16")))
        messages.append(("/imu", time_ns, maker.imu((0.0, -9.8, 0.2))))
    return messages


@pytest.mark.parametrize("container", CONTAINERS)
def test_every_container_gives_the_same_frames(tmp_path: Path, container: str) -> None:
    path = write(tmp_path, container, drivers_messages(maker_of(container)))
    with siloscope.open(path) as source:
        frames = list(source)
    assert len(source) == len(frames) == 3
    for number, frame in enumerate(frames):
        assert frame.depth is not None
        assert frame.depth.dtype == np.uint16
        assert np.array_equal(frame.depth, RAW + number)
        assert (frame.depth_unit, frame.camera) == (0.001, CAMERA)
        assert frame.timestamp == pytest.approx(1_700_000_000 + number * 0.033, abs=1e-6)
        np.testing.assert_allclose(frame.gravity, [0, 9.8, -0.2])
    assert source.problems == []


def only_frame(path: Path, **options: Any) -> Frame:
    (frame,) = siloscope.open(path, **options)
    return frame


@pytest.mark.parametrize("container", ["ros1", "ros2"])
def test_float_depth_is_metres(tmp_path: Path, container: str) -> None:
    message = maker_of(container).image(METRES, "32FC1")
    frame = only_frame(write(tmp_path, container, [("/depth/image", START_NS, message)]))
    assert frame.depth is not None
    assert frame.depth.dtype == np.float32
    assert np.array_equal(frame.depth, METRES)
    assert frame.depth_unit is None


def test_big_endian_pixels(tmp_path: Path) -> None:
    message = Maker(1).image(RAW.astype(">u2"), "16UC1")
    assert np.array_equal(only_frame(write(tmp_path, "ros1", [("/depth", START_NS, message)])).depth, RAW)


def test_compressed_depth_is_the_png_after_12_bytes(tmp_path: Path) -> None:
    message = Maker(2).compressed("16UC1; compressedDepth png", bytes(12) + png16(RAW))
    frame = only_frame(write(tmp_path, "ros2", [("/depth/image_raw/compressedDepth", START_NS, message)]))
    assert np.array_equal(frame.depth, RAW)
    assert frame.depth_unit == 0.001


def test_compressed_float_depth_undoes_the_inverse_quantisation(tmp_path: Path) -> None:
    """Quantised as compressed_depth_image_transport does with depth_max 10 and depth_quantization 100."""
    a = 100.0 * 101.0
    b = 1.0 - a / 10.0
    message = Maker(1).compressed("32FC1; compressedDepth png", quantised(METRES, a, b))
    frame = only_frame(write(tmp_path, "ros1", [("/depth/image/compressedDepth", START_NS, message)]))
    depth = frame.depth
    assert depth is not None
    assert np.array_equal(np.isnan(depth), METRES == 0)
    seen = METRES > 0.2
    step = METRES[seen].astype(np.float64) ** 2 / a
    assert np.all(np.abs(depth[seen] - METRES[seen]) <= step * 1.2)


def test_raw_wins_over_the_same_topic_compressed(tmp_path: Path) -> None:
    maker = Maker(2)
    messages = [
        (
            "/depth/image_raw/compressedDepth",
            START_NS,
            maker.compressed("16UC1; compressedDepth", bytes(12) + png16(RAW)),
        ),
        ("/depth/image_raw", START_NS, maker.image(RAW, "16UC1")),
    ]
    assert only_frame(write(tmp_path, "ros2", messages)).provenance["stream"] == "/depth/image_raw"


def test_two_depth_topics_ask_which(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    maker = Maker(1)
    topics = ["/camera/depth/image_rect_raw", "/camera/aligned_depth_to_color/image_raw"]
    path = write(tmp_path, "ros1", [(topic, START_NS, maker.image(RAW, "16UC1")) for topic in topics])
    with pytest.raises(InputError, match=f"stream: {', '.join(topics)}"):
        siloscope.open(path)[0]
    assert main(["locate", str(path)]) == 3
    assert main(["info", str(path)]) == 0
    told = capsys.readouterr().out
    assert all(topic in told for topic in topics)
    assert only_frame(path, stream="aligned").provenance["stream"] == topics[1]


@pytest.mark.parametrize("topic", ["/camera/infra1/image_rect_raw", "/kinect2/sd/image_ir", "/cam/left_infrared"])
def test_infrared_is_not_depth(tmp_path: Path, topic: str) -> None:
    path = write(tmp_path, "ros1", [(topic, START_NS, Maker(1).image(RAW, "16UC1"))])
    with pytest.raises(InputError, match="no depth and no points"):
        siloscope.open(path)


CAMERA_CASES: dict[str, tuple[str, dict[str, Any], Camera]] = {
    "rational with 14 coefficients, the last 0": (
        "image_raw",
        {"d": (*np.arange(1, 9) / 100, *[0.0] * 6), "model": "rational_polynomial"},
        Camera(64, 48, 57.0, 57.25, 31.5, 23.25, "rational", tuple(np.arange(1, 9) / 100)),
    ),
    "rectified images have P and no distortion": (
        "image_rect",
        {"d": (0.1, 0.0, 0.0, 0.0, 0.0), "p": (50.0, 0, 30.0, 0, 0, 51.0, 22.0, 0, 0, 0, 1, 0)},
        Camera(64, 48, 50.0, 51.0, 30.0, 22.0),
    ),
    "binning halves the image": (
        "image_raw",
        {"size": (128, 96), "binning": (2, 2)},
        Camera(64, 48, 28.5, 28.625, 15.5, 11.375),
    ),
    "a region of interest moves the principal point": (
        "image_raw",
        {"size": (640, 480), "roi": (10, 4, 48, 64)},
        Camera(64, 48, 57.0, 57.25, 21.5, 19.25),
    ),
}


@pytest.mark.parametrize("case", CAMERA_CASES)
def test_camera_info_is_for_the_image_as_it_is(tmp_path: Path, case: str) -> None:
    topic, fields, expected = CAMERA_CASES[case]
    maker = Maker(1)
    info = maker.camera_info(**{"size": (64, 48), "k": K, **fields})
    messages = [("/d/camera_info", START_NS, info), (f"/d/{topic}", START_NS, maker.image(RAW, "16UC1"))]
    assert only_frame(write(tmp_path, "ros1", messages)).camera == expected


def image_and_info(maker: Maker, info: Any) -> list[Message]:
    return [("/d/camera_info", START_NS, info), ("/d/image", START_NS, maker.image(RAW, "16UC1"))]


@pytest.mark.parametrize("fx", [0.0, float("nan")])
def test_intrinsics_that_are_none_are_refused_by_name(tmp_path: Path, fx: float) -> None:
    maker = Maker(2)
    info = maker.camera_info((64, 48), (fx, *K[1:]))
    path = write(
        tmp_path, "ros2", [("/d/camera_info", START_NS, info), ("/d/image", START_NS, maker.image(RAW, "16UC1"))]
    )
    with pytest.raises(InputError, match=r"/d/camera_info: .*camera"):
        siloscope.open(path)
    assert only_frame(path, camera=CAMERA).camera == CAMERA


def test_an_unknown_lens_is_refused_by_name(tmp_path: Path) -> None:
    maker = Maker(2)
    info = maker.camera_info((64, 48), K, (0.1,) * 5, model="thin_prism")
    path = write(
        tmp_path, "ros2", [("/d/camera_info", START_NS, info), ("/d/image", START_NS, maker.image(RAW, "16UC1"))]
    )
    with pytest.raises(InputError, match="'thin_prism'"):
        siloscope.open(path)


def test_gravity_goes_through_tf(tmp_path: Path) -> None:
    """imu → base by a quarter turn about z, optical → base by a quarter turn about x."""
    maker, half = Maker(2), float(np.sqrt(0.5))
    messages = [
        ("/tf_static", START_NS, maker.transform("base", "imu", (0.0, 0.0, half, half))),
        ("/tf_static", START_NS, maker.transform("base", "optical", (half, 0.0, 0.0, half))),
        ("/imu", START_NS, maker.imu((9.8, 0.0, 0.0), frame="imu")),
        ("/depth", START_NS, maker.image(RAW, "16UC1")),
    ]
    gravity = only_frame(write(tmp_path, "ros2", messages)).gravity
    # -9.8 along imu x is -9.8 along base y, and base y is minus optical z.
    np.testing.assert_allclose(gravity, [0, 0, 9.8], atol=1e-9)


def test_gravity_in_an_unconnected_frame_is_not_used(tmp_path: Path) -> None:
    maker = Maker(1)
    messages = [
        ("/imu", START_NS, maker.imu((0, -9.8, 0), frame="imu")),
        ("/depth", START_NS, maker.image(RAW, "16UC1")),
    ]
    frame = only_frame(write(tmp_path, "ros1", messages))
    assert frame.gravity is None
    assert "no tf leads from there" in frame.provenance["gravity_from"]


@pytest.mark.parametrize("container", ["ros1", "ros2-mcap"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_clouds_keep_their_order_and_type(tmp_path: Path, container: str, dtype: Any) -> None:
    points = np.random.default_rng(4).normal(size=(48, 64, 3)).astype(dtype)
    points[0, 0] = np.nan
    maker = maker_of(container)
    organised = only_frame(write(tmp_path, container, [("/points", START_NS, maker.cloud(points, pad=4))])).points
    assert organised is not None
    assert organised.dtype == dtype
    np.testing.assert_array_equal(organised, points)
    other = tmp_path / "other"
    other.mkdir()
    loose = only_frame(write(other, container, [("/points", START_NS, maker.cloud(points.reshape(-1, 3)))])).points
    np.testing.assert_array_equal(loose, points.reshape(-1, 3))


def test_perception_tutorial_bag() -> None:
    """Published camera of the recording: 525, 525, 319.5, 239.5."""
    frame = only_frame(realdata.path("rosbag1_pointcloud2_can", "perception_tutorial.bag"))
    points = frame.points
    assert points is not None
    assert points.shape == (480, 640, 3)
    seen = np.isfinite(points[..., 2])
    assert float(points[seen][:, 2].min()) == pytest.approx(0.70, abs=0.005)
    rows, columns = np.nonzero(seen)
    x, y, z = points[seen].T
    np.testing.assert_allclose(x / z * 525 + 319.5, columns, atol=0.01)
    np.testing.assert_allclose(y / z * 525 + 239.5, rows, atol=0.01)


def test_a_folder_of_several_files_is_one_recording(tmp_path: Path) -> None:
    """As ``ros2 bag record --max-bag-size`` splits it: 2 before 10."""
    maker = Maker(2)
    folder = tmp_path / "split"
    folder.mkdir()
    for part in (10, 2):
        one = maker.write(tmp_path / f"part{part}", [("/depth", START_NS, maker.image(RAW + part, "16UC1"))])
        (one / f"part{part}.db3").rename(folder / f"split_{part}.db3")
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information:\n  version: 9\n")
    frames = list(siloscope.open(folder))
    assert [int(frame.depth[0, 0]) - int(RAW[0, 0]) for frame in frames if frame.depth is not None] == [2, 10]


@pytest.mark.parametrize("container", ["ros1", "ros1-lz4", "ros2-mcap"])
def test_a_cut_recording_gives_the_frames_before_the_cut(tmp_path: Path, container: str) -> None:
    maker = maker_of(container)
    path = write(tmp_path, container, drivers_messages(maker, count=60))
    file = next(path.glob("*.mcap")) if path.is_dir() else path
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2])
    source = siloscope.open(file)
    frames = list(source)
    assert 1 <= len(frames) <= 59
    assert all(np.array_equal(frame.depth, RAW + number) for number, frame in enumerate(frames))
    assert len(source.problems) == 1
    assert "cut off" in source.problems[0]


def test_a_damaged_message_costs_only_its_frame(tmp_path: Path) -> None:
    maker = Maker(2)
    wrong = maker.image(RAW, "16UC1")
    wrong.height = 49
    images = [maker.image(RAW, "16UC1"), wrong, maker.image(RAW, "16UC1")]
    path = write(tmp_path, "ros2", [("/depth", START_NS + i, image) for i, image in enumerate(images)])
    source = siloscope.open(path)
    assert len(list(source)) == 2
    assert source.problems == ["frame 1: image is declared 64 x 49 with 128 bytes a row, but 6144 bytes came"]


def test_a_damaged_checksum_is_told(tmp_path: Path) -> None:
    path, maker = tmp_path / "checked.mcap", Maker(2)
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start()
        schema = writer.register_schema("sensor_msgs/msg/Image", "ros2msg", b"")
        channel = writer.register_channel("/depth", "cdr", schema)
        data = maker.store.serialize_cdr(maker.image(RAW, "16UC1"), "sensor_msgs/msg/Image")
        writer.add_message(channel, START_NS, bytes(data), START_NS)
        writer.finish()  # type: ignore[no-untyped-call]
    assert np.array_equal(only_frame(path).depth, RAW)
    whole = path.read_bytes()
    flipped = whole.find(RAW.tobytes()) + 99
    path.write_bytes(whole[:flipped] + bytes([whole[flipped] ^ 1]) + whole[flipped + 1 :])
    with pytest.raises(InputError, match="checksum"):
        siloscope.open(path)
