"""RealSense recordings: every bit as the maker's SDK gives it, unit, camera, time and gravity."""

from __future__ import annotations

import contextlib
import json
import sqlite3
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import realdata
import siloscope
from bags import Maker
from data import make_realsense as made
from siloscope import Camera, InputError, UsageError
from siloscope.cli import main
from siloscope.io.recordings.containers.rosbag1 import Rosbag1
from siloscope.io.recordings.vendors import realsense

DATA = Path(__file__).parent / "data"
FIXTURES = [DATA / "realsense.bag", DATA / "realsense.db3"]
D435 = ("realsense_bag_d435", "single_depth_color_640x480.bag")


def sdk() -> Any:
    """The maker's SDK, or a skip where it can't be had."""
    return pytest.importorskip(
        "pyrealsense2", reason="pyrealsense2 (or libusb-1.0-0) is not installed", exc_type=ImportError
    )


@pytest.mark.parametrize("path", FIXTURES, ids=["bag", "db3"])
def test_depth_unit_and_camera_are_those_recorded(path: Path) -> None:
    with siloscope.open(path) as source:
        frames = list(source)
    assert np.array_equal([frame.depth for frame in frames], made.depth_frames())
    assert [np.float32(frame.depth_unit) for frame in frames] == [np.float32(made.UNIT)] * 3
    assert source.camera == Camera(64, 48, 38.5, 38.75, 31.25, 23.5)
    assert (len(source), source.problems, source.provenance["serial_number"]) == (3, [], "000123")


@pytest.mark.parametrize("path", FIXTURES, ids=["bag", "db3"])
def test_gravity_points_against_the_accelerometer(path: Path) -> None:
    frame = next(iter(siloscope.open(path)))
    assert frame.gravity is not None
    np.testing.assert_allclose(frame.gravity, -np.array(made.ACCELERATION), rtol=1e-6)


@pytest.mark.parametrize(("suffix", "compressed"), [("bag", True), ("db3", True), ("db3", False)])
def test_bit_for_bit_what_the_sdk_plays(tmp_path: Path, suffix: str, compressed: bool) -> None:
    sdk()
    path = DATA / "realsense.bag"
    if suffix == "db3":
        path = tmp_path / "recorded.db3"
        by_the_sdk("record", str(path), *([] if compressed else ["raw"]))
    by_the_sdk("play", str(path), str(tmp_path / "played.npz"))
    with np.load(tmp_path / "played.npz") as played:
        units, depth = played["units"], played["depth"]
    frames = list(siloscope.open(path))
    assert np.array_equal([frame.depth for frame in frames], depth)
    assert np.array_equal(np.array([frame.depth_unit for frame in frames], np.float32), np.float32(units))


def by_the_sdk(*command: str) -> None:
    """Runs the SDK in a process of its own, again where it crashes: its clean-up is not what is tested."""
    for _ in range(5):
        done = subprocess.run([sys.executable, made.__file__, *command], capture_output=True, timeout=60, check=False)
        if done.returncode == 0:
            return
        Path(command[-1] if command[0] == "play" else command[1]).unlink(missing_ok=True)
    pytest.fail(f"the SDK can't {' '.join(command)}: {done.stderr.decode()}")


def test_d435_of_2018_has_no_unit_after_its_images() -> None:
    with siloscope.open(realdata.path(*D435)) as source:
        frames = list(source)
    assert [frame.depth.shape for frame in frames if frame.depth is not None] == [(480, 640)] * 2
    assert frames[0].depth_unit == pytest.approx(0.0010000000475, abs=1e-14)
    camera = source.camera
    assert camera is not None
    assert (camera.fx, camera.fy) == (pytest.approx(390.43145752),) * 2
    assert (camera.cx, camera.cy) == (pytest.approx(331.38787842), pytest.approx(242.18734741))
    assert source.provenance["device"] == "Intel RealSense D435"
    assert source.provenance["firmware"] == "05.09.14.00"
    assert frames[0].timestamp == pytest.approx(1534232519.732935547)


def test_d435_in_an_office_corner_is_refused_with_a_reason(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["locate", str(realdata.path(*D435)), "--sensor", "realsense-d435", "--json"]) == 4
    document = json.loads(capsys.readouterr().out)
    assert document["status"] == "refused"
    assert document["reason"]
    assert document["r_x"] is None


def test_extrinsics_are_rotations_from_the_reference_to_the_stream() -> None:
    """Depth to colour of this file as the SDK (2.59.1) gives it, written row by row."""
    bag = Rosbag1(realdata.path(*D435))
    rotation = realsense.rotations(bag, "/device_0/sensor_1/Color_0")["0"]
    expected = [[0.999863, -0.01031, 0.0129259], [0.0103087, 0.999947, 0.00017303], [-0.012927, -3.97579e-05, 0.999916]]
    np.testing.assert_allclose(rotation, expected, atol=1e-6)


def test_db3_extrinsics_are_written_column_by_column() -> None:
    made_up = "rotation=0,1,0,-1,0,0,0,0,1;translation=0,0,0"
    maker = Maker(1)
    wire = maker.store.serialize_ros1(maker.new("std_msgs/msg/String", made_up), "std_msgs/msg/String")
    topic = _one_message(bytes(wire))
    rotation = realsense.rotation_of_topic(topic, topic.topics["/a/tf/ref_1"])
    np.testing.assert_array_equal(rotation, [[0, -1, 0], [1, 0, 0], [0, 0, 1]])


