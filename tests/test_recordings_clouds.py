"""LAS, LAZ and E57 clouds, EXR images and Azure Kinect recordings: genuine files, beside other libraries' reading."""

from __future__ import annotations

import json
import struct
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import realdata
import recording_files
import siloscope
from siloscope import Camera, Frame, InputError
from siloscope.cli import main

CLOUDS = "formats_las_e57"
MUG = ("azure_kinect_mkv_mug", "recording.mkv")


def only_frame(path: Path, **options: Any) -> Frame:
    with siloscope.open(path, **options) as source:
        (frame,) = source
    return frame


@pytest.mark.parametrize("name", recording_files.MAKERS)
def test_info_shows_every_recording_and_cloud(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / name
    path.write_bytes(recording_files.MAKERS[name]())
    assert main(["info", str(path), "--check"]) == 0
    assert "frame" in capsys.readouterr().out


# --- LAS and LAZ


@pytest.mark.parametrize(
    ("name", "count", "metres"),
    [
        ("simple.las", 1065, 1.0),
        ("simple.laz", 1065, 1.0),
        ("simple.copc.laz", 1065, 1.0),
        ("simple1_4.las", 22_600, 1.0),
        ("vegetation_1_3.las", 10_683, 1.0),
        ("autzen_trim.laz", 110_000, 0.3048),
    ],
)
def test_las_coordinates_are_laspys_in_metres(name: str, count: int, metres: float) -> None:
    laspy = pytest.importorskip("laspy")
    path = realdata.path(CLOUDS, name)
    points = only_frame(path).points
    assert points is not None
    assert points.dtype == np.float64
    expected = np.asarray(laspy.read(path).xyz) * metres
    assert points.shape == (count, 3) == expected.shape
    np.testing.assert_allclose(points, expected, rtol=1e-15)


def test_las_and_laz_are_the_same_points() -> None:
    plain, packed = (only_frame(realdata.path(CLOUDS, f"simple.{kind}")).points for kind in ("las", "laz"))
    assert plain is not None
    np.testing.assert_array_equal(plain, packed)


@pytest.mark.parametrize("name", ["simple.las", "simple.laz", "simple.copc.laz"])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_cut_las_file_is_refused(tmp_path: Path, name: str, share: float) -> None:
    pytest.importorskip("laspy")
    whole = realdata.path(CLOUDS, name).read_bytes()
    cut = tmp_path / name
    cut.write_bytes(whole[: int(len(whole) * share)])
    with pytest.raises(InputError, match=r"cut off|damaged"):
        list(siloscope.open(cut))


def test_a_missing_library_names_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "lazrs", None)
    path = tmp_path / "cloud.laz"
    path.write_bytes(recording_files.las(compressed=True))
    with pytest.raises(InputError, match=r"extra 'las': pip install 'siloscope\[las\]'"):
        siloscope.open(path)


@pytest.mark.parametrize("version", ["1.2", "1.4"])
def test_las_of_either_count_field(tmp_path: Path, version: str) -> None:
    laspy = pytest.importorskip("laspy")
    cloud = laspy.create(point_format=6 if version == "1.4" else 0, file_version=version)
    cloud.header.scales, cloud.header.offsets = np.array([0.001, 0.01, 0.1]), np.array([1e6, -2e6, 0])
    cloud.x, cloud.y, cloud.z = np.random.default_rng(1).uniform(-5, 5, (3, 60_000)) + np.array([[1e6], [-2e6], [0]])
    cloud.write(tmp_path / "cloud.las")
    np.testing.assert_array_equal(only_frame(tmp_path / "cloud.las").points, np.asarray(cloud.xyz))


# --- E57


