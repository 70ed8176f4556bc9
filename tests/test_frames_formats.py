"""Every base format opens by its content and gives back exactly what was stored."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import frame_files as made
import siloscope
from frame_files import put, read


@pytest.mark.parametrize("name", made.MAKERS)
def test_every_format_opens_by_its_content_alone(tmp_path: Path, name: str) -> None:
    path = put(tmp_path, made.MAKERS[name](), "renamed.dat")
    with siloscope.open(path, depth_unit=None if "metres" in name or "lzw" in name else made.UNIT) as source:
        described = source.describe()
        frames = list(source)
    assert described["frames"] == len(frames)
    assert described["streams"][0]["frames"] == len(frames)
    json.dumps(described)
    for frame in frames:
        shape = (frame.depth if frame.depth is not None else frame.points[..., 0]).shape
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
