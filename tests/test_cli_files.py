"""``siloscope info`` and ``siloscope convert`` as users call them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import frame_files as made
import siloscope
from siloscope.cli import main
from siloscope.io import camera_files

Captured = pytest.CaptureFixture[str]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return made.write_folder(tmp_path / "frames")


def document(capsys: Captured, *arguments: object) -> tuple[int, dict[str, Any]]:
    code = main([*map(str, arguments), "--json"])
    return code, json.loads(capsys.readouterr().out)


def test_info_tells_what_is_inside(folder: Path, capsys: Captured) -> None:
    code, found = document(capsys, "info", folder)
    assert code == 0
    assert (found["schema"], found["format"], found["frames"]) == ("siloscope.info/1", "folder", 3)
    assert found["streams"][0]["size"] == [made.WIDTH, made.HEIGHT]
    assert (found["camera"]["fx"], found["camera_from"]) == (made.CAMERA.fx, "camera.json")
    assert (found["depth_unit"], found["depth_unit_from"]) == (made.UNIT, "camera.json")


def test_info_as_a_table(folder: Path, capsys: Captured) -> None:
    assert main(["info", str(folder)]) == 0
    text = capsys.readouterr().out
    for part in ("64 x 48 pixels, uint16, 3 frames", "fx 57.25 fy 57.5 cx 31.75 cy 23.25", "0.25 mm (camera.json)"):
        assert part in text


def test_info_asks_for_what_is_missing(tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "depth.png").write_bytes(made.MAKERS["depth.png"]())
    assert main(["info", str(tmp_path / "depth.png")]) == 0
    text = capsys.readouterr().out
    assert "unknown; give --camera" in text
    assert "unknown; give --depth-unit" in text


def test_info_checks_every_frame_when_asked(folder: Path, capsys: Captured) -> None:
    code, found = document(capsys, "info", folder, "--check")
    assert (code, found["read"], found["problems"]) == (0, 3, [])
    damaged = folder / "depth_2.png"
    damaged.write_bytes(damaged.read_bytes()[:-300])
    code, found = document(capsys, "info", folder, "--check")
    assert (code, found["read"], len(found["problems"])) == (5, 2, 1)
    assert document(capsys, "info", folder)[0] == 0


def test_info_of_no_frames_is_exit_3(tmp_path: Path, capsys: Captured) -> None:
    code, found = document(capsys, "info", tmp_path / "missing.png")
    assert (code, found["schema"]) == (3, "siloscope.error/1")
    assert "missing.png: no such file" in found["message"]


def test_convert_keeps_values_camera_and_origin(folder: Path, tmp_path: Path, capsys: Captured) -> None:
    out = tmp_path / "out"
    code, told = document(capsys, "convert", folder, "-o", out)
    assert (code, told["schema"], told["frames"]) == (0, "siloscope.convert/1", 3)
    assert sorted(path.name for path in out.iterdir()) == sorted(Path(name).name for name in told["files"])
    for frame, before in zip(siloscope.open(out), siloscope.open(folder), strict=True):
        assert np.array_equal(frame.depth, before.depth)
        assert (frame.camera, frame.depth_unit) == (before.camera, before.depth_unit)
    rows = json.loads((out / "frames.json").read_text())["frames"]
    assert [row["provenance"]["frame"] for row in rows] == ["depth_1.png", "depth_2.png", "depth_10.png"]


def test_convert_to_one_npz(folder: Path, tmp_path: Path, capsys: Captured) -> None:
    out = tmp_path / "all.npz"
    assert document(capsys, "convert", folder, "-o", out)[0] == 0
    frames = list(siloscope.open(out))
    assert len(frames) == 3
    assert np.array_equal(frames[2].depth, made.RAW + 10)
    assert (frames[0].camera, frames[0].depth_unit) == (made.CAMERA, made.UNIT)


def test_convert_to_a_cloud_back_projects(folder: Path, tmp_path: Path, capsys: Captured) -> None:
    out = tmp_path / "cloud.ply"
    assert main(["convert", str(folder / "depth_1.png"), "-o", str(out)]) == 0
    (frame,) = siloscope.open(out)
    assert frame.points is not None
    raw = made.RAW + 1
    v, u = np.nonzero((raw > 0) & (raw < 65_535))
    z = raw[v, u] * made.UNIT
    expected = np.column_stack(
        [(u - made.CAMERA.cx) / made.CAMERA.fx * z, (v - made.CAMERA.cy) / made.CAMERA.fy * z, z]
    )
    assert np.allclose(frame.points, expected, rtol=0, atol=1e-12)


def test_convert_times_and_gravity_come_through(folder: Path, tmp_path: Path, capsys: Captured) -> None:
    rows = [{"file": f"depth_{i}.png", "timestamp": 1.7e9 + i, "gravity": [0, 1, 9.7]} for i in (1, 2, 10)]
    (folder / "frames.json").write_text(json.dumps({"frames": rows}))
    assert document(capsys, "convert", folder, "-o", tmp_path / "out")[0] == 0
    frames = list(siloscope.open(tmp_path / "out"))
    assert [frame.timestamp for frame in frames] == [1.7e9 + i for i in (1, 2, 10)]
    assert all(np.array_equal(frame.gravity, [0, 1, 9.7]) for frame in frames)


def test_convert_tells_damaged_frames_with_exit_5(folder: Path, tmp_path: Path, capsys: Captured) -> None:
    damaged = folder / "depth_2.png"
    damaged.write_bytes(damaged.read_bytes()[:-300])
    code, told = document(capsys, "convert", folder, "-o", tmp_path / "out")
    assert (code, told["frames"], len(told["problems"])) == (5, 2, 1)
    assert len(list(siloscope.open(tmp_path / "out"))) == 2


def test_convert_metres_exactly_or_to_raw_units(tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "metres.npy").write_bytes(made.MAKERS["metres.npy"]())
    assert document(capsys, "convert", tmp_path / "metres.npy", "-o", tmp_path / "exact")[0] == 0
    (frame,) = siloscope.open(tmp_path / "exact")
    assert np.array_equal(frame.depth, made.METRES)
    camera_files.dump(made.CAMERA, tmp_path / "camera.json")
    arguments = ("convert", tmp_path / "metres.npy", "-o", tmp_path / "raw", "--raw-unit", made.UNIT)
    assert document(capsys, *arguments)[0] == 0
    (frame,) = siloscope.open(tmp_path / "raw")
    assert np.array_equal(frame.depth, made.RAW)
    assert frame.depth_unit == made.UNIT


def test_convert_clouds_keep_their_labels(tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "cloud.pcd").write_bytes(made.MAKERS["compressed.pcd"]())
    assert document(capsys, "convert", tmp_path / "cloud.pcd", "-o", tmp_path / "out")[0] == 0
    (frame,) = siloscope.open(tmp_path / "out")
    assert np.array_equal(frame.points, made.POINTS, equal_nan=True)
    assert np.array_equal(frame.labels, made.LABELS)


WRONG = {
    "not empty": (lambda f, t: (f, "-o", f), "not empty"),
    "a file": (lambda f, t: (f, "-o", f / "camera.json"), "exists already"),
    "several in a cloud": (lambda f, t: (f, "-o", t / "a.ply"), "takes one frame"),
    "no place": (lambda f, t: (f, "-o", f / "camera.json" / "x"), "cannot be written"),
    "unit too fine": (lambda f, t: (t / "m.npy", "-o", t / "out", "--raw-unit", "0.00001"), "use a unit of"),
    "another camera": (lambda f, t: (f, t / "other.npz", "-o", t / "out"), "another camera"),
    "another size": (lambda f, t: (t / "m.npy", t / "n.npy", "-o", t / "all.npz"), "don't stack"),
}


@pytest.mark.parametrize(("call", "cause"), WRONG.values(), ids=WRONG.keys())
def test_convert_refuses_what_one_output_cannot_hold(
    folder: Path, tmp_path: Path, capsys: Captured, call: Any, cause: str
) -> None:
    (tmp_path / "m.npy").write_bytes(made.npy(made.METRES))
    (tmp_path / "n.npy").write_bytes(made.npy(made.METRES[:40]))
    (tmp_path / "other.npz").write_bytes(made.npz(depth=made.RAW, depth_unit=0.001))
    code, told = document(capsys, "convert", *call(folder, tmp_path))
    assert (code, told["exit_code"]) == (2, 2)
    assert cause in told["message"]
    assert not (tmp_path / "a.ply").exists()
