"""NumPy arrays of every order and type; objects, bombs and damage refused."""

from __future__ import annotations

import io
import struct
import zipfile
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

import frame_files as made
import siloscope
from frame_files import put, read
from siloscope import Camera, InputError
from siloscope.io import camera_files, writers


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("dtype", ["<u2", ">u2", "<i4", ">f4", "<f8", "<f2"])
def test_arrays_of_every_order_and_type(tmp_path: Path, order: Literal["C", "F"], dtype: str) -> None:
    values = made.RAW // 16 if dtype.endswith("f2") else made.RAW
    stack = np.asarray([values, values + 1], order=order).astype(dtype)
    path = put(tmp_path, made.npy(stack))
    with siloscope.open(path, depth_unit=0.001) as source:
        first, second = source
    expected = values if stack.dtype.kind in "ui" else values * 0.001
    assert np.allclose(first.depth, expected, rtol=1e-3 if dtype.endswith("f2") else 1e-6)
    assert np.allclose(second.depth, expected + (second.depth - first.depth), rtol=1e-6)
    assert np.all(np.asarray(second.depth, float) > np.asarray(first.depth, float))


def test_integers_of_another_width_are_raw_units(tmp_path: Path) -> None:
    raw = made.RAW.astype(np.int32)
    raw[0, 0], raw[0, 1] = 65_535, -5
    frame = read(put(tmp_path, made.npy(raw)), depth_unit=0.001)
    assert frame.depth is not None
    assert frame.depth.dtype == np.uint16
    assert frame.depth[0, 0] == 65_535
    assert frame.depth[0, 1] == 0
    raw[0, 0] = 70_000
    frame = read(put(tmp_path, made.npy(raw)), depth_unit=0.0001)
    assert frame.depth is not None
    assert frame.depth[0, 0] == pytest.approx(7.0)


def test_npz_carries_what_belongs_to_the_frames(tmp_path: Path) -> None:
    path = tmp_path / "all.npz"
    gravity = np.array([0.1, 0.2, 9.8])
    writers.write_npz(
        path, np.stack([made.RAW] * 2), camera=made.CAMERA, depth_unit=made.UNIT, timestamps=[5.0, 6.5],
        gravity=gravity, labels=np.stack([made.LABELS, made.LABELS + 1]),
    )  # fmt: skip
    with siloscope.open(path) as source:
        frames = list(source)
    assert [frame.timestamp for frame in frames] == [5.0, 6.5]
    assert all(frame.camera == made.CAMERA and frame.depth_unit == made.UNIT for frame in frames)
    assert all(np.array_equal(frame.gravity, gravity) for frame in frames)
    assert np.array_equal(frames[1].labels, made.LABELS + 1)


def test_npz_with_a_matrix(tmp_path: Path) -> None:
    camera = made.CAMERA
    matrix = [[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]]
    frame = read(put(tmp_path, made.npz(depth=made.METRES, K=matrix)))
    assert frame.camera == camera


def test_the_user_s_word_wins_over_the_file_s(tmp_path: Path) -> None:
    path = put(tmp_path, made.MAKERS["frame.npz"]())
    mine = Camera(64, 48, 99.0, 99.0, 30.0, 20.0)
    frame = read(path, camera=mine, depth_unit=0.001)
    assert (frame.camera, frame.depth_unit) == (mine, 0.001)
    assert read(path).camera == made.CAMERA


def test_a_broken_camera_inside_does_not_matter_to_who_gives_one(tmp_path: Path) -> None:
    path = put(tmp_path, made.npz(depth=made.METRES, camera="{"))
    assert read(path, camera=made.CAMERA).camera == made.CAMERA


def test_the_camera_beside_serves_where_none_is_inside(tmp_path: Path) -> None:
    camera_files.dump(made.CAMERA, tmp_path / "camera.yaml")
    for content in (made.npz(depth=made.METRES), made.npy(made.METRES)):
        frame = read(put(tmp_path, content))
        assert frame.camera == made.CAMERA
        assert frame.provenance["camera_from"] == "camera.yaml"


def test_organised_points_recover_their_camera(tmp_path: Path) -> None:
    frame = read(put(tmp_path, made.npy(made.POINTS)))
    assert frame.camera is not None
    assert frame.camera.fx == pytest.approx(made.CAMERA.fx, abs=1e-3)


def test_labels_for_all_frames_or_for_each(tmp_path: Path) -> None:
    stack = np.stack([made.METRES] * 2)
    for labels in (made.LABELS, np.stack([made.LABELS] * 2)):
        frames = list(siloscope.open(put(tmp_path, made.npz(depth=stack, labels=labels))))
        assert all(np.array_equal(frame.labels, made.LABELS) for frame in frames)
    cloud = made.npz(points=made.CLOUD, labels=np.arange(len(made.CLOUD)))
    assert read(put(tmp_path, cloud)).labels.tolist() == list(range(len(made.CLOUD)))


