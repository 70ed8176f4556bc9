"""What a person at a Python prompt or in a notebook relies on."""

from __future__ import annotations

import sys
from dataclasses import replace
from operator import methodcaller
from pathlib import Path

import numpy as np
import pytest

import siloscope
from siloscope import Camera, InputError, UsageError, sensors
from siloscope.errors import naming_options
from siloscope.io.writers import write_camera, write_png
from siloscope.reproduction.own_method import evaluate, table
from siloscope.simulation import SimulatedFrame
from siloscope.simulation.scenarios import scenario

CAMERA = Camera(160, 120, 142.6, 142.6, 79.5, 59.5)
SCENE = replace(scenario("silo1"), camera=CAMERA)
RAW = np.rint(np.nan_to_num(SCENE.render().measured) / 0.001).astype(np.uint16)


as_in_a_notebook = methodcaller("_repr_html_")
"""What a notebook asks a result for."""


@pytest.fixture
def png(tmp_path: Path) -> Path:
    write_png(tmp_path / "frame.png", RAW)
    write_camera(CAMERA, tmp_path / "camera.json")
    return tmp_path / "frame.png"


def test_paths_are_taken_wherever_frames_are(png: Path) -> None:
    by_path = siloscope.locate(png, depth_unit=0.001)
    assert by_path == siloscope.locate(str(png), CAMERA, depth_unit=0.001)
    assert by_path.r_y == siloscope.locate(RAW, CAMERA, depth_unit=0.001).r_y
    silo = siloscope.calibrate(png, depth_unit=0.001)
    assert siloscope.measure(png, silo, depth_unit=0.001).ok
    assert (
        siloscope.measure(png, depth_unit=0.001).status == siloscope.measure(RAW, None, CAMERA, depth_unit=0.001).status
    )


def test_sources_have_slices_and_count_from_the_end(tmp_path: Path) -> None:
    stack = np.stack([np.full((12, 16), 1.0 + i, np.float32) for i in range(5)])
    np.save(tmp_path / "stack.npy", stack)
    with siloscope.open(tmp_path / "stack.npy") as source:
        assert [float(np.asarray(frame.depth)[0, 0]) for frame in source[1:4]] == [2.0, 3.0, 4.0]
        assert [float(np.asarray(frame.depth)[0, 0]) for frame in source[::-2]] == [5.0, 3.0, 1.0]
        assert float(np.asarray(source[-1].depth)[0, 0]) == 5.0
        for outside in (5, -6):
            with pytest.raises(IndexError):
                source[outside]


def test_messages_name_arguments_in_python_and_options_on_the_command_line() -> None:
    with pytest.raises(InputError) as caught:
        siloscope.locate(RAW, CAMERA)
    assert "give depth_unit" in str(caught.value)
    assert "--" not in str(caught.value)
    with naming_options():
        assert "give --depth-unit" in str(caught.value)
    assert "--" not in str(caught.value)


def test_a_notebook_shows_the_picture_beside_the_numbers() -> None:
    estimate = siloscope.locate(RAW, CAMERA, depth_unit=0.001)
    shown = as_in_a_notebook(estimate)
    assert shown.startswith("<pre>Estimate(")
    assert "data:image/png;base64," in shown
    refused = siloscope.locate(np.full((120, 160), 2.0), CAMERA)
    assert "img" not in as_in_a_notebook(refused)
    assert "img" in as_in_a_notebook(siloscope.measure(RAW, None, CAMERA, depth_unit=0.001, bottom="cone"))
    silo = siloscope.calibrate([RAW], camera=CAMERA, depth_unit=0.001)
    assert as_in_a_notebook(silo).startswith("<pre>Calibration(")


def test_a_data_frame_says_what_it_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    silo = siloscope.calibrate([RAW], camera=CAMERA, depth_unit=0.001)
    frame = siloscope.Frame(depth=RAW, camera=CAMERA, depth_unit=0.001, timestamp=1.7e9)
    track = siloscope.track([frame], silo)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(InputError, match="pip install pandas"):
        track.to_pandas()


def test_ones_own_method_runs_on_the_papers_frames() -> None:
    seen: list[str] = []

    def mine(frame: SimulatedFrame) -> siloscope.SiloPose | None:
        seen.append(type(frame).__name__)
        return None if len(seen) == 1 else frame.pose

    judged = list(evaluate(mine, "perfect", steps=2))
    assert len(judged) == 6
    assert judged[0].pose is None
    assert judged[0].distance is None
    assert judged[1].distance == pytest.approx(0.0, abs=1e-9)
    assert judged[1].direction == pytest.approx(0.0, abs=1e-6)
    assert table(judged).splitlines()[2].startswith("| Silo1 | 2 | 1 | 0")
    with pytest.raises(UsageError, match="perfect, perturbed, real"):
        next(evaluate(mine, "easy"))


def test_every_profile_has_a_source_a_range_and_its_nominal_cameras_their_deviation() -> None:
    wanted = {"oak-d", "orbbec-gemini-2", "orbbec-gemini-335", "realsense-d405", "realsense-d457", "realsense-d555"}
    wanted |= {"stereolabs-zed-2i", "livox-mid-360", "livox-avia", "pmd-flexx2", "arducam-tof", "st-vl53l5cx"}
    assert wanted <= set(sensors.names())
    for name in sensors.names():
        profile = sensors.load(name)
        assert len(profile.source) > 40, name
        assert 0.0 < profile.range[0] < profile.range[1] < 500.0, name
        assert profile.sigma(max(profile.range[0], 1.0)) is not None, name
        if name in wanted and profile.intrinsics:
            assert profile.intrinsics_std is not None, name
        for camera in profile.intrinsics:
            assert profile.nominal_std(camera).f >= 0.02, name