@pytest.mark.parametrize(
    ("name", "count"), [("bunnyFloat.e57", 30_571), ("tinyCartesianFloatRgb.e57", 2_090), ("tiny_spherical.e57", 360)]
)
def test_e57_points_are_libe57s(name: str, count: int) -> None:
    pye57 = pytest.importorskip("pye57")
    path = realdata.path(CLOUDS, name)
    points = only_frame(path).points
    assert points is not None
    assert points.shape == (count, 3)
    np.testing.assert_allclose(points, _by_libe57(pye57, path), rtol=0, atol=1e-12)


def _by_libe57(pye57: Any, path: Path) -> Any:
    read = pye57.E57(str(path)).read_scan_raw(0)
    if "cartesianX" in read:
        return np.stack([read[f"cartesian{axis}"] for axis in "XYZ"], axis=1)
    r, azimuth, elevation = (read[f"spherical{name}"] for name in ("Range", "Azimuth", "Elevation"))
    flat = r * np.cos(elevation)
    points = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), r * np.sin(elevation)], axis=1)
    # 1 marks "only the direction is known", 2 "nothing is".
    points[read["sphericalInvalidState"] != 0] = np.nan
    return points


@pytest.mark.parametrize("bits", [1, 7, 12, 20, 33])
def test_scaled_integers_of_any_width(tmp_path: Path, bits: int) -> None:
    """Written by libE57; the bounds decide the width."""
    pye57 = pytest.importorskip("pye57")
    rng = np.random.default_rng(bits)
    low = -(1 << bits - 1)
    raw = rng.integers(low, low + (1 << bits), (70_000, 3))
    path = tmp_path / "packed.e57"
    _write_scaled(pye57, path, raw, low, low + (1 << bits) - 1)
    np.testing.assert_allclose(only_frame(path).points, raw * 0.001 + 5.0, rtol=1e-12)


def _write_scaled(pye57: Any, path: Path, raw: Any, low: int, high: int) -> None:
    lib = pye57.libe57
    image = lib.ImageFile(str(path), "w")
    root = image.root()
    root.set("formatName", lib.StringNode(image, "ASTM E57 3D Imaging Data File"))
    scans = lib.VectorNode(image, True)
    root.set("data3D", scans)
    scan = lib.StructureNode(image)
    scans.append(scan)
    prototype = lib.StructureNode(image)
    for axis in "XYZ":
        prototype.set(f"cartesian{axis}", lib.ScaledIntegerNode(image, 0, low, high, 0.001, 5.0))
    codecs = lib.VectorNode(image, True)
    points = lib.CompressedVectorNode(image, prototype, codecs)
    scan.set("points", points)
    buffers = lib.VectorSourceDestBuffer()
    columns = [np.ascontiguousarray(raw[:, i] * 0.001 + 5.0) for i in range(3)]
    for axis, column in zip("XYZ", columns, strict=True):
        buffers.append(lib.SourceDestBuffer(image, f"cartesian{axis}", column, len(raw), True, True))
    points.writer(buffers).write(len(raw))
    image.close()


def test_a_description_without_a_count_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "cloud.e57"
    path.write_bytes(recording_files.with_checksums(recording_files.e57().replace(b"recordCount", b"recordCxxxx")))
    with pytest.raises(InputError, match=r"cloud\.e57: damaged description \('recordCount'\)"):
        siloscope.open(path)


def test_a_negative_count_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "cloud.e57"
    negative = recording_files.e57().replace(b'recordCount="30"', b'recordCount="-3"')
    path.write_bytes(recording_files.with_checksums(negative))
    with pytest.raises(InputError, match="scan 0 has -3 points"):
        siloscope.open(path)


def test_a_wrong_checksum_is_refused_with_its_page() -> None:
    with pytest.raises(InputError, match="page 33 fails its checksum"):
        siloscope.open(realdata.path(CLOUDS, "corrupt_crc.e57"))


def test_a_flipped_bit_among_the_points_is_refused(tmp_path: Path) -> None:
    data = bytearray(realdata.path(CLOUDS, "bunnyFloat.e57").read_bytes())
    data[200_000] ^= 4
    path = tmp_path / "flipped.e57"
    path.write_bytes(data)
    with pytest.raises(InputError, match="page 195 fails its checksum"):
        list(siloscope.open(path))


