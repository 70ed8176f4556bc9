"""Live cameras: the SDK's own software devices, its crashes, and the advice which way to turn."""

from __future__ import annotations

import importlib.util
import json
import os
import time
from contextlib import nullcontext
from dataclasses import replace
from itertools import islice
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from data import make_realsense as made
from siloscope import Camera, Estimate, Frame, InputError, SiloPose, UsageError
from siloscope.cli import main
from siloscope.io.writers import write_camera, write_png
from siloscope.sensors.live import SensorProcess, sensor, turn_for_more_wall
from siloscope.sensors.live.realsense import RealSense
from siloscope.simulation import Feed
from siloscope.simulation.scenarios import SILO1, SILO3

DATA = Path(__file__).parent / "data"


def sdk() -> None:
    why = "pyrealsense2 or Debian's libusb-1.0-0 is not installed"
    pytest.importorskip("pyrealsense2", reason=why, exc_type=ImportError)


# --- RealSense, through its real SDK, which crashes now and then and so runs in the camera's own process


class Software:
    """A software device that is fed a frame whenever one is asked for."""

    def __init__(self) -> None:
        import pyrealsense2 as rs

        self.rs, self.device = rs, rs.software_device()
        self.device.register_info(rs.camera_info.name, "Software D455")
        self.depth_sensor, self.motion_sensor = map(self.device.add_sensor, ("Stereo Module", "Motion Module"))
        self.depth_sensor.add_read_only_option(rs.option.depth_units, made.UNIT)
        self.depth = self.depth_sensor.add_video_stream(made.depth_stream(rs)).as_video_stream_profile()
        self.accel = self.motion_sensor.add_motion_stream(made.accel_stream(rs)).as_motion_stream_profile()
        self.camera = RealSense(self.device, rs)
        self.count = 0

    def newest(self) -> Frame:
        self.motion_sensor.on_motion_frame(made.motion_frame(self.rs, self.accel, self.count))
        time.sleep(0.05)
        pixels = made.depth_frames()[self.count]
        self.depth_sensor.on_video_frame(made.video_frame(self.rs, self.depth, self.count, pixels))
        self.count += 1
        return self.camera.newest()

    def __enter__(self) -> Software:
        self.camera.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        os._exit(0)


def without_depth() -> Any:
    import pyrealsense2 as rs

    device = rs.software_device()
    device.register_info(rs.camera_info.name, "Software T265")
    device.add_sensor("Motion Module").add_motion_stream(made.accel_stream(rs))
    return RealSense(device, rs)


def three_frames() -> list[Frame]:
    with SensorProcess(Software) as process:
        return list(islice(process, 3))


def test_a_software_device_gives_what_it_is_fed() -> None:
    sdk()
    try:
        frames = three_frames()
    except InputError:
        frames = three_frames()
    for number, (frame, pixels) in enumerate(zip(frames, made.depth_frames(), strict=True)):
        assert np.array_equal(frame.depth, pixels)
        assert np.float32(frame.depth_unit) == np.float32(made.UNIT)
        assert frame.camera == Camera(64, 48, 38.5, 38.75, 31.25, 23.5)
        assert frame.timestamp == pytest.approx(1.0 + 0.033 * number)
        np.testing.assert_allclose(frame.gravity, -np.array(made.ACCELERATION), rtol=1e-6)


def test_a_device_without_depth_is_refused() -> None:
    sdk()
    with SensorProcess(without_depth) as process, pytest.raises(InputError, match="T265: this device has no depth"):
        next(iter(process))


def test_no_camera_connected_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    sdk()
    if main(["live", "realsense", "--frames", "1"]) == 0:
        pytest.skip("a camera is connected")
    assert main(["live", "realsense"]) == 3
    assert "no RealSense camera is connected" in capsys.readouterr().err


def test_a_missing_sdk_names_its_extra(capsys: pytest.CaptureFixture[str]) -> None:
    if importlib.util.find_spec("pyorbbecsdk"):
        pytest.skip("Orbbec's SDK is installed")
    assert main(["live", "orbbec"]) == 3
    assert "pip install 'siloscope[orbbec]'" in capsys.readouterr().err


def test_an_unknown_camera_is_a_usage_error() -> None:
    with pytest.raises(UsageError, match="known are realsense and orbbec"):
        sensor("kinect")


# --- A camera in its own process


class Counting:
    """A camera whose frames tell how many came before."""

    def __init__(self) -> None:
        self.started = time.monotonic()

    def newest(self) -> Frame:
        number = int((time.monotonic() - self.started) * 100)
        return Frame(depth=np.full((4, 6), 1 + number, np.uint16), camera=CAMERA, depth_unit=0.001)


CAMERA = Camera(6, 4, 5.0, 5.0, 2.5, 1.5)


def counting() -> Any:
    return nullcontext(Counting())


def crashing() -> Any:
    os._exit(7)


def refusing() -> Any:
    raise InputError("the lens cap is on")


def failing() -> Any:
    raise RuntimeError("frame didn't arrive")


def test_the_newest_frame_is_given_however_slow_the_consumer_is() -> None:
    with SensorProcess(counting) as process:
        frames = iter(process)
        first = next(frames)
        time.sleep(0.3)
        later = next(frames)
    assert first.depth is not None
    assert later.depth is not None
    assert int(later.depth[0, 0]) - int(first.depth[0, 0]) >= 25
    assert later.camera is first.camera


