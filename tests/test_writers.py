"""What is written is read again; what does not fit is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import frame_files as made
import siloscope
from siloscope import Frame, UsageError
from siloscope.io import writers


def back(path: Path) -> Frame:
    (frame,) = siloscope.open(path)
    return frame


@given(arrays(np.float64, (7, 9), elements=st.floats(allow_nan=True, allow_infinity=True)), st.floats(1e-5, 1e-2))
def test_raw_units_round_and_leave_out_what_is_none(depth: np.ndarray, unit: float) -> None:
    measured = np.isfinite(depth) & (depth > 0)
    depth = np.where(measured, np.minimum(depth, 65_534 * unit), depth)
    raw = writers.to_raw(depth, unit)
    assert not raw[~measured].any()
    assert np.all(np.abs(raw[measured] * unit - depth[measured]) <= unit * 0.5000001)
    assert raw.max() < 65_535


def test_a_unit_too_fine_is_refused_with_one_that_fits() -> None:
    with pytest.raises(UsageError, match=r"reach 6\.553 m, not 8\.000 m"):
        writers.to_raw(np.array([[8.0]]), 0.0001)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_ply_keeps_points_grid_and_labels(tmp_path: Path, dtype: type) -> None:
    path = tmp_path / "cloud.ply"
    points = made.POINTS.astype(dtype) + dtype(1e-7)
    writers.write_ply(path, points, labels=made.LABELS, comments=["two\nlines", "ü"])
    frame = back(path)
    assert frame.points is not None
    assert frame.points.dtype == dtype
    assert np.array_equal(frame.points, points, equal_nan=True)
    assert np.array_equal(frame.labels, made.LABELS)


def test_ply_with_everything_in_it(tmp_path: Path) -> None:
    path = tmp_path / "cloud.ply"
    colours = np.full((len(made.CLOUD), 3), 7, np.uint8)
    writers.write_ply(path, made.CLOUD, colours=colours, normals=made.CLOUD)
    head = path.read_bytes().split(b"end_header")[0].decode()
    names = [line.split()[-1] for line in head.splitlines() if line.startswith("property")]
    assert names == ["x", "y", "z", "nx", "ny", "nz", "red", "green", "blue"]
    assert np.array_equal(back(path).points, made.CLOUD)


def test_what_does_not_belong_to_the_points_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="'red' has 3 entries"):
        writers.write_ply(tmp_path / "a.ply", made.CLOUD, colours=np.zeros((3, 3), np.uint8))
    with pytest.raises(UsageError, match="takes 3 values a point, not 2"):
        writers.write_ply(tmp_path / "a.ply", made.CLOUD[:, :2])
    with pytest.raises(UsageError, match="uint16"):
        writers.write_png(tmp_path / "a.png", made.METRES)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("frame", "suffix"),
    [(Frame(depth=made.METRES), ".npy"), (Frame(points=made.CLOUD), ".ply"), (Frame(points=made.POINTS), ".ply")],
)
def test_frames_are_written_without_loss(tmp_path: Path, frame: Frame, suffix: str) -> None:
    path = tmp_path / f"frame{writers.suffix(frame)}"
    assert path.suffix == suffix
    writers.write_frame(path, frame)
    for key in ("depth", "points"):
        values = getattr(frame, key)
        assert values is None or np.array_equal(getattr(back(path), key), values, equal_nan=True)
