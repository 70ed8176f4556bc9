"""``siloscope locate`` from outside: answers, files, refusals, and bad input."""

from __future__ import annotations

import io
import json
import os
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import realdata
import siloscope
from siloscope.cli import main
from siloscope.estimation.methods import METHODS
from siloscope.io.writers import write_camera, write_npy, write_ply, write_png
from siloscope.simulation.scenarios import scenario
from siloscope.wording import printable

Shown = pytest.CaptureFixture[str]
TRUTH = scenario("silo1").pose


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A frame of Silo1 in several formats, with its camera."""
    directory = tmp_path_factory.mktemp("locate")
    seen = scenario("silo1").render()
    write_png(directory / "frame.png", seen.raw(0.0005))
    write_npy(directory / "frame.npy", seen.depth.astype(np.float32))
    write_camera(seen.camera, directory / "camera.json")
    points = seen.camera.rays()
    cloud = np.dstack([points * seen.depth[..., None], seen.depth])[seen.depth > 0]
    write_ply(directory / "cloud.ply", cloud.astype(np.float32))
    return directory


def answer(arguments: list[str], shown: Shown) -> tuple[int, dict[str, Any]]:
    """Exit code and the one document on stdout."""
    code = main([*arguments, "--json"])
    return code, json.loads(shown.readouterr().out)


def arguments(place: Path, name: str) -> list[str]:
    more = {"frame.png": ["--depth-unit", "0.0005"], "cloud.ply": []}.get(name, [])
    camera = [] if name == "cloud.ply" else ["--camera", str(place / "camera.json")]
    return ["locate", str(place / name), *camera, *more]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", ["frame.png", "frame.npy", "cloud.ply"])
def test_every_format_gives_the_pose(place: Path, name: str, method: str, capsys: Shown) -> None:
    code, document = answer([*arguments(place, name), "--method", method], capsys)
    assert code == 0
    assert document["schema"] == "siloscope.estimate/1"
    assert (document["status"], document["method"]) == ("ok", method)
    found = [document[name] for name in ("r_x", "r_y", "t_x", "t_y")]
    truth = [TRUTH.r_x, TRUTH.r_y, TRUTH.t_x, TRUTH.t_y]
    assert np.abs(np.subtract(found, truth)).max() < 2e-3
    assert np.array(document["T_silo_camera"]).shape == (4, 4)


def test_text_for_people_has_degrees_and_millimetres(place: Path, capsys: Shown) -> None:
    assert main(arguments(place, "frame.npy")) == 0
    text = capsys.readouterr().out
    assert "80" in text
    assert "mm" in text
    assert "°" in text
    assert "radius" in text


def test_out_has_cloud_document_and_pictures(place: Path, tmp_path: Path, capsys: Shown) -> None:
    out = tmp_path / "deep" / "result"
    code, document = answer([*arguments(place, "frame.npy"), "--out", str(out)], capsys)
    assert code == 0
    assert json.loads((out / "estimate.json").read_text()) == document
    assert (out / "adjusted.ply").read_bytes().startswith(b"ply")
    for name in ("overview", "depth", "clouds", "candidates", "directions", "profile"):
        with Image.open(out / f"{name}.png") as image:
            assert min(image.size) > 300


def test_adjusted_cloud_stands_upright_on_the_axis(place: Path, tmp_path: Path, capsys: Shown) -> None:
    assert main([*arguments(place, "frame.npy"), "--out", str(tmp_path)]) == 0
    with siloscope.open(tmp_path / "adjusted.ply") as frames:
        points = frames[0].points
    assert points is not None
    wall = points[points[:, 2] < 4.0]
    assert np.abs(np.hypot(wall[:, 0], wall[:, 1]) - 1.25).max() < 5e-3


@pytest.mark.parametrize("kind", ["mask", "crop"])
def test_part_of_the_frame(place: Path, tmp_path: Path, kind: str, capsys: Shown) -> None:
    chosen = np.zeros((480, 640), np.uint8)
    chosen[:, :500] = 255
    Image.fromarray(chosen).save(tmp_path / "mask.png")
    more = {"mask": ["--mask", str(tmp_path / "mask.png")], "crop": ["--crop=-2,2,-2,2,1,5.2"]}[kind]
    code, document = answer([*arguments(place, "frame.npy"), *more], capsys)
    assert code == 0
    assert document["t_x"] == pytest.approx(TRUTH.t_x, abs=5e-3)


def test_profile_stands_in_for_a_missing_camera(place: Path, tmp_path: Path, capsys: Shown) -> None:
    alone = tmp_path / "alone.npy"
    alone.write_bytes((place / "frame.npy").read_bytes())
    code, document = answer(["locate", str(alone), "--sensor", "orbbec-astra-s", "--out", str(tmp_path / "o")], capsys)
    assert code == 0
    assert document["config"]["camera"]["fx"] == pytest.approx(570.3, abs=1.0)
    assert (tmp_path / "o" / "clouds.png").exists()


@pytest.mark.parametrize(
    ("parts", "options"),
    [
        (
            ("pcl_mug_cylinder", "table_scene_mug_stereo_textured.pcd"),
            ["--crop=0.005,0.105,0.03,0.11,0.70,0.80", "--grid", "0.003"],
        ),
        (("mosd_kinect_cylindric", "learn36.pcd"), ["--label", "43", "--grid", "0.004"]),
        (("tank_total_station", "scan.csv"), []),
    ],
    ids=lambda value: value[0] if isinstance(value, tuple) else "",
)
def test_real_surfaces_of_revolution(parts: tuple[str, str], options: list[str], tmp_path: Path, capsys: Shown) -> None:
    file = str(realdata.path(*parts))
    code, document = answer(["locate", file, *options, "--out", str(tmp_path)], capsys)
    assert code == 0
    axis, point = (np.array(document["axis"][name]) for name in ("direction", "point"))
    reference = REFERENCES[parts[0]]
    sine = np.linalg.norm(np.cross(axis, reference["axis"])) / np.linalg.norm(reference["axis"])
    assert np.degrees(np.arcsin(sine)) < reference["degrees"]
    if "radius" in reference:
        assert document["silo"]["radius"] == pytest.approx(reference["radius"], abs=reference["radius_within"])
    if "point" in reference:
        assert np.linalg.norm(np.cross(np.subtract(reference["point"], point), axis)) < reference["point_within"]
    assert (tmp_path / "profile.png").exists()


REFERENCES: dict[str, dict[str, Any]] = {
    "pcl_mug_cylinder": {
        "axis": (-0.0135876, 0.834831, 0.550338),
        "degrees": 2.0,
        "point": (0.0543319, 0.100139, 0.787577),
        "point_within": 5e-3,
        "radius": 0.0387446,
        "radius_within": 3e-3,
    },
    "mosd_kinect_cylindric": {"axis": (0.0014, -0.8243, -0.5661), "degrees": 4.0},
    "tank_total_station": {
        "axis": (0.0, 0.0, 1.0),
        "degrees": 1.0,
        "point": (37.350, 25.713, 0.0),
        "point_within": 0.05,
        "radius": 7.585,
        "radius_within": 0.02,
    },
}
"""What others found, as the recordings' own notes have it."""