def test_a_stack_that_was_cut_off_gives_the_frames_before(tmp_path: Path) -> None:
    content = made.npy(np.stack([made.RAW] * 3))
    path = put(tmp_path, content[: -made.RAW.nbytes // 2], "cut.npy")
    with siloscope.open(path, depth_unit=0.001) as source:
        assert len(list(source)) == 2
        assert source.problems == [f"{path}: cut off after 2 of 3 frames; save it again"]


def header(shape: str, descr: str = "'<u2'", order: str = "False", version: bytes = b"\x01\x00") -> bytes:
    text = f"{{'descr': {descr}, 'fortran_order': {order}, 'shape': {shape}, }}".encode()
    return b"\x93NUMPY" + version + struct.pack("<H" if version[0] == 1 else "<I", len(text)) + text


def zipped(name: str, content: bytes, declared: int | None = None, flags: int = 0) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, content)
    data = bytearray(file.getvalue())
    central = data.rindex(b"PK\x01\x02")
    data[central + 8] |= flags
    if declared is not None:
        data[central + 24 : central + 28] = struct.pack("<I", declared)
    return bytes(data)


BAD_ARRAYS = {
    "objects": (header("(64, 48)", "'|O'"), "Python objects"),
    "pickled": (made.npy(np.array([{}, 1], dtype=object)), "Python objects"),
    "structure": (header("(64,)", "[('x', '<f4')]"), "Python objects or structures"),
    "complex": (header("(64, 48)", "'<c8'"), "'c8' are no depths"),
    "boolean": (header("(64, 48)", "'|b1'"), "'b1' are no depths"),
    "8-bit": (made.npy(np.zeros((48, 64), np.uint8)), "8-bit values are a picture"),
    "huge": (header("(20000, 5000)"), "was cut off"),
    "gigantic": (header(f"({10**18}, {10**18})"), "declared"),
    "endless stack": (header(f"({10**15}, 64, 48)"), "cut off after 0"),
    "empty": (header("(0, 48)"), "is empty"),
    "scalar": (header("()"), "is empty"),
    "vector": (made.npy(np.zeros(100)), "neither a depth image"),
    "five sides": (made.npy(np.zeros((2, 2, 8, 8, 8))), "neither a depth image"),
    "rows of points": (made.npy(np.zeros((3, 500))), "neither a depth image"),
    "four columns": (made.npy(np.zeros((500, 4))), "neither a depth image"),
    "integer points": (made.npy(np.ones((500, 3), np.int32)), "points are integers"),
    "no header": (b"\x93NUMPY\x01\x00\xff\xff", "header is damaged"),
    "long header": (b"\x93NUMPY\x02\x00\xff\xff\xff\x7f" + b" " * 100, "header is damaged"),
    "nested header": (header("(" * 3000), "header is damaged"),
    "zip bomb": (zipped("depth.npy", header("(19000, 5000)") + b"\0" * 4096, declared=19_000 * 5_000 * 2), "hostile"),
    "false size": (zipped("depth.npy", header("(64, 48)") + b"\0" * 100, declared=6400), "breaks off|can't be dec"),
    "encrypted": (zipped("depth.npy", made.npy(made.RAW), flags=1), "encrypted"),
    "two arrays": (made.npz(left=made.RAW, right=made.RAW), "give stream"),
    "no frames": (made.npz(camera="{}"), "which array"),
    "broken camera": (made.npz(depth=made.RAW, camera="{"), "not valid JSON"),
    "three gravities": (made.npz(depth=made.RAW, gravity=[1, 2]), "'gravity' must be three"),
    "labels": (made.npz(depth=made.RAW, labels=made.LABELS[:4]), "'labels' of uint8 .4, 64. are no whole"),
    "label type": (made.npz(depth=made.RAW, labels=made.METRES), "'labels' of float32"),
    "times": (made.npz(depth=made.RAW, timestamps=[1, 2]), "2 timestamps for 1 frames"),
    "units": (made.npz(depth=made.RAW, depth_unit=[1, 2]), "'depth_unit' must be one"),
    "NaN unit": (made.npz(depth=made.RAW, depth_unit=np.nan), "depth unit of nan"),
    "cut archive": (made.MAKERS["frame.npz"]()[:-50], "damaged npz"),
}  # fmt: skip


@pytest.mark.parametrize(("content", "cause"), BAD_ARRAYS.values(), ids=BAD_ARRAYS.keys())
def test_bad_arrays_are_refused(tmp_path: Path, content: bytes, cause: str) -> None:
    with pytest.raises(InputError, match=rf"bad\.np.*({cause})"):
        list(siloscope.open(put(tmp_path, content, "bad.np")))


def test_a_stream_names_the_array(tmp_path: Path) -> None:
    path = put(tmp_path, made.npz(left=made.RAW, right=made.RAW + 1))
    frame = read(path, stream="right", depth_unit=0.001)
    assert np.array_equal(frame.depth, made.RAW + 1)
