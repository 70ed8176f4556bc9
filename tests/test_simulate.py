"""``siloscope simulate``: what it writes is what it says, and what it can't do it says."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import siloscope
from siloscope.cli import main
from siloscope.io import camera_files
from siloscope.simulation import ASTRA_S, Feed, true_camera
from siloscope.simulation.scenarios import SILO2

SMALL = ["--width", "64", "--height", "48"]


def test_a_discharge_is_written_with_its_truth(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "discharge"
    options = ["--scenario", "silo2", "--steps", "4", "--sensor", "d455", "--labels", "--json", *SMALL]
    assert main(["simulate", "--out", str(out), *options]) == 0
    shown = capsys.readouterr()
    document = json.loads(shown.out)
    assert document == json.loads((out / "truth.json").read_text())
    assert document["schema"] == "siloscope.truth/1"
    assert [frame["feed"]["level"] for frame in document["frames"]] == pytest.approx([0.9, 0.6, 0.3, 0.0])
    assert document["frames"][-1]["volume_m3"] == 0.0
    assert math.isclose(document["frames"][0]["capacity_m3"], SILO2.silo.capacity)
    assert len({frame["seed"] for frame in document["frames"]}) == 4
    for frame in document["frames"]:
        raw = np.asarray(Image.open(out / frame["file"]))
        labels = np.asarray(Image.open(out / "labels" / frame["file"]))
        assert raw.dtype == np.uint16
        assert np.array_equal(raw > 0, labels > 0)
        seen = labels[labels > 0]
        assert math.isclose((seen == 1).mean(), frame["ratios"]["pixels"]["cylinder"], abs_tol=1e-12)


def test_the_reader_finds_camera_and_unit_and_reads_the_frames(tmp_path: Path) -> None:
    out = tmp_path / "frames"
    assert (
        main(["simulate", "--out", str(out), "--scenario", "silo2", "--sensor", "astra-s", "--steps", "2", *SMALL]) == 0
    )
    source = siloscope.open(out)
    camera = camera_files.load(out / "camera.json")
    assert (camera.width, camera.fx, camera.cx) == (64, pytest.approx(57.03), pytest.approx(31.5))
    read = list(source)
    assert len(read) == 2
    assert read[0].camera == camera
    assert read[0].depth_unit == 0.001
    scene = replace(SILO2, camera=camera, sensor=ASTRA_S, feed=Feed(level=0.9))
    exact = scene.render().depth
    error = read[0].depth * 0.001 - exact - ASTRA_S.bias_at(exact)
    assert abs(error.mean()) < 4 * 0.01 / 50


def test_exact_frames_are_the_rendered_float64(tmp_path: Path) -> None:
    out = tmp_path / "exact"
    pose = ["--pose", "0.01,-0.1,0.5,0.02", "--feed", "funnel+lumpy", "--level", "0.3", "--seed", "7"]
    assert main(["simulate", "--out", str(out), "--scenario", "silo2", "--exact", *pose, *SMALL]) == 0
    document = json.loads((out / "truth.json").read_text())
    assert document["frames"][0]["r_y"] == -0.1
    assert document["depth_unit"] is None
    camera = camera_files.load(out / "camera.json")
    expected = replace(SILO2, camera=camera, feed=Feed("funnel+lumpy", 0.3, seed=7), seed=7)
    expected = replace(expected, pose=type(SILO2.pose)(0.01, -0.1, 0.5, 0.02))
    assert np.array_equal(np.load(out / "frame_0000.npy"), expected.render().measured)


def test_own_silo_camera_and_defects(tmp_path: Path) -> None:
    out = tmp_path / "own"
    camera_files.dump(
        replace(SILO2.camera, width=80, height=60, fx=70.0, fy=70.0, cx=39.5, cy=29.5), tmp_path / "c.json"
    )
    silo = ["--radius", "1.1", "--cylinder", "2.5", "--cone", "1.4", "--outlet", "0.15", "--feed", "none"]
    silo += ["--outlet-offset", "0.1,-0.1"]
    more = ["--camera", str(tmp_path / "c.json"), "--fx", "75", "--defects", "corrugated,ladder", "--dropout", "0.3"]
    assert main(["simulate", "--out", str(out), *silo, *more, "--max-incidence", "80"]) == 0
    document = json.loads((out / "truth.json").read_text())
    assert document["frames"][0]["silo"] == {"radius": 1.1, "cylinder_bottom": 2.5, "apex": 3.9}
    assert document["scene"]["defects"]["corrugation_depth"] == 0.013
    assert document["scene"]["silo"]["outlet_offset"] == [0.1, -0.1]
    assert document["scene"]["camera"]["fx"] == 75.0
    raw = np.asarray(Image.open(out / "frame_0000.png"))
    assert raw.shape == (60, 80)
    assert 0.5 < (raw > 0).mean() < 0.72


@pytest.mark.parametrize(
    ("options", "cause"),
    [
        (["--scenario", "silo9"], "unknown scenario"),
        (["--pose", "1,2,3"], "4 numbers"),
        (["--pose", "a,b,c,d"], "4 numbers"),
        (["--pose", "nan,0,0,0"], "r_x"),
        (["--outlet-offset", "1"], "2 numbers"),
        (["--outlet-offset", "1.3,0"], "outlet_offset"),
        (["--pose", "0,0,9,0"], "inside the silo"),
        (["--feed", "sand"], "feed shape"),
        (["--level", "1.5"], "level"),
        (["--level", "nan"], "level"),
        (["--feed", "flat", "--level", "1.0"], "bury"),
        (["--steps", "0"], "steps"),
        (["--steps", "1000000000"], "steps"),
        (["--steps", "3", "--feed", "none"], "needs feed"),
        (["--sensor", "eye"], "unknown sensor"),
        (["--defects", "rust"], "unknown defect"),
        (["--dust", "2"], "dust"),
        (["--radius", "nan"], "radius"),
        (["--radius", "-1"], "radius"),
        (["--threads", "0"], "threads"),
        (["--seed", "-1"], "seed"),
        (["--depth-unit", "0"], "depth-unit"),
        (["--depth-unit", "0.00001"], "16 bits"),
        (["--width", "20000", "--height", "20000"], "megapixels"),
    ],
)
def test_what_can_t_be_is_exit_2_and_writes_nothing(
    options: list[str], cause: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["simulate", "--out", str(out), *options]) == 2
    shown = capsys.readouterr()
    assert cause in shown.err
    assert len(shown.err.splitlines()) == 1
    assert shown.out == ""
    assert not (out / "truth.json").exists()


@pytest.mark.parametrize("options", [["--width", "0"], ["--fx", "0"], ["--fx", "nan"], ["--camera", "no-such.json"]])
def test_unusable_cameras_are_exit_3(options: list[str], tmp_path: Path) -> None:
    assert main(["simulate", "--out", str(tmp_path / "out"), *options]) == 3


def test_a_folder_with_files_or_a_file_is_not_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "old.png").write_bytes(b"old")
    assert main(["simulate", "--out", str(tmp_path), *SMALL]) == 2
    assert "not empty" in capsys.readouterr().err
    assert main(["simulate", "--out", str(tmp_path / "old.png"), *SMALL]) == 2
    assert (tmp_path / "old.png").read_bytes() == b"old"


def test_the_camera_that_is_told_is_off_by_its_deviations(tmp_path: Path) -> None:
    out = tmp_path / "off"
    options = ["--intrinsics", "calibrated", "--seed", "3", "--multipath", "0.1", *SMALL]
    assert main(["simulate", "--out", str(out), "--scenario", "silo2", *options]) == 0
    told, scene = camera_files.load(out / "camera.json"), json.loads((out / "truth.json").read_text())["scene"]
    assert scene["told"]["fx"] == told.fx
    assert scene["camera"]["fx"] == true_camera(told, "calibrated", 3).fx != told.fx
    assert scene["sensor"]["multipath"] == 0.1
    assert main(["simulate", "--out", str(tmp_path / "no"), "--intrinsics", "guessed", *SMALL]) == 2


VESSEL = """
name = "bin 7"
diameter = 3.0
cylinder = 4.2
fill_height = 4.0
top = -0.1