# --- EXR


@pytest.mark.parametrize("dtype", [np.float32, np.float16])
@pytest.mark.parametrize("channel", ["Z", "Depth.Z", "View.distance", "RenderLayer.Depth.V", "V"])
def test_exr_depth_with_and_without_layer(tmp_path: Path, channel: str, dtype: Any) -> None:
    exr = pytest.importorskip("OpenEXR")
    depth = np.random.default_rng(1).uniform(1, 6, (48, 64)).astype(dtype)
    depth[0, 0], depth[0, 1] = np.inf, 6e4
    path = tmp_path / "depth.exr"
    colour = {name: np.zeros((48, 64), np.float32) for name in "RGB"} if channel != "V" else {}
    exr.File({}, {**colour, channel: depth}).write(str(path))
    frame = only_frame(path)
    expected = np.where(np.isinf(depth), 0, depth.astype(np.float32))
    np.testing.assert_array_equal(frame.depth, expected)
    assert frame.depth_unit is None


@pytest.mark.parametrize("compression", ["NO", "RLE", "ZIPS", "ZIP", "PIZ"])
def test_exr_lossless_compressions(tmp_path: Path, compression: str) -> None:
    exr = pytest.importorskip("OpenEXR")
    depth = np.random.default_rng(2).uniform(1, 6, (48, 64)).astype(np.float32)
    path = tmp_path / "depth.exr"
    exr.File({"compression": getattr(exr, f"{compression}_COMPRESSION")}, {"Z": depth}).write(str(path))
    np.testing.assert_array_equal(only_frame(path).depth, depth)


def test_exr_with_several_parts(tmp_path: Path) -> None:
    exr = pytest.importorskip("OpenEXR")
    depth = np.random.default_rng(2).uniform(1, 6, (48, 64)).astype(np.float32)
    colour = exr.Part({}, {"R": np.zeros((48, 64), np.float32)}, "beauty")
    path = tmp_path / "parts.exr"
    exr.File([colour, exr.Part({}, {"Z": depth}, "depth")]).write(str(path))
    np.testing.assert_array_equal(only_frame(path).depth, depth)


@pytest.mark.parametrize("compression", ["DWAA", "B44", "PXR24"])
def test_exr_lossy_compressions_are_read_as_openexr_reads_them(tmp_path: Path, compression: str) -> None:
    exr = pytest.importorskip("OpenEXR")
    path = tmp_path / "lossy.exr"
    smooth = np.add.outer(np.linspace(2, 3, 48), np.linspace(0, 1, 64)).astype(np.float16)
    exr.File({"compression": getattr(exr, f"{compression}_COMPRESSION")}, {"Y": smooth}).write(str(path))
    with exr.File(str(path), separate_channels=True) as file:
        expected = np.array(file.channels()["Y"].pixels)
    np.testing.assert_allclose(only_frame(path).depth, expected, rtol=2e-3)


def test_exr_ray_length_becomes_z(tmp_path: Path) -> None:
    exr = pytest.importorskip("OpenEXR")
    camera = Camera(64, 48, 57.0, 57.0, 31.5, 23.5)
    z = 3.0
    length = z * np.sqrt(1 + np.sum(camera.rays() ** 2, axis=2))
    path = tmp_path / "length.exr"
    exr.File({}, {"Z": length.astype(np.float32)}).write(str(path))
    np.testing.assert_allclose(only_frame(path, camera=camera, ray_length=True).depth, z, rtol=1e-6)


