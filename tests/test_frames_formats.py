"""Every base format gives back what was stored, and refuses what it is not."""

from __future__ import annotations

import io
import json
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from numpy.typing import NDArray
from PIL import Image

import frame_files as made
import siloscope.frames
from siloscope import Camera, Frame, InputError, _core, writers
from siloscope.frames.clouds import recover_camera


def read(path: Path, **options: object) -> Frame:
    with siloscope.frames.open(path, **options) as source:  # type: ignore[arg-type]
        (frame,) = source
    return frame


def put(folder: Path, content: bytes, name: str = "file") -> Path:
    (folder / name).write_bytes(content)
    return folder / name


@pytest.mark.parametrize("name", made.MAKERS)
def test_every_format_opens_by_its_content_alone(tmp_path: Path, name: str) -> None:
    path = put(tmp_path, made.MAKERS[name](), "renamed.dat")
    with siloscope.frames.open(path, depth_unit=None if "metres" in name or "lzw" in name else made.UNIT) as source:
        described = source.describe()
        frames = list(source)
    assert described["frames"] == len(frames)
    assert described["streams"][0]["frames"] == len(frames)
    json.dumps(described)
    for frame in frames:
        shape = (frame.depth if frame.depth is not None else frame.points[..., 0]).shape  # type: ignore[index]
        assert described["streams"][0]["size"] == list(reversed(shape))
        assert str(path) in frame.source
        assert frame.provenance["format"] == source.format


@pytest.mark.parametrize("name", ["depth.png", "interlaced.png", "raw.npy", "raw.tif", "image.csv"])
def test_raw_depth_is_exact(tmp_path: Path, name: str) -> None:
    frame = read(put(tmp_path, made.MAKERS[name]()), depth_unit=made.UNIT)
    assert frame.depth is not None
    assert frame.depth.dtype == np.uint16
    assert np.array_equal(frame.depth, made.RAW)
    assert frame.depth_unit == made.UNIT
    assert frame.provenance["depth_unit"] == made.UNIT


@pytest.mark.parametrize("name", ["metres.npy", "lzw.tif"])
def test_metres_are_exact_and_have_no_unit(tmp_path: Path, name: str) -> None:
    frame = read(put(tmp_path, made.MAKERS[name]()))
    assert np.array_equal(frame.depth, made.METRES)
    assert frame.depth_unit is None


@pytest.mark.parametrize("name", ["ascii.ply", "little.ply", "big.ply", "points.xyz", "points.csv"])
def test_clouds_are_exact(tmp_path: Path, name: str) -> None:
    frame = read(put(tmp_path, made.MAKERS[name]()))
    assert frame.points is not None
    assert np.array_equal(frame.points.astype(np.float32), made.CLOUD)
    assert frame.camera is None


@pytest.mark.parametrize("name", ["ascii.pcd", "binary.pcd", "compressed.pcd"])
def test_organised_clouds_keep_grid_labels_and_camera(tmp_path: Path, name: str) -> None:
    frame = read(put(tmp_path, made.MAKERS[name]()))
    assert np.array_equal(frame.points, made.POINTS, equal_nan=True)
    assert np.array_equal(frame.labels, made.LABELS)
    assert frame.camera is not None
    expected = made.CAMERA
    found = frame.camera
    for key in ("fx", "fy", "cx", "cy"):
        assert getattr(found, key) == pytest.approx(getattr(expected, key), abs=1e-3)
    assert frame.provenance["camera_from"] == "recovered from the organised points"


# PNG -----------------------------------------------------------------------------------------------------------------


@given(arrays(np.uint16, array_shapes(min_dims=2, max_dims=2, max_side=40)))
def test_png_decodes_as_pillow_encodes(raw: NDArray[np.uint16]) -> None:
    file = io.BytesIO()
    Image.fromarray(raw).save(file, "PNG")
    assert np.array_equal(_core.decode_png16(file.getvalue()).reshape(raw.shape), raw)
    assert np.array_equal(_core.decode_png16(made.interlaced_png(raw)).reshape(raw.shape), raw)