def flat_wall(path: Path) -> None:
    camera = scenario("silo1").camera
    noise = np.random.default_rng(0).normal(0, 1e-3, (camera.height, camera.width))
    write_npy(path, (2.0 + noise).astype(np.float32))


def test_refusal_is_exit_4_with_reason_and_no_numbers(place: Path, tmp_path: Path, capsys: Shown) -> None:
    flat_wall(tmp_path / "wall.npy")
    given = ["locate", str(tmp_path / "wall.npy"), "--camera", str(place / "camera.json")]
    code, document = answer([*given, "--out", str(tmp_path / "out")], capsys)
    assert code == 4
    assert document["status"] == "refused"
    assert document["reason"]
    assert len(document["message"].split()) > 5
    assert [document[name] for name in ("r_x", "r_y", "t_x", "t_y", "T_silo_camera")] == [None] * 5
    assert document["std"] == dict.fromkeys(("r_x", "r_y", "t_x", "t_y"))
    assert (tmp_path / "out" / "estimate.json").exists()
    assert not (tmp_path / "out" / "adjusted.ply").exists()
    assert main(given) == 4
    assert document["message"] in capsys.readouterr().out


def camera_json(**changes: Any) -> Callable[[Path], object]:
    fields = {"width": 640, "height": 480, "fx": 570.3, "fy": 570.3, "cx": 319.5, "cy": 239.5} | changes
    return lambda path: path.write_text(json.dumps(fields))


