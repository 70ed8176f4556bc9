"""Folders of frames, the TUM layout, and the camera file that lies beside."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import frame_files as made
import siloscope
from siloscope import Camera, InputError
from siloscope.io import camera_files, writers
from siloscope.io.folder import natural_key

OTHER = Camera(made.WIDTH, made.HEIGHT, 99.0, 99.0, 30.0, 20.0)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return made.write_folder(tmp_path / "frames")


def test_a_folder_in_natural_order_with_the_camera_beside(folder: Path) -> None:
    with siloscope.open(folder) as source:
        frames = list(source)
        assert len(source) == 3
    assert [frame.provenance["frame"] for frame in frames] == ["depth_1.png", "depth_2.png", "depth_10.png"]
    assert all(np.array_equal(frame.depth, made.RAW + i) for frame, i in zip(frames, (1, 2, 10), strict=True))
    assert all((frame.camera, frame.depth_unit) == (made.CAMERA, made.UNIT) for frame in frames)
    assert frames[0].provenance["camera_from"] == "camera.json"


def test_a_single_image_takes_the_camera_beside(folder: Path) -> None:
    (frame,) = siloscope.open(folder / "depth_2.png")
    assert (frame.camera, frame.depth_unit) == (made.CAMERA, made.UNIT)


def test_the_user_s_camera_and_unit_win(folder: Path, tmp_path: Path) -> None:
    camera_files.dump(OTHER, tmp_path / "mine.toml", depth_unit=0.002)
    for frame in siloscope.open(folder, camera=tmp_path / "mine.toml"):
        assert (frame.camera, frame.depth_unit) == (OTHER, 0.002)
        assert frame.provenance["depth_unit_from"] == "given camera file"
    for frame in siloscope.open(folder, camera=OTHER, depth_unit=0.003):
        assert (frame.camera, frame.depth_unit) == (OTHER, 0.003)


def test_two_different_cameras_beside_are_not_chosen_between(folder: Path) -> None:
    camera_files.dump(OTHER, folder / "intrinsics.toml")
    with pytest.raises(InputError, match=r"camera\.json, intrinsics\.toml.*camera"):
        siloscope.open(folder)
    assert len(list(siloscope.open(folder, camera=OTHER, depth_unit=0.001))) == 3


def test_a_camera_of_another_size_beside_is_refused(folder: Path) -> None:
    camera_files.dump(Camera(640, 480, 500.0, 500.0, 320.0, 240.0), folder / "camera.json", depth_unit=0.001)
    with pytest.raises(InputError, match="64 x 48 pixels but the camera 640 x 480"):
        list(siloscope.open(folder))


def test_pictures_and_other_files_are_left_out(folder: Path) -> None:
    Image.fromarray(np.zeros((48, 64, 3), np.uint8)).save(folder / "depth_0.png")
    (folder / "notes.txt").write_text("1.5 2.5 3.5\n")
    (folder / ".hidden.png").write_bytes(made.MAKERS["depth.png"]())
    assert len(siloscope.open(folder)) == 3


def test_a_damaged_frame_is_told_and_the_others_given(folder: Path) -> None:
    damaged = folder / "depth_2.png"
    damaged.write_bytes(damaged.read_bytes()[:-400])
    with siloscope.open(folder) as source:
        assert len(list(source)) == 2
        (problem,) = source.problems
    assert "depth_2.png: damaged PNG" in problem


def test_formats_are_not_mixed(folder: Path) -> None:
    (folder / "more.npy").write_bytes(made.MAKERS["raw.npy"]())
    with pytest.raises(InputError, match="3 png, 1 npy"):
        siloscope.open(folder)


def test_an_empty_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="a folder without"):
        siloscope.open(tmp_path)


def test_frames_in_a_subfolder_named_depth(folder: Path, tmp_path: Path) -> None:
    outer = tmp_path / "outer"
    outer.mkdir()
    folder.rename(outer / "depth")
    (outer / "depth" / "camera.json").rename(outer / "camera.json")
    frames = list(siloscope.open(outer))
    assert [frame.camera for frame in frames] == [made.CAMERA] * 3


@pytest.mark.parametrize("name", ["metres.npy", "raw.tif", "binary.pcd", "little.ply", "frame.npz"])
def test_folders_of_other_formats(tmp_path: Path, name: str) -> None:
    for i in range(2):
        (tmp_path / f"{i}_{name}").write_bytes(made.MAKERS[name]())
    unit = made.UNIT if name in ("raw.tif", "frame.npz") else None
    first, second = siloscope.open(tmp_path, depth_unit=unit)
    values = [first.depth, second.depth] if first.depth is not None else [first.points, second.points]
    assert np.array_equal(values[0], values[1], equal_nan=True)


def test_times_and_gravity_from_the_list_beside(folder: Path) -> None:
    rows = [{"file": f"depth_{i}.png", "timestamp": float(i), "gravity": [0, 0, 9.8]} for i in (10, 2, 1)]
    (folder / "frames.json").write_text(json.dumps({"frames": rows}))
    with siloscope.open(folder) as source:
        assert source.timestamps == [1.0, 2.0, 10.0]
        frames = list(source)
    assert [frame.timestamp for frame in frames] == [1.0, 2.0, 10.0]
    assert all(np.array_equal(frame.gravity, [0, 0, 9.8]) for frame in frames)
    for broken in ("[", "[]", '{"frames": [1]}'):
        (folder / "frames.json").write_text(broken)
        with pytest.raises(InputError, match=r"frames\.json: not the list"):
            siloscope.open(folder)


def test_tum_layout(tmp_path: Path) -> None:
    folder = made.write_tum(tmp_path / "tum")
    with siloscope.open(folder) as source:
        assert source.timestamps == [1305031453.25, 1305031454.25]
        frames = list(source)
    assert [frame.timestamp for frame in frames] == [1305031453.25, 1305031454.25]
    assert all(frame.depth_unit == 0.0002 for frame in frames)
    assert frames[0].provenance["depth_unit_from"] == "TUM layout"
    (given,) = {frame.depth_unit for frame in siloscope.open(folder, depth_unit=0.001)}
    assert given == 0.001


@pytest.mark.parametrize(
    "text",
    ["", "# nothing\n", "1.5\n", "one depth/a.png\n", "nan depth/a.png\n", "1.5 ../../secret.png\n", "1.5 a b\n"],
)
def test_bad_tum_lists_are_refused(tmp_path: Path, text: str) -> None:
    folder = made.write_tum(tmp_path / "tum")
    (folder / "depth.txt").write_text(text)
    with pytest.raises(InputError, match=r"depth\.txt: (line 1 is not|lists no frames)"):
        siloscope.open(folder)


def test_names_that_are_times_give_the_times(tmp_path: Path) -> None:
    for name in ("1305031453.25.png", "1305031454.5.png"):
        (tmp_path / name).write_bytes(made.MAKERS["depth.png"]())
    assert siloscope.open(tmp_path).timestamps == [1305031453.25, 1305031454.5]


def test_natural_order() -> None:
    names = ["b10", "b9", "a", "10", "9", "b1²", "b1"]
    assert sorted(names, key=natural_key) == ["a", "b1", "b1²", "b9", "b10", "9", "10"]


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    raw = writers.to_raw(made.METRES, made.UNIT)
    assert np.array_equal(raw, made.RAW)
    writers.write_png(tmp_path / "depth.png", raw)
    camera_files.dump(made.CAMERA, tmp_path / "camera.toml", depth_unit=made.UNIT)
    (frame,) = siloscope.open(tmp_path / "depth.png")
    assert np.array_equal(frame.depth, made.RAW)
    assert (frame.camera, frame.depth_unit) == (made.CAMERA, made.UNIT)