PNG = made.MAKERS["depth.png"]()
BAD_PNG = {
    "8-bit": (made.png(8, 8, b"\0" * 72, bits=8), "8-bit grey PNG is a picture"),
    "colour": (made.png(8, 8, b"\0" * 8 * 49, bits=16, colour=2), "16-bit colour PNG is a picture"),
    "palette": (made.png(8, 8, b"\0" * 72, bits=8, colour=3), "palette"),
    "header only": (PNG[:20], "breaks off in its header"),
    "cut": (PNG[:-300], "damaged PNG"),
    "bit flip": (PNG[:200] + bytes([PNG[200] ^ 16]) + PNG[201:], "damaged PNG"),
    "too few rows": (made.png(64, 48, made.unfiltered(made.RAW[:20])), "damaged PNG"),
    "no pixels": (made.png(0, 48, b""), "0 x 48"),
    "too wide": (made.png(30_000, 2, b""), "30000 x 2"),
    "bomb": (made.png(10_000, 10_000, b"\0" * 100), "10000 x 10000 pixels"),
}  # fmt: skip


@pytest.mark.parametrize(("content", "cause"), BAD_PNG.values(), ids=BAD_PNG.keys())
def test_bad_png_is_refused(tmp_path: Path, content: bytes, cause: str) -> None:
    with pytest.raises(InputError, match=rf"bad\.png: .*{cause}.*;|bad\.png: .*{cause}.*export"):
        read(put(tmp_path, content, "bad.png"), depth_unit=0.001)


# NumPy ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("dtype", ["<u2", ">u2", "<i4", ">f4", "<f8", "<f2"])
def test_arrays_of_every_order_and_type(tmp_path: Path, order: str, dtype: str) -> None:
    values = made.RAW // 16 if dtype.endswith("f2") else made.RAW
    stack = np.asarray([values, values + 1], order=order).astype(dtype)
    path = put(tmp_path, made.npy(stack))
    with siloscope.frames.open(path, depth_unit=0.001) as source:
        first, second = source
    expected = values if stack.dtype.kind in "ui" else values * 0.001
    assert np.allclose(first.depth, expected, rtol=1e-3 if dtype.endswith("f2") else 1e-6)
    assert np.allclose(second.depth, expected + (second.depth - first.depth), rtol=1e-6)  # type: ignore[operator]
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
    with siloscope.frames.open(path) as source:
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