BAD_FRAMES: dict[str, Callable[[Path], object]] = {
    "missing": lambda path: None,
    "empty": lambda path: path.write_bytes(b""),
    "folder without frames": lambda path: path.mkdir(),
    "text": lambda path: path.write_text("This is no depth frame.\n"),
    "random bytes": lambda path: path.write_bytes(np.random.default_rng(0).bytes(5000)),
    "png cut off": lambda path: path.write_bytes(cut_off_png()),
    "png corrupted": lambda path: path.write_bytes(corrupted_png()),
    "png of 8 bits": lambda path: path.write_bytes(png_bytes(np.zeros((480, 640), np.uint8))),
    "png of colours": lambda path: path.write_bytes(png_bytes(np.zeros((480, 640, 3), np.uint8))),
    "png of another size": lambda path: path.write_bytes(png_bytes(np.full((240, 320), 900, np.uint16))),
    "png declares a huge size": lambda path: path.write_bytes(huge_png()),
    "array of objects": lambda path: np.save(path.open("wb"), np.array([[{}]], object), allow_pickle=True),
    "array of text": lambda path: np.save(path.open("wb"), np.array([["a"]])),
    "array of complex numbers": lambda path: np.save(path.open("wb"), np.ones((480, 640), complex)),
    "array of four dimensions": lambda path: np.save(path.open("wb"), np.ones((2, 3, 4, 5))),
    "array of another size": lambda path: np.save(path.open("wb"), np.ones((10, 10))),
    "array cut off": lambda path: path.write_bytes(array_bytes(np.ones((480, 640)))[:5000]),
    "array declares a huge size": lambda path: path.write_bytes(huge_array()),
    "all invalid": lambda path: np.save(path.open("wb"), np.full((480, 640), np.nan)),
    "all zero": lambda path: path.write_bytes(png_bytes(np.zeros((480, 640), np.uint16))),
    "ply without points": lambda path: path.write_text(PLY.format(0)),
    "ply declares a huge size": lambda path: path.write_text(PLY.format(10**12)),
}
PLY = "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nend_header\n"

BAD_CAMERAS: dict[str, Callable[[Path], object]] = {
    "missing": lambda path: None,
    "empty": lambda path: path.write_text(""),
    "not JSON": lambda path: path.write_text("{fx:"),
    "binary": lambda path: path.write_bytes(bytes(range(256))),
    "fx is NaN": lambda path: path.write_text('{"width":640,"height":480,"fx":NaN,"fy":570,"cx":319,"cy":239}'),
    "fx is zero": camera_json(fx=0.0),
    "fx is negative": camera_json(fx=-570.3),
    "fx is text": camera_json(fx="wide"),
    "fx is missing": lambda path: path.write_text('{"width":640,"height":480,"fy":570,"cx":319,"cy":239}'),
    "another size": camera_json(width=1280, height=720),
    "size is zero": camera_json(width=0),
    "unknown distortion": camera_json(distortion_model="fun_house"),
    "endless distortion": lambda path: path.write_text(
        json.dumps({"width": 640, "height": 480, "fx": 570.0, "fy": 570.0, "cx": 319.5, "cy": 239.5})[:-1]
        + ', "distortion_model": "plumb_bob", "distortion": [1e308, 1e308, 0, 0, 1e308]}'
    ),
}

BAD_OPTIONS: dict[str, list[str]] = {
    "unit is zero": ["--depth-unit", "0"],
    "unit is negative": ["--depth-unit", "-0.001"],
    "unit is NaN": ["--depth-unit", "nan"],
    "unit is huge": ["--depth-unit", "1e9"],
    "unit is text": ["--depth-unit", "millimetres"],
    "grid is zero": ["--grid", "0", "--method", "shape-tensor"],
    "grid is negative": ["--grid", "-1", "--method", "shape-tensor"],
    "grid is tiny": ["--grid", "1e-300", "--method", "shape-tensor"],
    "grid is NaN": ["--grid", "nan", "--method", "shape-tensor"],
    "neighbours are too few": ["--neighbours", "2", "--method", "shape-tensor"],
    "neighbours are too many": ["--neighbours", "100000000", "--method", "shape-tensor"],
    "diameter is zero": ["--diameter", "0"],
    "diameter is negative": ["--diameter", "-2"],
    "diameter is NaN": ["--diameter", "nan"],
    "unknown method": ["--method", "magic"],
    "unknown sensor": ["--sensor", "my-own-eye"],
    "sensor file is no profile": ["--sensor", __file__],
    "gravity is zero": ["--gravity", "0,0,0"],
    "gravity is two numbers": ["--gravity", "0,1"],
    "gravity is text": ["--gravity", "down"],
    "crop is five numbers": ["--crop", "0,1,0,1,0"],
    "crop is inside out": ["--crop", "1,0,0,1,0,1"],
    "crop is empty": ["--crop", "100,101,100,101,100,101"],
    "mask is missing": ["--mask", "no-such-mask.png"],
    "label of a file without": ["--label", "3"],
    "frame is past the end": ["--frame", "7"],
    "frame is negative": ["--frame", "-1"],
    "threads are zero": ["--threads", "0"],
    "unknown option": ["--colour", "red"],
    "out is a file": ["--out", __file__],
}
NOT_IN_THE_FILES = (
    *("sensor file is no profile", "crop is empty", "mask is missing", "label of a file without"),
    "frame is past the end",
)
"""Options that only the files show to be wrong: exit code 3."""