@pytest.mark.parametrize(
    ("broken", "sentence"),
    [
        (crashing, r"ended unexpectedly \(exit code 7\)"),
        (refusing, "the lens cap is on"),
        (failing, "driver failed: frame didn't arrive"),
    ],
)
def test_a_driver_that_fails_ends_in_a_sentence(broken: Any, sentence: str) -> None:
    with SensorProcess(broken) as process, pytest.raises(InputError, match=sentence):
        next(iter(process))


# --- Which way to turn


def seen(labels: np.ndarray[Any, Any]) -> tuple[Estimate, Frame]:
    details: Any = SimpleNamespace(labels=labels.astype(np.uint8))
    return Estimate("ok", "surface", details=details), Frame(depth=np.ones(labels.shape, np.float32))


@pytest.mark.parametrize(
    ("turn", "rows", "columns"),
    [
        ("left", slice(None), slice(0, 30)),
        ("right", slice(None), slice(34, 64)),
        ("up", slice(0, 20), slice(None)),
        ("down", slice(28, 48), slice(None)),
    ],
)
@pytest.mark.parametrize("label", [1, 2])
def test_turn_to_the_side_where_the_wall_is(turn: str, rows: slice, columns: slice, label: int) -> None:
    labels = np.full((48, 64), 3)
    labels[rows, columns] = label
    assert turn_for_more_wall(*seen(labels)) == turn


@pytest.mark.parametrize("label", [0, 1, 3])
def test_no_advice_where_no_side_is_better(label: int) -> None:
    assert turn_for_more_wall(*seen(np.full((48, 64), label))) is None


def test_a_refused_frame_is_turned_to_where_something_is_measured() -> None:
    depth = np.zeros((48, 64), np.uint16)
    depth[:, 40:] = 1500
    depth[:, :10] = 65535
    refused = Estimate("refused", "surface", reason="no-wall")
    assert turn_for_more_wall(refused, Frame(depth=depth)) == "right"
    assert turn_for_more_wall(refused, Frame(points=np.zeros((5, 3)))) is None


AXES = {"left": (0, -1), "right": (0, 1), "up": (1, 0), "down": (-1, 0)}


@pytest.mark.parametrize("level", [0.5, 0.7])
@pytest.mark.parametrize("offset", [(0.2, 0.0), (-0.2, 0.0), (0.0, 0.2), (0.0, -0.2), (0.3, -0.3), (0.5, 0.0)])
def test_turning_as_advised_shows_more_wall(level: float, offset: tuple[float, float]) -> None:
    """A camera that looks past the vertex onto high feed; 4° the advised way."""
    pose = SILO3.pose
    camera = replace(SILO3.camera, width=160, height=120, fx=142.5, fy=142.5, cx=79.5, cy=59.5)
    astray = replace(pose, r_x=pose.r_x + offset[0], r_y=pose.r_y + offset[1])
    scene = replace(SILO3, feed=Feed(level=level), pose=astray, camera=camera)
    labels = scene.render().labels
    advice = turn_for_more_wall(*seen(labels))
    assert advice is not None
    turned = replace(scene, pose=_turned(astray, *AXES[advice], np.radians(4.0)))
    assert _wall_share(turned.render().labels) > _wall_share(labels)


def _wall_share(labels: np.ndarray[Any, Any]) -> float:
    return float(np.isin(labels, (1, 2)).mean())


def _turned(pose: SiloPose, about_x: float, about_y: float, angle: float) -> SiloPose:
    """The camera turned about its own x or y axis; the silo's axis as the new camera sees it gives the pose."""
    c, s = np.cos(angle), np.sin(angle)
    old_from_new = (
        np.array([[c, 0, s * about_y], [0, 1, 0], [-s * about_y, 0, c]])
        if about_y
        else np.array([[1, 0, 0], [0, c, -s * about_x], [0, s * about_x, c]])
    )
    return SiloPose.from_axis(old_from_new.T @ pose.axis_direction, old_from_new.T @ pose.axis_point)


# --- The command


def test_live_replays_a_recording_as_json_lines(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["live", str(DATA / "realsense.bag"), "--frames", "2", "--json"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [line["schema"] for line in lines] == ["siloscope.live/1"] * 2
    assert {line["status"] for line in lines} == {"refused"}
    assert all(line["turn"] in (None, "left", "right", "up", "down") for line in lines)


def test_live_shows_a_panel_on_stderr_and_tells_of_damage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cut = tmp_path / "cut.bag"
    cut.write_bytes((DATA / "realsense.bag").read_bytes()[:-3000])
    assert main(["live", str(cut)]) == 5
    out, err = capsys.readouterr()
    assert out == ""
    assert "refused" in err
    assert "not read" in err


def test_live_replays_raw_images_with_their_unit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    seen = SILO1.render()
    write_png(tmp_path / "frame.png", seen.raw(0.001))
    write_camera(seen.camera, tmp_path / "camera.json")
    frame = str(tmp_path / "frame.png")
    assert main(["live", frame, "--json"]) == 3
    assert "--depth-unit" in capsys.readouterr().err
    assert main(["live", frame, "--json", "--depth-unit", "0.001"]) == 0
    assert json.loads(capsys.readouterr().out)["status"] == "ok"
