"""Genuine files by others open with the shape, unit and camera that their descriptions tell."""

from __future__ import annotations

import numpy as np
import pytest

import realdata
import siloscope
from siloscope import Frame


def only_frame(*parts: str) -> Frame:
    with siloscope.open(realdata.path(*parts)) as source:
        (frame,) = source
        assert not source.problems
    return frame


@pytest.mark.parametrize("scene", ["learn33", "learn34", "learn36", "learn44"])
def test_kinect_frames_with_labels(scene: str) -> None:
    frame = only_frame("mosd_kinect_cylindric", f"{scene}.pcd")
    assert frame.points is not None
    assert frame.labels is not None
    assert frame.camera is not None
    assert frame.points.shape == (480, 640, 3)
    assert frame.camera.fx == pytest.approx(525.0, abs=1e-4)
    assert frame.camera.fy == pytest.approx(525.0, abs=1e-4)
    assert (frame.camera.cx, frame.camera.cy) == (pytest.approx(319.5, abs=1e-4), pytest.approx(239.5, abs=1e-4))
    invalid = np.isnan(frame.points).any(axis=2)
    assert np.array_equal(frame.labels == 0, invalid)


def test_the_table_of_a_kinect_frame_has_the_normal_of_its_description() -> None:
    frame = only_frame("mosd_kinect_cylindric", "learn36.pcd")
    assert frame.points is not None
    assert frame.labels is not None
    table = frame.points[(frame.labels >= 1) & (frame.labels <= 9)].astype(np.float64)
    normal = np.linalg.svd(table - table.mean(axis=0), full_matrices=False)[2][2]
    described = np.array([0.0014, -0.8243, -0.5661])
    assert abs(normal @ described) / np.linalg.norm(described) > np.cos(np.radians(0.05))


def test_textured_stereo_frame_has_the_points_that_pcl_counts() -> None:
    frame = only_frame("pcl_mug_cylinder", "table_scene_mug_stereo_textured.pcd")
    assert frame.points is not None
    assert frame.points.shape == (480, 640, 3)
    with np.errstate(invalid="ignore"):
        assert np.count_nonzero(frame.points[..., 2] < 1.5) == 139_897


BINS = {
    "deep_bin_overhead": 105_998,
    "lab_empty_box": 77_181,
    "lab_full_box_scan": 360_270,
    "last_overhead_concave": 104_273,
}


@pytest.mark.parametrize(("name", "count"), BINS.items())
def test_bins_scanned_from_above(name: str, count: int) -> None:
    frame = only_frame("bin_content_livox", f"{name}.pcd")
    assert frame.points is not None
    assert frame.points.shape == (count, 3)
    assert np.isfinite(frame.points).all()
    assert frame.camera is None


def test_the_crater_is_as_deep_as_its_description_says() -> None:
    points = only_frame("bin_content_livox", "last_overhead_concave.pcd").points
    assert points is not None
    distance = np.hypot(points[:, 0] - 4.52, points[:, 1] - 0.55)
    rings = [points[(distance >= r) & (distance < r + 0.25), 2] for r in (0.0, 0.5, 1.0, 1.5, 2.0, 2.5)]
    assert [np.median(ring) for ring in rings] == pytest.approx([-9.89, -9.85, -9.64, -9.41, -9.17, -8.96], abs=0.025)


def test_the_same_bin_as_a_table() -> None:
    points = only_frame("bin_content_livox", "last_overhead_concave_height_Test.csv").points
    assert points is not None
    assert points.shape == (99_632, 3)
    assert points[0].tolist() == [1.3409282, -2.72899914, -9.58041477]


def test_total_station_table_keeps_the_numbers_of_its_points() -> None:
    frame = only_frame("tank_total_station", "scan.csv")
    assert frame.points is not None
    assert frame.labels is not None
    assert frame.points.shape == (1229, 3)
    assert np.count_nonzero(frame.labels >= 0) == 1193
    wall = frame.points[frame.labels >= 0]
    distance = np.hypot(wall[:, 0] - 37.350, wall[:, 1] - 25.713)
    assert np.median(distance) == pytest.approx(7.585, abs=0.01)


def test_primitives_as_text() -> None:
    points = only_frame("primitives_kinect_xyz", "sample.xyz").points
    assert points is not None
    assert points.shape == (9664, 3)