def png_bytes(array: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(array).save(buffer, "PNG")
    return buffer.getvalue()


def array_bytes(array: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def noisy_png() -> bytes:
    return png_bytes(np.random.default_rng(0).integers(500, 5000, (480, 640)).astype(np.uint16))


def cut_off_png() -> bytes:
    whole = noisy_png()
    return whole[: len(whole) // 3]


def corrupted_png() -> bytes:
    data = bytearray(noisy_png())
    data[2000:2100] = bytes(100)
    return bytes(data)


def huge_png() -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", 2**31 - 1, 2**31 - 1, 16, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(b"")) + chunk(b"IEND", b"")


def huge_array() -> bytes:
    return array_bytes(np.ones((480, 640))).replace(b"(480, 640)", b"(4800000, 6400000)".ljust(10))


def assert_one_sentence(code: int, shown: Shown, wanted: tuple[int, ...], names: str = "") -> None:
    """The exit code, one line on stderr that names the culprit and says what to do, and the same as a document."""
    captured = shown.readouterr()
    assert code in wanted, captured.err
    lines = [line for line in captured.err.splitlines() if not line.startswith("warning: ")]
    assert len(lines) == 1, captured.err
    assert lines[0].startswith("error: ")
    assert "Traceback" not in captured.err
    assert names in lines[0]
    assert len(lines[0].split()) >= 6, "a sentence, not a word"
    document = json.loads(captured.out)
    assert document["schema"] == "siloscope.error/1"
    assert document["exit_code"] == code


@pytest.mark.parametrize("kind", BAD_FRAMES)
def test_bad_frames(place: Path, tmp_path: Path, kind: str, capsys: Shown) -> None:
    path = tmp_path / "my-frame"
    BAD_FRAMES[kind](path)
    given = ["locate", str(path), "--camera", str(place / "camera.json"), "--depth-unit", "0.001", "--json"]
    assert_one_sentence(main(given), capsys, (3,), "my-frame")


@pytest.mark.parametrize("name", ["[/b].npy", "[bold]x.npy", "$\\frac$.npy", os.fsdecode(b"\xff\xfe.npy")])
def test_any_name_of_a_file_is_told_and_drawn(name: str, place: Path, tmp_path: Path, capsys: Shown) -> None:
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    path.write_bytes((place / "frame.npy").read_bytes())
    given = [str(path), "--camera", str(place / "camera.json"), "--out", str(tmp_path / "out")]
    shown = printable(name)
    for command in ("locate", "measure"):
        assert main([command, *given]) == 0
        assert shown in capsys.readouterr().out
    calibration = str(tmp_path / name.replace("npy", "json"))
    assert main(["calibrate", str(path), *given[1:3], "-o", calibration]) == 0
    assert main(["track", str(path), *given[1:], "--calibration", calibration]) == 0
    assert shown in capsys.readouterr().out
    assert shown in (tmp_path / "out" / "readings.csv").read_text("utf-8")


@pytest.mark.parametrize("kind", BAD_CAMERAS)
def test_bad_cameras(place: Path, tmp_path: Path, kind: str, capsys: Shown) -> None:
    path = tmp_path / "my-camera.json"
    BAD_CAMERAS[kind](path)
    given = ["locate", str(place / "frame.npy"), "--camera", str(path), "--json"]
    assert_one_sentence(
        main(given), capsys, (3,), "frame.npy" if kind in ("another size", "endless distortion") else "my-camera.json"
    )


@pytest.mark.parametrize("kind", BAD_OPTIONS)
def test_bad_options(place: Path, kind: str, capsys: Shown) -> None:
    given = [*arguments(place, "frame.npy"), *BAD_OPTIONS[kind], "--json"]
    assert_one_sentence(main(given), capsys, (3,) if kind in NOT_IN_THE_FILES else (2,))


def test_raw_depth_without_unit(place: Path, capsys: Shown) -> None:
    given = ["locate", str(place / "frame.png"), "--camera", str(place / "camera.json"), "--json"]
    assert_one_sentence(main(given), capsys, (3,), "--depth-unit")


def test_image_without_camera(place: Path, tmp_path: Path, capsys: Shown) -> None:
    path = tmp_path / "alone.npy"
    path.write_bytes((place / "frame.npy").read_bytes())
    assert_one_sentence(main(["locate", str(path), "--json"]), capsys, (3,), "--camera")


def test_no_frame_at_all(capsys: Shown) -> None:
    assert_one_sentence(main(["locate", "--json"]), capsys, (2,), "FRAME")