def test_a_stack_that_was_cut_off_gives_the_frames_before(tmp_path: Path) -> None:
    content = made.npy(np.stack([made.RAW] * 3))
    path = put(tmp_path, content[: -made.RAW.nbytes // 2], "cut.npy")
    with siloscope.frames.open(path, depth_unit=0.001) as source:
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
    "two arrays": (made.npz(left=made.RAW, right=made.RAW), "give --stream NAME"),
    "no frames": (made.npz(camera="{}"), "which array"),
    "broken camera": (made.npz(depth=made.RAW, camera="{"), "not valid JSON"),
    "three gravities": (made.npz(depth=made.RAW, gravity=[1, 2]), "'gravity' must be three"),
    "times": (made.npz(depth=made.RAW, timestamps=[1, 2]), "2 timestamps for 1 frames"),
    "units": (made.npz(depth=made.RAW, depth_unit=[1, 2]), "'depth_unit' must be one"),
    "NaN unit": (made.npz(depth=made.RAW, depth_unit=np.nan), "depth unit of nan"),
    "cut archive": (made.MAKERS["frame.npz"]()[:-50], "damaged npz"),
}  # fmt: skip


@pytest.mark.parametrize(("content", "cause"), BAD_ARRAYS.values(), ids=BAD_ARRAYS.keys())
def test_bad_arrays_are_refused(tmp_path: Path, content: bytes, cause: str) -> None:
    with pytest.raises(InputError, match=rf"bad\.np.*({cause})"):
        list(siloscope.frames.open(put(tmp_path, content, "bad.np")))


def test_a_stream_names_the_array(tmp_path: Path) -> None:
    path = put(tmp_path, made.npz(left=made.RAW, right=made.RAW + 1))
    frame = read(path, stream="right", depth_unit=0.001)
    assert np.array_equal(frame.depth, made.RAW + 1)


# TIFF ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("compression", [None, "tiff_lzw", "tiff_deflate", "tiff_adobe_deflate", "packbits"])
@pytest.mark.parametrize("dtype", [np.uint16, np.float32, np.int32])
def test_tiff_of_every_compression(tmp_path: Path, compression: str | None, dtype: type) -> None:
    values = made.METRES if dtype is np.float32 else made.RAW.astype(dtype)
    path = put(tmp_path, made.tiff(values, compression, pages=2))
    with siloscope.frames.open(path, depth_unit=None if dtype is np.float32 else 0.001) as source:
        frames = list(source)
    assert len(frames) == 2
    assert all(np.array_equal(frame.depth, values) for frame in frames)


def big_endian_tiff(width: int, height: int, body: bytes) -> bytes:
    entries = [(256, 3, width << 16), (257, 3, height << 16), (258, 3, 16 << 16), (259, 3, 1 << 16), (262, 3, 1 << 16)]
    entries += [(273, 4, 8 + 2 + 8 * 12 + 4), (278, 3, height << 16), (279, 4, len(body))]
    table = b"".join(struct.pack(">HHII", tag, kind, 1, value) for tag, kind, value in entries)
    return b"MM\0*\0\0\0\x08" + struct.pack(">H", len(entries)) + table + b"\0\0\0\0" + body


def test_big_endian_tiff(tmp_path: Path) -> None:
    path = put(tmp_path, big_endian_tiff(64, 48, made.RAW.astype(">u2").tobytes()))
    assert np.array_equal(read(path, depth_unit=0.001).depth, made.RAW)


def colour_tiff() -> bytes:
    file = io.BytesIO()
    Image.fromarray(np.zeros((8, 8, 3), np.uint8)).save(file, "TIFF")
    return file.getvalue()


BAD_TIFF = {
    "colour": (colour_tiff(), "is a picture, not depth"),
    "header only": (b"II*\0", "damaged TIFF"),
    "cut": (made.tiff(made.RAW)[:2000], "damaged|TIFF"),
    "bomb": (big_endian_tiff(19_000, 5_000, b"\0" * 64), "can't hold the declared 190000000"),
    "zstd": (made.tiff(made.RAW, "zstd"), "compression ZSTD"),
}


@pytest.mark.parametrize(("content", "cause"), BAD_TIFF.values(), ids=BAD_TIFF.keys())
def test_bad_tiff_is_refused(tmp_path: Path, content: bytes, cause: str) -> None:
    with pytest.raises(InputError, match=rf"bad\.tif: .*({cause})"):
        list(siloscope.frames.open(put(tmp_path, content, "bad.tif"), depth_unit=0.001))


# PLY and PCD ---------------------------------------------------------------------------------------------------------


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
        ply(LITTLE, "element face 1", "property list uchar int i", "element vertex 1", *AXES), "'face' has the list"
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
    assert read(put(tmp_path, content)).points.tolist() == [[1, 2, 3], [4, 5, 6]]  # type: ignore[union-attr]


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


# Tables --------------------------------------------------------------------------------------------------------------

TABLES = {
    "header": ("id,z,x,y\n7,3.5,1.5,2.5\n8,6,4,5\n", [[1.5, 2.5, 3.5], [4, 5, 6]]),
    "comment header": ("//X Y Z R G B\n3\n1.5 2 3 9 9 9\n4 5 6 9 9 9\n", [[1.5, 2, 3], [4, 5, 6]]),
    "units in names": ("x [mm];y [mm];z [mm]\n1500;2500;3500\n", [[1.5, 2.5, 3.5]]),
    "points with intensity": ("1.5 2.5 3.5 200\n4.5 5.5 6.5 100\n", [[1.5, 2.5, 3.5], [4.5, 5.5, 6.5]]),
    "PTS": ("2\n1.5 2.5 3.5 -200 1 2 3\n4.5 5.5 6.5 100 1 2 3\n", [[1.5, 2.5, 3.5], [4.5, 5.5, 6.5]]),
    "decimal comma": ("1,5;2,5;3,5\n4;5;6\n", [[1.5, 2.5, 3.5], [4, 5, 6]]),
    "decimal comma and spaces": ("1,5 2,5 3,5\n4,0 5,0 6,0\n", [[1.5, 2.5, 3.5], [4, 5, 6]]),
    "Fortran": ("0.15D+01 2.5d0 3.5D0\n4.D0 5.0 6.0\n", [[1.5, 2.5, 3.5], [4, 5, 6]]),
    "far away": ("4500000.125,5400000.25,310.5\n", [[4500000.125, 5400000.25, 310.5]]),
    "Windows lines and quotes": ('"x","y","z"\r\n"1.5","2.5","3.5"\r\n', [[1.5, 2.5, 3.5]]),
    "byte order mark": ("\ufeff1.5,2.5,3.5\n", [[1.5, 2.5, 3.5]]),
    "tabs and blank lines": ("1.5\t2.5\t3.5\n\n4\t5\t6\n", [[1.5, 2.5, 3.5], [4, 5, 6]]),
    "trailing comma and names": ("wall1,1.5,2.5,3.5,\nwall2,4,5,6,\n", [[1.5, 2.5, 3.5], [4, 5, 6]]),
    "no measurement": ("1.5 2.5 3.5\nnan nan nan\n", [[1.5, 2.5, 3.5], [np.nan] * 3]),
}  # fmt: skip


@pytest.mark.parametrize(("text", "points"), TABLES.values(), ids=TABLES.keys())
def test_tables_in_the_ways_people_write_them(tmp_path: Path, text: str, points: list[list[float]]) -> None:
    found = read(put(tmp_path, text.encode())).points
    assert np.array_equal(found, points, equal_nan=True)


def test_labels_that_are_numbers_are_kept(tmp_path: Path) -> None:
    frame = read(put(tmp_path, b"st1,1.5,2.5,3.5,\n12,4,5,6,\n"))
    assert frame.labels is not None
    assert frame.labels.tolist() == [-1, 12]


BAD_TABLES = {
    "which columns": ("1 1.5 2.5 3.5\n2 4.5 5.5 6.5\n", "can't tell which of the 4 columns"),
    "words and more": ("a 1.5 2.5 3.5 4.5\n", "can't tell which"),
    "other names": ("range,azimuth,height\n1.5,2.5,3.5\n", "no columns x, y and z among range"),
    "whole numbers": ("1500 2500 3500\n4000 5000 6000\n", "--depth-unit"),
    "short line": ("1.5,2.5,3.5\n4.5,5.5\n", "below line 1"),
    "word": ("1.5,2.5,3.5\n" * 1500 + "4.5,x,6.5\n" + "1.5,2.5,3.5\n" * 1500, "'x'"),
    "bytes": ("1.5,2.5,3.5\n" * 1000 + "\0\0\n", "no text"),
    "all invalid": ("nan nan nan\nnan nan nan\n", "invalid"),
}


@pytest.mark.parametrize(("text", "cause"), BAD_TABLES.values(), ids=BAD_TABLES.keys())
def test_tables_that_cannot_be_told_are_refused(tmp_path: Path, text: str, cause: str) -> None:
    with pytest.raises(InputError, match=rf"bad\.csv: .*{cause}"):
        read(put(tmp_path, text.encode(), "bad.csv"))


# Camera of organised points ------------------------------------------------------------------------------------------


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