[bottom]
{bottom}

[[course]]
bottom = 2.8
diameter = 3.01

[roof]
height = 0.7

[[obstacle]]
name = "beam"
start = [-1.4, 0.3, 2.2]
end = [1.4, 0.3, 2.2]
diameter = 0.1
"""


@pytest.mark.parametrize(
    ("bottom", "below"),
    [
        ('kind = "oblique"\nheight = 1.8\nvertex = [0.4, 0.1]\noutlet = 0.3', 1.8 / 3.0),
        ('kind = "two-stage"\nheight = 1.8\nupper = 0.8\nwaist = 1.2', (0.8 * (1.0 + 0.4 + 0.16) + 0.16) / 3.0),
        ('kind = "pyramid"\nheight = 1.8\nazimuth = 30', 1.8 * (1.0 - 4.0 * math.sqrt(2.0) / (3.0 * math.pi))),
        ('kind = "flat"', 0.0),
    ],
)
def test_a_vessel_is_read_from_its_file(tmp_path: Path, bottom: str, below: float) -> None:
    """Capacity and ullage are those of the datasheet, by formulas of their own."""
    file, out = tmp_path / "vessel.toml", tmp_path / "frames"
    file.write_text(VESSEL.format(bottom=bottom))
    options = ["--vessel", str(file), "--feed", "crater", "--level", "0.5", "--labels", *SMALL]
    assert main(["simulate", "--out", str(out), *options]) == 0
    document = json.loads((out / "truth.json").read_text())
    frame, labels = document["frames"][0], np.asarray(Image.open(out / "labels" / "frame_0000.png"))
    capacity = math.pi * (1.5**2 * (2.8 + below) + 1.505**2 * 1.4)
    assert frame["capacity_m3"] == pytest.approx(capacity, rel=1e-9)
    unfilled = math.pi * 1.505**2 * 0.2
    assert frame["ullage_m3"] == pytest.approx(capacity - unfilled - frame["volume_m3"], rel=1e-6)
    assert (labels == 4).any(), "the beam is in view"
    assert frame["silo"]["cylinder_bottom"] == pytest.approx(4.1)
    assert frame["silo"]["apex"] == (None if "flat" in bottom else pytest.approx(5.9))


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (("diameter = 3.0\n", ""), "diameter"),
        (('kind = "flat"', 'kind = "wedge"\nheight = 1.0'), "wedge"),
        (('kind = "flat"', 'kind = "cone"'), "height"),
        (("top = -0.1", "outline = [[0, 0], [1, 0], [1, 1]]"), "outline"),
    ],
)
def test_a_vessel_that_cannot_be_simulated_is_named(
    tmp_path: Path, change: tuple[str, str], named: str, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "vessel.toml"
    file.write_text(VESSEL.format(bottom='kind = "flat"').replace(*change))
    assert main(["simulate", "--out", str(tmp_path / "out"), "--vessel", str(file), *SMALL]) == 2
    assert named in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