def test_exr_without_a_channel_that_is_depth_asks(tmp_path: Path) -> None:
    exr = pytest.importorskip("OpenEXR")
    path = tmp_path / "colour.exr"
    exr.File({}, {name: np.full((48, 64), i, np.float32) for i, name in enumerate("RGB", 1)}).write(str(path))
    with pytest.raises(InputError, match="which channel is depth"):
        siloscope.open(path)
    depth = only_frame(path, stream="G").depth
    assert depth is not None
    assert depth[0, 0] == 2


# --- Azure Kinect


def test_azure_kinect_recording() -> None:
    """Reference values of the recording's README; the camera by k4a's formula from calibration.json."""
    path = realdata.path(*MUG)
    with siloscope.open(path) as source:
        (frame,) = source
    depth, camera = frame.depth, frame.camera
    assert depth is not None
    assert (depth.shape, depth.dtype, frame.depth_unit) == ((576, 640), np.uint16, 0.001)
    assert camera is not None
    expected = (504.608, 504.733, 332.78, 348.83)
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == pytest.approx(expected, abs=2e-3)
    k = (0.54794, -0.020971, 2.06e-5, -7.21e-5, -0.0026522, 0.88968, 0.08613, -0.01391)
    assert camera.distortion == pytest.approx(k, rel=5e-3)
    saved = json.loads(realdata.path(MUG[0], "calibration.json").read_text())
    assert camera.distortion[0] == saved["CalibrationInformation"]["Cameras"][0]["Intrinsics"]["ModelParameters"][4]
    assert source.provenance["serial_number"] == "001514394512"


def test_azure_kinect_depth_is_pyavs() -> None:
    av = pytest.importorskip("av")
    path = realdata.path(*MUG)
    with av.open(str(path)) as container:
        packet = next(p for p in container.demux(container.streams[1]) if p.size)
        expected = np.frombuffer(bytes(packet), ">u2").reshape(576, 640)
    np.testing.assert_array_equal(only_frame(path).depth, expected)


def test_azure_kinect_gravity_is_the_standing_mugs_axis() -> None:
    """The README's fit of the mug's axis; a fit of a mug at 0.3 m is good for some degrees."""
    gravity = only_frame(realdata.path(*MUG)).gravity
    assert gravity is not None
    axis = np.array([-0.037, 0.987, -0.157])
    cosine = gravity @ axis / np.linalg.norm(gravity) / np.linalg.norm(axis)
    assert np.degrees(np.arccos(cosine)) < 4


@pytest.mark.parametrize("share", [0.99, 0.75, 0.5, 0.003])
def test_a_cut_azure_kinect_recording(tmp_path: Path, share: float) -> None:
    """Its one depth picture ends at 57 % of the file."""
    whole = realdata.path(*MUG).read_bytes()
    path = tmp_path / "cut.mkv"
    path.write_bytes(whole[: int(len(whole) * share)])
    if share < 0.57:
        with pytest.raises(InputError, match="cut off"):
            list(siloscope.open(path))
    else:
        source = siloscope.open(path)
        assert len(list(source)) == 1
        assert "cut off" in source.problems[0]


def test_a_film_is_no_depth_recording(tmp_path: Path) -> None:
    path = tmp_path / "film.mkv"
    whole = realdata.path(*MUG).read_bytes()
    path.write_bytes(whole.replace(b"DEPTH", b"RIGHT", 1))
    with pytest.raises(InputError, match="the tracks are: COLOR, RIGHT, IR, IMU"):
        siloscope.open(path)


def test_an_e57_packet_too_short_for_its_head_is_damage(tmp_path: Path) -> None:
    file = bytearray(recording_files.e57())
    head = 48 + 32  # behind the file's head and that of the first section
    assert struct.unpack_from("<BB", file, head) == (1, 0)
    struct.pack_into("<H", file, head + 2, 0)  # a data packet of one byte
    path = tmp_path / "short.e57"
    path.write_bytes(recording_files.with_checksums(bytes(file)))
    source = siloscope.open(path)
    assert len(list(source)) == 1, "the other scan is whole"
    assert "shorter than its own head" in source.problems[0]
