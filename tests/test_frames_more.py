"""Netpbm, the Viewer's dumps, tables by pixel, meshes, Livox recordings, and recordings packed whole."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import more_files as made
import recording_files
import siloscope
from bags import START_NS, Maker
from frame_files import CAMERA, CLOUD, METRES, POINTS, RAW, put, read
from siloscope import Camera, InputError
from siloscope.cli import main
from siloscope.io import camera_files
from siloscope.io.zstandard import zstd


def refusal(path: Path) -> str:
    with pytest.raises(InputError) as caught:
        list(siloscope.open(path, depth_unit=0.001))
    assert path.name in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("content", [made.pgm(), made.pgm(comment=b""), made.text_pgm()])
def test_pgm_gives_its_raw_units(tmp_path: Path, content: bytes) -> None:
    frame = read(put(tmp_path, content), camera=CAMERA, depth_unit=0.001)
    assert frame.depth is not None
    assert frame.depth.dtype == np.uint16
    assert np.array_equal(frame.depth, RAW)
    assert frame.camera == CAMERA


@pytest.mark.parametrize("order", ["<", ">"])
def test_pfm_gives_metres_from_the_lowest_row_up(tmp_path: Path, order: str) -> None:
    frame = read(put(tmp_path, made.pfm(order)))
    assert np.array_equal(np.asarray(frame.depth), METRES)
    assert frame.depth_unit is None


def test_pillow_writes_the_same_pgm(tmp_path: Path) -> None:
    Image.fromarray(RAW).save(tmp_path / "frame.pgm")
    assert np.array_equal(np.asarray(read(tmp_path / "frame.pgm", depth_unit=0.001).depth), RAW)


BAD_NETPBM = {
    "8 bits": (b"P5 4 4 255\n" + bytes(16), "8 bits is a picture"),
    "colour": (b"PF 4 4 -1\n" + bytes(192), "colour PFM"),
    "cut": (made.pgm()[:-9], "declares 64 x 48 pixels but the file holds 3067"),
    "cut text": (made.text_pgm()[:400], "are not 3072 numbers"),
    "header": (b"P5 4", "breaks off"),
    "word": (b"P5 four 4 65535\n" + bytes(32), "'four' in the header is no number"),
    "gigantic": (b"P5 99999 99999 65535\n" + bytes(32), "99999 x 99999"),
}


@pytest.mark.parametrize(("content", "cause"), BAD_NETPBM.values(), ids=BAD_NETPBM.keys())
def test_bad_netpbm_is_refused(tmp_path: Path, content: bytes, cause: str) -> None:
    assert cause in refusal(put(tmp_path, content, "bad.pgm"))


def test_a_viewer_s_snapshot_has_its_camera_beside(tmp_path: Path) -> None:
    path = made.write_snapshot(tmp_path)
    frame = read(path, depth_unit=0.001)
    assert np.array_equal(np.asarray(frame.depth), RAW)
    assert frame.camera == CAMERA
    assert read(path, depth_unit=0.001, camera=tmp_path / "shot_Depth_metadata.csv").camera == CAMERA


def test_a_folder_of_snapshots(tmp_path: Path) -> None:
    for name in ("a_Depth", "b_Depth"):
        made.write_snapshot(tmp_path, name)
    Image.fromarray(np.zeros((48, 64, 3), np.uint8)).save(tmp_path / "a_Depth.png")
    with siloscope.open(tmp_path, depth_unit=0.001) as source:
        first, second = source
        assert source.describe()["camera_from"] == "a_Depth_metadata.csv"
    assert np.array_equal(np.asarray(second.depth), RAW)
    assert first.camera == CAMERA


def test_bad_snapshots_are_refused(tmp_path: Path) -> None:
    path = made.write_snapshot(tmp_path)
    beside = tmp_path / "shot_Depth_metadata.csv"
    beside.write_text(made.VIEWER.replace("Z16", "RGB8"))
    assert "says the pixels are 'RGB8', not Z16" in refusal(path)
    beside.write_text(made.VIEWER.replace("Resolution x,64", "Resolution x,many"))
    assert "are no sizes" in refusal(path)
    beside.write_text(made.VIEWER)
    path.write_bytes(path.read_bytes()[:-2])
    assert "6142 bytes are not 64 x 48 pixels" in refusal(path)
    beside.unlink()
    assert "bytes without a header" in refusal(path)


@pytest.mark.parametrize("step", [1, 2])
def test_a_table_by_pixel_recovers_its_camera(tmp_path: Path, step: int) -> None:
    """Of every other pixel the camera is that of the image thinned: centres lie at step · u."""
    frame = read(put(tmp_path, made.pixel_table(step), "rec_3d.csv"))
    assert frame.points is not None
    assert frame.points.shape == (48 // step, 64 // step, 3)
    assert np.allclose(frame.points, POINTS[::step, ::step], atol=1e-6, equal_nan=True)
    assert frame.camera is not None
    known = (CAMERA.fx / step, CAMERA.fy / step, CAMERA.cx / step, CAMERA.cy / step)
    found = (frame.camera.fx, frame.camera.fy, frame.camera.cx, frame.camera.cy)
    assert found == pytest.approx(known, abs=2e-3)


def test_a_thin_table_by_pixel_stays_a_cloud(tmp_path: Path) -> None:
    rows = made.pixel_table().splitlines()
    few = b"\n".join([rows[0], *rows[1::37]]) + b"\n"
    points = read(put(tmp_path, few, "few.csv")).points
    assert points is not None
    assert points.shape == (len(rows[1::37]), 3)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be"])
def test_tables_in_utf_16(tmp_path: Path, encoding: str) -> None:
    mark = "" if encoding == "utf-16" else "\ufeff"
    text = mark + "x;y;z\r\n" + "\r\n".join(f"{x:.9g};{y:.9g};{z:.9g}" for x, y, z in CLOUD)
    points = read(put(tmp_path, text.encode(encoding), "points.csv")).points
    assert np.allclose(np.asarray(points), CLOUD, rtol=1e-7)


@pytest.mark.parametrize("mixed", [False, True])
@pytest.mark.parametrize("order", ["<", ">"])
def test_a_ply_with_its_faces_first(tmp_path: Path, order: str, mixed: bool) -> None:
    points = read(put(tmp_path, made.faces_first_ply(order, mixed), "mesh.ply")).points
    assert np.array_equal(np.asarray(points), CLOUD)


@pytest.mark.parametrize(("content", "name"), [(made.obj(), "obj"), (made.off(), "off")])
def test_of_a_mesh_only_the_vertices_are_points(tmp_path: Path, content: bytes, name: str) -> None:
    with siloscope.open(put(tmp_path, content, "mesh")) as source:
        (frame,) = source
        described = source.describe()
    assert (described["format"], described["streams"][0]["size"]) == (name, [len(CLOUD)])
    assert np.allclose(np.asarray(frame.points), CLOUD, rtol=1e-7)


BAD_MESHES = {
    "empty OBJ": (b"mtllib a.mtl\no nothing\n", "has no vertices"),
    "word in an OBJ": (b"v 1 2 x\nv 1 2 3\n", "among the vertices"),
    "OFF without counts": (b"OFF\nmany\n", "names no counts"),
    "OFF of too many": (b"OFF\n900000000 0 0\n1 2 3\n", "can't hold"),
    "OFF cut": (made.off()[:3000], "vertices"),
}


@pytest.mark.parametrize(("content", "cause"), BAD_MESHES.values(), ids=BAD_MESHES.keys())
def test_bad_meshes_are_refused(tmp_path: Path, content: bytes, cause: str) -> None:
    assert cause in refusal(put(tmp_path, content, "bad.mesh"))


@pytest.mark.parametrize("devices", [58, 59])
def test_livox_recordings_of_version_1_0_are_found_by_their_first_frame(tmp_path: Path, devices: int) -> None:
    with siloscope.open(put(tmp_path, made.lvx_1_0(devices), "old.lvx")) as source:
        frames = list(source)
    assert sum(len(np.asarray(frame.points)) for frame in frames) == made.LIVOX[..., 0].size
    assert np.allclose(np.asarray(frames[-1].points), made.LIVOX[2] / 1000, atol=1e-6)


@pytest.mark.parametrize(("content", "dust"), [(made.lvx(), (5, 6, 7)), (made.lvx2(), (6, 7))])
def test_livox_leaves_dust_out_and_gives_a_frame_a_second(
    tmp_path: Path, content: bytes, dust: tuple[int, ...]
) -> None:
    with siloscope.open(put(tmp_path, content)) as source:
        first, second = source
        assert source.timestamps == [5.0, 6.2]
    kept = np.delete(made.LIVOX, dust, axis=1) / 1000
    assert np.allclose(np.asarray(first.points), kept[:2].reshape(-1, 3), atol=1e-6)
    assert np.allclose(np.asarray(second.points), kept[2], atol=1e-6)
    assert first.provenance["left_out_as_dust"] == 2 * len(dust)
    assert "x forward" in first.provenance["axes"]


def test_livox_in_centimetres_and_polar(tmp_path: Path) -> None:
    with siloscope.open(put(tmp_path, made.lvx2(centimetres=True))) as source:
        points = source[1].points
    assert np.allclose(np.asarray(points), np.delete(made.LIVOX[2] // 10, (6, 7), axis=0) / 100, atol=1e-6)
    points = read(put(tmp_path, made.polar_lvx())).points
    angle = np.radians(np.arange(100) * 0.9)
    flat = np.stack([2 * np.cos(angle), 2 * np.sin(angle), 0 * angle], axis=1)
    assert np.allclose(np.asarray(points), flat, atol=1e-6)


def test_livox_gravity_is_against_the_accelerometer(tmp_path: Path) -> None:
    frame = next(iter(siloscope.open(put(tmp_path, made.lvx()))))
    assert frame.gravity == pytest.approx([-0.6 * 9.80665, 0, -0.8 * 9.80665], rel=1e-6)


def test_a_cut_livox_recording_gives_what_is_there(tmp_path: Path) -> None:
    with siloscope.open(put(tmp_path, made.lvx()[:-100])) as source:
        frames = list(source)
        assert len(frames) == 1
        assert "cut off" in source.problems[-1]
    assert "version 1.0 without a frame" in refusal(put(tmp_path, made.lvx_1_0(40), "old.lvx"))
    assert "another version" in refusal(put(tmp_path, made.lvx()[:20] + bytes(60), "short.lvx"))


@pytest.mark.parametrize("mcap", [False, True])
def test_a_ros_2_bag_packed_whole(tmp_path: Path, mcap: bool, capsys: pytest.CaptureFixture[str]) -> None:
    maker = Maker(2)
    k = (CAMERA.fx, 0, CAMERA.cx, 0, CAMERA.fy, CAMERA.cy, 0, 0, 1)
    messages = [
        ("/depth/image_raw", START_NS, maker.image(RAW, "16UC1")),
        ("/depth/camera_info", START_NS, maker.camera_info((64, 48), k)),
    ]
    folder = maker.write(tmp_path / "bag", messages, mcap=mcap, compression="zstd", mode="FILE")
    packed = next(file for file in folder.iterdir() if file.suffix == ".zstd")
    for path in (folder, packed):
        frame = read(path)
        assert np.array_equal(np.asarray(frame.depth), RAW)
        assert frame.camera == Camera(64, 48, CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy)
        assert str(path) in frame.source
    assert main(["info", str(packed), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["file"] == str(packed)
    assert "siloscope-" not in json.dumps(document)


def test_bad_packed_files_are_refused_by_their_own_name(tmp_path: Path) -> None:
    recording = made.MAKERS["bag.mcap.zstd"]()
    assert "damaged Zstandard file" in refusal(put(tmp_path, recording[:4] + b"\xff" * 40, "bad.mcap.zstd"))
    assert "holds no recording; unpack it: zstd -d" in refusal(put(tmp_path, zstd.compress(b"text"), "a.zst"))
    bomb = zstd.compress(recording_files.ros2(mcap=True) + bytes(80 << 20))
    assert len(bomb) < 40_000
    assert "unpacks to more than" in refusal(put(tmp_path, bomb, "bomb.zst"))
    whole = recording_files.ros2(mcap=True)
    cut = zstd.compress(whole[: len(whole) // 2])
    with siloscope.open(put(tmp_path, cut, "cut.mcap.zst")) as source:
        list(source)
        assert "cut.mcap.zst: the recording is cut off" in source.problems[-1]


def test_tiff_of_half_floats_and_zstandard(tmp_path: Path) -> None:
    Image.fromarray(METRES).save(tmp_path / "zstd.tif", compression="zstd")
    assert np.array_equal(np.asarray(read(tmp_path / "zstd.tif").depth), METRES)
    Image.fromarray(RAW).save(tmp_path / "raw.tif", compression="zstd")
    assert np.array_equal(np.asarray(read(tmp_path / "raw.tif", depth_unit=0.001).depth), RAW)
    half = METRES.astype(np.float16)
    assert np.array_equal(np.asarray(read(put(tmp_path, half_tiff(half), "half.tif")).depth), half.astype(np.float32))


def half_tiff(half: np.ndarray[tuple[int, int], np.dtype[np.float16]]) -> bytes:
    """An uncompressed little-endian TIFF of half floats (TIFF 6.0, sections 2 and 19)."""
    height, width = half.shape
    data = half.astype("<f2").tobytes()
    tags = {256: width, 257: height, 258: 16, 259: 1, 262: 1, 273: 8, 277: 1, 278: height, 279: len(data), 339: 3}
    table = b"".join(np.array([(tag, 4, 1, value)], "<u2,<u2,<u4,<u4").tobytes() for tag, value in tags.items())
    directory = len(tags).to_bytes(2, "little") + table + bytes(4)
    return b"II*\0" + (8 + len(data)).to_bytes(4, "little") + data + directory


def test_a_folder_without_frames_says_what_it_has(tmp_path: Path) -> None:
    for name in ("a.log", "b.log", "c.jpg"):
        (tmp_path / name).write_bytes(b"words")
    assert "but with 2 .log, 1 .jpg; give the folder" in refusal(tmp_path)


def test_cameras_of_snapshots_are_camera_files() -> None:
    assert camera_files.parse("metadata", made.VIEWER).cameras == (CAMERA,)
