"""What every source of frames promises: order, laziness, damage told, the user's word above the file's."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import siloscope
from siloscope import Camera, InputError, UsageError
from siloscope.io import writers

RAW = np.random.default_rng(1).integers(400, 6000, (48, 64), dtype=np.uint16)
CAMERA = Camera(64, 48, 57.0, 57.0, 31.5, 23.5)


@pytest.fixture
def png(tmp_path: Path) -> Path:
    path = tmp_path / "depth.png"
    Image.fromarray(RAW).save(path)
    return path


def test_a_png_gives_its_raw_units(png: Path) -> None:
    with siloscope.open(png, camera=CAMERA, depth_unit=0.00025) as source:
        (frame,) = source
    assert frame.depth is not None
    assert frame.depth.dtype == np.uint16
    assert np.array_equal(frame.depth, RAW)
    assert (frame.depth_unit, frame.camera) == (0.00025, CAMERA)
    assert frame.provenance["depth_unit_from"] == "given"


def test_a_missing_unit_is_asked_for(png: Path) -> None:
    with pytest.raises(InputError, match="give depth_unit"):
        list(siloscope.open(png))


def test_a_camera_of_another_size_is_refused(png: Path) -> None:
    other = Camera(640, 480, 570.0, 570.0, 319.5, 239.5)
    with pytest.raises(InputError, match="64 x 48 pixels but the camera 640 x 480"):
        list(siloscope.open(png, camera=other, depth_unit=0.001))


def test_content_decides_not_the_name(png: Path) -> None:
    renamed = png.rename(png.with_suffix(".npy"))
    assert siloscope.io.sniff(renamed).name == "png"


def test_one_damaged_file_of_several_is_told_and_skipped(png: Path) -> None:
    cut = png.with_name("cut.png")
    cut.write_bytes(png.read_bytes()[:-400])
    missing = png.with_name("missing.png")
    source = siloscope.open([png, cut, missing, png], depth_unit=0.001)
    assert len(source) == 4
    frames = list(source)
    assert len(frames) == 2
    assert len(source.problems) == 2
    assert "cut.png" in source.problems[0]
    assert "missing.png: no such file" in source.problems[1]


@pytest.mark.parametrize("count", [0, 2, 50])
def test_frames_decoded_ahead_are_the_same_in_the_same_order(tmp_path: Path, count: int) -> None:
    for number in range(40):
        Image.fromarray(RAW + np.uint16(number)).save(tmp_path / f"{number:02}.png")
    whole = (tmp_path / "17.png").read_bytes()
    (tmp_path / "17.png").write_bytes(whole[:-400])
    with siloscope.open(tmp_path, depth_unit=0.001) as source, ThreadPoolExecutor(3) as pool:
        alone, problems = list(source), source.problems
        ahead = source.ahead(pool, count)
        assert len(ahead) == len(source) == 40
        for _ in range(2):
            found = list(ahead)
            assert [frame.source for frame in found] == [frame.source for frame in alone]
            assert all(np.array_equal(f.depth, a.depth) for f, a in zip(found, alone, strict=True))
            assert source.problems == problems
            assert "17.png" in problems[0]


class FirstOnly(Executor):
    """Does the first work that it is given, and waits with the others."""

    def __init__(self) -> None:
        self.given: list[Future[Any]] = []

    def submit(self, work: Callable[..., Any], /, *args: Any, **named: Any) -> Future[Any]:
        self.given.append(Future())
        if len(self.given) == 1:
            self.given[0].set_result(work(*args, **named))
        return self.given[-1]


def test_frames_decoded_ahead_can_be_left_in_the_middle(png: Path) -> None:
    pool = FirstOnly()
    frames: Any = iter(siloscope.open([png] * 30, depth_unit=0.001).ahead(pool, 20))
    assert np.array_equal(next(frames).depth, RAW)
    frames.close()
    assert [future.cancelled() for future in pool.given] == [False] + [True] * 20


def test_a_missing_unit_is_asked_for_by_frames_decoded_ahead_too(png: Path) -> None:
    with ThreadPoolExecutor(2) as pool, pytest.raises(InputError, match="give depth_unit"):
        list(siloscope.open([png] * 3).ahead(pool, 4))


def test_nothing_readable_is_an_error(png: Path) -> None:
    png.write_bytes(png.read_bytes()[:-400])
    with pytest.raises(InputError, match=r"depth\.png: damaged PNG"):
        list(siloscope.open(png, depth_unit=0.001))


def test_a_stream_that_is_not_there_is_wrong_usage(png: Path) -> None:
    assert len(siloscope.open(png, stream="depth")) == 1
    with pytest.raises(UsageError, match="has the stream 'depth', none named 'colour'"):
        siloscope.open(png, stream="colour")


@pytest.mark.parametrize("unit", [0.0, -1.0, float("nan"), float("inf"), 1000.0])
def test_impossible_units_are_refused(png: Path, unit: float) -> None:
    with pytest.raises(UsageError, match="depth unit"):
        siloscope.open(png, depth_unit=unit)


def test_a_file_that_vanishes_after_opening_is_an_input_error(png: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = siloscope.open(png, depth_unit=0.001)
    png.unlink()
    with pytest.raises(InputError, match=r"depth\.png: can't be read"):
        list(source)


def test_frames_can_be_taken_by_number(png: Path) -> None:
    source = siloscope.open([png, png], depth_unit=0.001)
    assert source.frame_count == 2
    assert np.array_equal(source[1].depth, RAW)
    assert np.array_equal(source[-2].depth, RAW)
    for index in (2, -3):
        with pytest.raises(IndexError):
            source[index]


def test_special_files_and_bad_paths_are_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="not a file or folder"):
        siloscope.open(tmp_path / "pipe")
    (tmp_path / "empty.png").touch()
    with pytest.raises(InputError, match="the file is empty"):
        siloscope.open(tmp_path / "empty.png")
    for bad in ("missing\0name", "x" * 5000):
        with pytest.raises(InputError):
            siloscope.open(tmp_path / bad)
    with pytest.raises(UsageError):
        siloscope.open([])


def test_unknown_content_is_named(tmp_path: Path) -> None:
    path = tmp_path / "depth.png"
    path.write_bytes(b"\x00\x01\x02 nothing known")
    with pytest.raises(InputError, match=r"depth\.png: content starting with .* png"):
        siloscope.open(path)


def test_float_depth_that_looks_like_millimetres_is_not_taken_for_metres(tmp_path: Path) -> None:
    np.save(tmp_path / "mm.npy", RAW.astype(np.float32))
    with pytest.raises(InputError, match=r"0\.001 for millimetres"):
        list(siloscope.open(tmp_path / "mm.npy"))
    (frame,) = siloscope.open(tmp_path / "mm.npy", depth_unit=0.001)
    assert np.allclose(frame.depth, RAW * 0.001)


def test_a_unit_that_puts_the_wall_at_kilometres_is_refused(png: Path) -> None:
    with pytest.raises(InputError, match="puts the median depth at"):
        list(siloscope.open(png, depth_unit=1))


@pytest.mark.parametrize("name", ["mm.npy", "mm.ply", "mm.xyz"])
def test_points_in_millimetres_are_not_taken_for_metres(tmp_path: Path, name: str) -> None:
    points = np.random.default_rng(2).uniform(-1500.5, 1500.5, (500, 3)).astype(np.float32)
    path = tmp_path / name
    if name.endswith("npy"):
        np.save(path, points)
    elif name.endswith("ply"):
        writers.write_ply(path, points)
    else:
        np.savetxt(path, points)
    with pytest.raises(InputError, match=r"0\.001 for millimetres"):
        list(siloscope.open(path))
    (frame,) = siloscope.open(path, depth_unit=0.001)
    assert np.allclose(frame.points, points * 0.001)
    (frame,) = siloscope.open(path, depth_unit=1)
    assert np.allclose(frame.points, points)


def test_a_unit_does_not_shrink_what_is_metres_already(tmp_path: Path) -> None:
    metres = (RAW * 0.001).astype(np.float32)
    np.save(tmp_path / "metres.npy", metres)
    (frame,) = siloscope.open(tmp_path / "metres.npy", depth_unit=0.001)
    assert np.array_equal(frame.depth, metres)
    assert frame.provenance["depth_unit_from"] == "not applied: floating point is metres"
    points = np.random.default_rng(2).uniform(-1.5, 1.5, (500, 3))
    writers.write_ply(tmp_path / "metres.ply", points)
    (frame,) = siloscope.open(tmp_path / "metres.ply", depth_unit=0.001)
    assert np.array_equal(frame.points, points)


def test_ray_length_becomes_z(tmp_path: Path) -> None:
    z = np.full((48, 64), 2.0)
    length = z * np.sqrt(1 + np.sum(CAMERA.rays() ** 2, axis=2))
    np.save(tmp_path / "length.npy", length)
    (frame,) = siloscope.open(tmp_path / "length.npy", camera=CAMERA, ray_length=True)
    assert np.allclose(frame.depth, z, rtol=0, atol=1e-12)
