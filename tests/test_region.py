"""Masks, labels and boxes: which part of a frame is looked at."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from siloscope import Camera, Frame, InputError, UsageError
from siloscope.estimation.region import box_mask, frame_points, label_mask, read_mask

CAMERA = Camera(4, 3, 2.0, 2.0, 1.5, 1.0)


def image_frame() -> Frame:
    return Frame(depth=np.full((3, 4), 2.0, np.float32), camera=CAMERA, source="f.png")


def test_points_of_a_depth_image_follow_equations_1_and_2() -> None:
    points = frame_points(image_frame())
    u, v = np.meshgrid(np.arange(4), np.arange(3))
    assert points[..., 0] == pytest.approx(2.0 / 2.0 * (u - 1.5))
    assert points[..., 1] == pytest.approx(2.0 / 2.0 * (v - 1.0))
    assert (points[..., 2] == 2.0).all()


def test_raw_depth_is_scaled_and_its_holes_are_nan() -> None:
    raw = np.array([[0, 1000, 65535, 2000]] * 3, np.uint16)
    points = frame_points(Frame(depth=raw, camera=CAMERA, depth_unit=1e-3))
    assert np.isnan(points[:, [0, 2]]).all()
    assert points[0, :, 2][[1, 3]] == pytest.approx([1.0, 2.0])


def test_image_without_camera_is_refused() -> None:
    with pytest.raises(InputError, match="camera"):
        frame_points(Frame(depth=np.ones((3, 4)), source="f.png"))


@pytest.mark.parametrize("mode", ["L", "1", "I;16", "RGB"])
def test_mask_images(tmp_path: Path, mode: str) -> None:
    wanted = np.zeros((3, 4), bool)
    wanted[1, 2] = True
    path = tmp_path / "mask.png"
    picture = Image.fromarray(np.where(wanted, 255, 0).astype(np.uint8))
    if mode == "I;16":
        picture = Image.fromarray(np.where(wanted, 300, 0).astype(np.uint16))
    picture.convert(mode).save(path) if mode in ("1", "RGB") else picture.save(path)
    assert (read_mask(path, (3, 4)) == wanted).all()


def test_mask_array(tmp_path: Path) -> None:
    np.save(tmp_path / "m.npy", np.eye(3, 4, dtype=bool))
    assert read_mask(tmp_path / "m.npy", (3, 4)).sum() == 3


def broken(tmp_path: Path, kind: str) -> Path:
    path = tmp_path / "m.npy"
    if kind == "objects":
        np.save(path, np.array([[{}]], object), allow_pickle=True)
    elif kind == "text":
        path.write_text("hello")
    elif kind == "empty":
        path.write_bytes(b"")
    elif kind == "zero":
        np.save(path, np.zeros((3, 4)))
    elif kind == "other size":
        np.save(path, np.ones((4, 3)))
    elif kind == "cut off":
        np.save(path, np.ones((300, 400)))
        path.write_bytes(path.read_bytes()[:300])
    elif kind == "strings":
        np.save(path, np.array([["a"]]))
    return path


@pytest.mark.parametrize("kind", ["missing", "objects", "text", "empty", "zero", "other size", "cut off", "strings"])
def test_masks_that_cannot_be_used_name_file_and_remedy(tmp_path: Path, kind: str) -> None:
    with pytest.raises(InputError, match=r"m\.npy: .*[;,] \w+"):
        read_mask(broken(tmp_path, kind), (3, 4))


def test_labels() -> None:
    frame = Frame(points=np.zeros((3, 3)), labels=np.array([1, 2, 2]), source="c.pcd")
    assert label_mask(frame, 2).tolist() == [False, True, True]
    with pytest.raises(InputError, match="labels there are 1, 2"):
        label_mask(frame, 7)
    with pytest.raises(InputError, match="has no labels"):
        label_mask(Frame(points=np.zeros((3, 3))), 7)


def test_box() -> None:
    points = np.array([[0.0, 0, 1], [0.5, 0, 1], [np.nan, 0, 1], [0, 0, 3]])
    frame = Frame(points=points, source="c.ply")
    assert box_mask(frame, (-0.1, 0.1, -1, 1, 0, 2)).tolist() == [True, False, False, False]
    with pytest.raises(InputError, match="points reach"):
        box_mask(frame, (5, 6, 5, 6, 5, 6))
    for wrong in ((1, 0, 0, 1, 0, 1), (0, 1, 0, 1), (0, np.nan, 0, 1, 0, 1)):
        with pytest.raises(UsageError, match="xmin"):
            box_mask(frame, wrong)