def _one_message(data: bytes) -> Any:
    from siloscope.io.recordings.recording import Entry, Recording, Topic
    from siloscope.io.recordings.wire import Wire

    class Memory(Recording):
        def read(self, topic: Topic, entry: Entry) -> Wire:
            return Wire(data)

        def close(self) -> None: ...

    memory = Memory(Path("memory"))
    memory.declare("/a/tf/ref_1", "std_msgs/String", "ros1").entries.append(Entry(0, None))
    return memory


def _two_cameras(folder: Path, accel: tuple[float, float, float] = (0.0, 0.0, -9.81)) -> Path:
    """Two depth cameras in one recording, the accelerometer a quarter turn about x from the first."""
    maker, half = Maker(1), np.sqrt(0.5)
    move = maker.new("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
    turns = {"Depth_0": (0.0, 0.0, 0.0, 1.0), "Accel_0": (half, 0.0, 0.0, half)}
    messages: list[Any] = [("/device_0/sensor_1/Accel_0/imu/data", 5, maker.imu(accel))]
    for number, (stream, turn) in enumerate(turns.items()):
        transform = maker.new("geometry_msgs/msg/Transform", move, maker.new("geometry_msgs/msg/Quaternion", *turn))
        messages.append((f"/device_0/sensor_{number}/{stream}/tf/0", 1, transform))
    for device in (0, 1):
        depth = np.full((48, 64), 1000 + device, np.uint16)
        base = f"/device_{device}/sensor_0/Depth_0"
        messages.append((f"{base}/image/data", 10, maker.image(depth, "mono16", frame="0")))
        messages.append(
            (f"/device_{device}/sensor_0/option/Depth Units/value", 2, maker.new("std_msgs/msg/Float32", 0.0001))
        )
    return maker.write(folder / "two.bag", sorted(messages, key=lambda message: message[1]))


def test_two_depth_streams_ask_which(tmp_path: Path) -> None:
    path = _two_cameras(tmp_path)
    source = siloscope.open(path)
    with pytest.raises(InputError, match=r"stream: device_0/sensor_0/Depth_0, device_1/sensor_0/Depth_0"):
        list(source)
    assert [stream["chosen"] for stream in source.describe()["streams"]] == [False, False]
    frame = next(iter(siloscope.open(path, stream="device_1")))
    assert frame.depth is not None
    assert frame.depth[0, 0] == 1001
    with pytest.raises(UsageError, match="2 streams named 'Depth'"):
        siloscope.open(path, stream="Depth")


def test_gravity_is_turned_into_the_depth_camera(tmp_path: Path) -> None:
    """v_accel = R v_depth with R a quarter turn about x: the depth camera's y is the accelerometer's z."""
    source = siloscope.open(_two_cameras(tmp_path), stream="device_0")
    assert source.gravity is not None
    np.testing.assert_allclose(source.gravity, [0, 9.81, 0], atol=1e-6)


def test_a_shaken_camera_has_no_gravity(tmp_path: Path) -> None:
    source = siloscope.open(_two_cameras(tmp_path, (9.0, 9.0, 9.0)), stream="device_0")
    assert source.gravity is None
    assert "15.59 m/s², not gravity" in source.provenance["gravity_from"]


@pytest.mark.parametrize("path", FIXTURES, ids=["bag", "db3"])
def test_a_cut_recording_gives_the_frames_before_the_cut(tmp_path: Path, path: Path) -> None:
    cut = tmp_path / path.name
    got = []
    for share in (0.95, 0.7, 0.4, 0.05):
        cut.write_bytes(path.read_bytes()[: int(path.stat().st_size * share)])
        got.append(_read_before_the_cut(cut))
    assert got == sorted(got, reverse=True)
    assert got[0] >= 1
    assert got[-1] == 0


def _read_before_the_cut(path: Path) -> int:
    try:
        source = siloscope.open(path)
    except InputError:
        return 0
    frames: list[siloscope.Frame] = []
    with contextlib.suppress(InputError):
        frames.extend(source)
    assert "cut off" in source.problems[-1]
    for frame, expected in zip(frames, made.depth_frames(), strict=False):
        assert np.array_equal(frame.depth, expected)
    return len(frames)


def test_a_database_that_is_no_recording_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "other.db3"
    with sqlite3.connect(path) as base:
        base.execute("CREATE TABLE people (name TEXT)")
    base.close()
    with pytest.raises(InputError, match="no tables 'topics' and 'messages'"):
        siloscope.open(path)


def test_the_users_camera_and_unit_win() -> None:
    camera = Camera(64, 48, 57.0, 57.0, 31.5, 23.5)
    frame = next(iter(siloscope.open(FIXTURES[0], camera=camera, depth_unit=0.0005)))
    assert (frame.camera, frame.depth_unit) == (camera, 0.0005)


def test_a_camera_message_cut_short_names_the_file(tmp_path: Path) -> None:
    path = tmp_path / "short.db3"
    path.write_bytes((DATA / "realsense.db3").read_bytes())
    base = sqlite3.connect(path)
    with base:
        topic = "SELECT id FROM topics WHERE name LIKE '%Depth_0/camera_info'"
        base.execute(f"UPDATE messages SET data = substr(data, 1, 6) WHERE topic_id = ({topic})")
    base.close()
    with pytest.raises(InputError, match=r"short\.db3: message ends"):
        siloscope.open(path)
