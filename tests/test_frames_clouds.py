"""PLY and PCD clouds, their compression, and the camera of organised points."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import frame_files as made
from frame_files import put, read
from siloscope import Camera, InputError, _core
from siloscope.io.clouds.columns import recover_camera


def ply(*lines: str, body: bytes = b"") -> bytes:
    return "\n".join(("ply", *lines, "end_header\n")).encode() + body


ASCII, LITTLE = "format ascii 1.0", "format binary_little_endian 1.0"
AXES = ("property float x", "property float y", "property float z")
BAD_PLY = {
    "no end": (b"ply\nformat ascii 1.0\nelement vertex 3\n", "header does not end"),
    "no format": (ply("element vertex 1", *AXES, body=b"1 2 3\n"), "no format"),
    "unknown format": (ply("format binary 2.0", "element vertex 1", *AXES), "'format binary 2.0' is wrong"),
    "no vertices": (ply(ASCII, "element face 1"), "no vertices"),
    "negative": (ply(ASCII, "element vertex -3", *AXES), "'element vertex -3' is wrong"),
    "gigantic": (ply(LITTLE, f"element vertex {10**14}", *AXES, body=b"\0" * 120), "file holds 10"),
    "overflowing": (ply(LITTLE, f"element vertex {10**40}", *AXES), "is wrong"),
    "gigantic text": (ply(ASCII, f"element vertex {10**14}", *AXES, body=b"1 2 3\n"), "can't hold"),
    "gigantic before": (ply(ASCII, f"element o {10**14}", "property int i", "element vertex 1", *AXES), "can't hold"),
    "list of points": (ply(LITTLE, "element vertex 1", "property list uchar int x"), "has the list 'x'"),
    "list before": (
        ply(LITTLE, "element face 1", "property list uchar int i", "element vertex 1", *AXES), "1 vertices but the file"
    ),
    "unknown type": (ply(LITTLE, "element vertex 1", "property half x"), "'property half x' is wrong"),
    "property first": (ply(LITTLE, "property float x"), "'property float x' is wrong"),
    "twice": (ply(LITTLE, "element vertex 1", *AXES, "property float x", body=b"\0" * 16), "names a property twice"),
    "no z": (ply(ASCII, "element vertex 1", *AXES[:2], body=b"1 2\n"), "no field 'z' among x, y"),
    "none": (ply(LITTLE, "element vertex 0", *AXES), "no points"),
    "cut": (made.ply("binary_little_endian")[:-2000], "was cut off"),
    "cut text": (ply(ASCII, "element vertex 3", *AXES, body=b"1 2 3\n4 5 6\n" + b" " * 20), "declared 3 vertices"),
    "short line": (ply(ASCII, "element vertex 2", *AXES, body=b"1 2 3\n4 5\n6\n"), "columns changed"),
    "word": (ply(ASCII, "element vertex 1", *AXES, body=b"1 two 3\n"), "'two'"),
    "all invalid": (ply(ASCII, "element vertex 1", *AXES, body=b"nan nan nan\n"), "all 1 points are invalid"),
    "binary in text": (ply(ASCII, "element vertex 2", *AXES, body=b"\0\xff" * 40), "no|convert|declared"),
}  # fmt: skip


@pytest.mark.parametrize(("content", "cause"), BAD_PLY.values(), ids=BAD_PLY.keys())
def test_bad_ply_is_refused(tmp_path: Path, content: bytes, cause: str) -> None:
    with pytest.raises(InputError, match=rf"bad\.ply: .*({cause})"):
        read(put(tmp_path, content, "bad.ply"))


def test_range_grids_that_leave_points_out_are_no_grid(tmp_path: Path) -> None:
    content = ply(
        ASCII, "obj_info num_cols 5", "obj_info num_rows 4", "element vertex 2", *AXES, body=b"1 2 3\n4 5 6\n"
    )
    assert read(put(tmp_path, content)).points.tolist() == [[1, 2, 3], [4, 5, 6]]


PCD = made.MAKERS["binary.pcd"]()
PACKED = made.MAKERS["compressed.pcd"]()
BAD_PCD = {
    "no end": (PCD[:60], "header does not end"),
    "no fields": (PCD.replace(b"FIELDS label z x y", b""), "0 FIELDS"),
    "sizes": (PCD.replace(b"SIZE 4 4 4 4", b"SIZE 4 4 4"), "3 SIZE"),
    "size 3": (PCD.replace(b"SIZE 4 4 4 4", b"SIZE 4 4 3 4"), "TYPE F, SIZE 3"),
    "no number": (PCD.replace(b"SIZE 4 4 4 4", b"SIZE 4 4 x 4"), "SIZE x"),
    "type": (PCD.replace(b"TYPE U F F F", b"TYPE U F Q F"), "TYPE Q"),
    "count 0": (PCD.replace(b"COUNT 1 1 1 1", b"COUNT 1 1 0 1"), "COUNT 0"),
    "count": (PCD.replace(b"COUNT 1 1 1 1", b"COUNT 1 1 99999999 1"), "COUNT 99999999"),
    "points": (PCD.replace(b"POINTS 3072", b"POINTS 3071"), "don't agree"),
    "negative": (PCD.replace(b"WIDTH 64", b"WIDTH -64"), "don't agree"),
    "gigantic": (PCD.replace(b"DTH 64", b"DTH 64000000000").replace(b"S 3072", b"S 3072000000000"), "holds 3072"),
    "data": (PCD.replace(b"DATA binary", b"DATA tar"), "unknown DATA 'tar'"),
    "cut": (PCD[:-100], "holds 3065"),
    "no z": (PCD.replace(b"label z x y", b"label w x y"), "no field 'z'"),
    "cut packed": (PACKED[:-50], "breaks off"),
    "packed sizes": (PACKED[: PACKED.index(b"compressed\n") + 13], "breaks off"),
    "packed zeros": (PACKED.replace(b"POINTS 3072", b"POINTS 6144").replace(b"HEIGHT 48", b"HEIGHT 96"), "holds 3072"),
}  # fmt: skip


@pytest.mark.parametrize(("content", "cause"), BAD_PCD.values(), ids=BAD_PCD.keys())
def test_bad_pcd_is_refused(tmp_path: Path, content: bytes, cause: str) -> None:
    with pytest.raises(InputError, match=rf"bad\.pcd: .*{cause}"):
        read(put(tmp_path, content, "bad.pcd"))


def test_fields_with_several_values_are_stepped_over(tmp_path: Path) -> None:
    table = np.zeros(4, [("pad", "u1", (7,)), ("xyz", "<f8", (3,)), ("h", "<f4", (33,))])
    table["xyz"] = np.arange(12).reshape(4, 3)
    text = "VERSION .7\nFIELDS _ x y z h\nSIZE 1 8 8 8 4\nTYPE U F F F F\nCOUNT 7 1 1 1 33\nWIDTH 4\nHEIGHT 1\n"
    content = text.encode() + b"POINTS 4\nDATA binary\n" + table.tobytes()
    points = read(put(tmp_path, content)).points
    assert points is not None
    assert points.dtype == np.float64
    assert np.array_equal(points, table["xyz"])


@given(st.binary(max_size=2000), st.integers(1, 40))
def test_lzf_gives_back_what_was_compressed(part: bytes, times: int) -> None:
    data = part * times
    assert _core.decompress_lzf(made.lzf(data), len(data)) == data


@given(st.binary(max_size=200), st.integers(0, 10**12))
def test_lzf_of_anything_is_an_error_or_the_size_asked_for(data: bytes, size: int) -> None:
    try:
        out = _core.decompress_lzf(data, size)
    except ValueError:
        return
    assert len(out) == size


@given(st.floats(20, 2000), st.floats(0.5, 2), st.floats(-0.5, 1.5), st.floats(-0.5, 1.5))
def test_the_camera_is_recovered_from_its_points(f: float, ratio: float, across: float, down: float) -> None:
    camera = Camera(40, 30, f, f * ratio, 40 * across, 30 * down)
    z = np.random.default_rng(3).uniform(0.5, 8, (30, 40))
    z[5:9, 7:20] = np.nan
    points = np.dstack([camera.rays() * z[..., None], z])
    found = recover_camera(points)
    assert found is not None
    assert np.allclose(
        [found.fx, found.fy, found.cx, found.cy], [camera.fx, camera.fy, camera.cx, camera.cy], rtol=1e-9
    )


def test_no_camera_is_made_up() -> None:
    turned = made.POINTS[..., [2, 0, 1]]
    noisy = made.POINTS + np.random.default_rng(1).normal(0, 0.01, made.POINTS.shape)
    for points in (turned, noisy, np.full((5, 5, 3), np.nan), np.zeros((5, 5, 3)), made.POINTS[:, :2]):
        assert recover_camera(points) is None
