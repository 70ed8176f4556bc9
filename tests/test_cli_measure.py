"""``siloscope measure`` and ``siloscope track`` from outside: answers, files, refusals, bad input."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from silos import known, noisy, scene
from siloscope.cli import main
from siloscope.io.writers import write_camera, write_npy, write_png
from siloscope.simulation import Feed

Shown = pytest.CaptureFixture[str]
MADE = noisy(scene(Feed("mound", 0.45)))
LEVELS = (0.6, 0.55, 0.5, 0.5, 0.65, 0.6)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A calibration, its camera, one frame in two formats, and the frames of a short story."""
    directory = tmp_path_factory.mktemp("measure")
    known(MADE).save(directory / "silo.json")
    write_camera(MADE.camera, directory / "camera.json")
    frame = MADE.render()
    write_npy(directory / "frame.npy", frame.measured.astype(np.float32))
    low = replace(MADE, feed=Feed("mound", 0.2)).render()
    write_png(directory / "low.png", low.raw(0.0005))
    write_npy(directory / "dark.npy", np.zeros(frame.depth.shape, np.float32))
    (directory / "story").mkdir()
    for i, level in enumerate(LEVELS):
        seen = replace(MADE, feed=Feed("mound", level), seed=i).render()
        write_npy(directory / "story" / f"{i}.npy", seen.measured.astype(np.float32))
    return directory


def run(arguments: list[str], shown: Shown) -> tuple[int, dict[str, Any]]:
    """Exit code and the one document on stdout."""
    code = main([*arguments, "--json"])
    return code, json.loads(shown.readouterr().out)


def with_silo(place: Path, *arguments: str) -> list[str]:
    return [*arguments, "--calibration", str(place / "silo.json"), "--camera", str(place / "camera.json")]


def test_the_document_has_what_the_contract_says(place: Path, capsys: Shown) -> None:
    command = with_silo(place, "measure", str(place / "frame.npy"), "--density", "650")
    code, document = run(command, capsys)
    truth = MADE.render()
    assert code == 0
    assert document["schema"] == "siloscope.content/1"
    assert document["status"] == "ok"
    assert document["volume_m3"] == pytest.approx(truth.true_volume, rel=2e-3)
    assert document["fill_fraction"] == pytest.approx(truth.fill_fraction, abs=1e-3)
    assert document["free_m3"] == pytest.approx(document["capacity_m3"] - document["volume_m3"])
    assert document["mass_kg"] == pytest.approx(650.0 * document["volume_m3"])
    assert document["level_m"].keys() >= {"mean", "min", "max", "at_axis"}
    assert 0.0 < document["coverage"] <= 1.0
    assert 0.0 < document["volume_std_m3"] < 0.01 * document["capacity_m3"]
    assert document["config"]["pose"]["t_x"] == pytest.approx(MADE.pose.t_x)


def test_raw_units_and_the_frame_alone(place: Path, capsys: Shown) -> None:
    raw = with_silo(place, "measure", str(place / "low.png"), "--depth-unit", "0.0005")
    code, by_calibration = run(raw, capsys)
    assert code == 0
    alone = ["measure", str(place / "low.png"), "--camera", str(place / "camera.json"), "--depth-unit", "0.0005"]
    code, by_itself = run([*alone, "--sensor", "orbbec-astra-s", "--bottom", "cone"], capsys)
    assert code == 0
    capacity = by_calibration["capacity_m3"]
    assert by_itself["volume_m3"] == pytest.approx(by_calibration["volume_m3"], abs=2e-3 * capacity)
    assert "without a calibration" in by_itself["assumed"][0]


def test_text_for_people(place: Path, capsys: Shown) -> None:
    assert main(with_silo(place, "measure", str(place / "frame.npy"), "--product", "wheat")) == 0
    text = capsys.readouterr().out
    for word in ("m³", "full" if "full" in text else "fill", "wheat", "mound", "over the cone's vertex"):
        assert word in text


def test_files(place: Path, tmp_path: Path, capsys: Shown) -> None:
    out = tmp_path / "reading"
    code, document = run(with_silo(place, "measure", str(place / "frame.npy"), "--out", str(out)), capsys)
    assert code == 0
    names = {"content.json", "surface.csv", "height-map.png", "surface.png", "section.png"}
    assert {file.name for file in out.iterdir()} == names
    assert json.loads((out / "content.json").read_text())["volume_m3"] == document["volume_m3"]
    rows = list(csv.DictReader((out / "surface.csv").open()))
    heights = np.array([float(row["height_m"]) for row in rows])
    assert heights.min() < document["level_m"]["mean"] < heights.max()
    assert all((out / name).read_bytes().startswith(b"\x89PNG") for name in names if name.endswith(".png"))


def test_a_dark_frame_has_no_answer(place: Path, capsys: Shown) -> None:
    code, document = run(with_silo(place, "measure", str(place / "dark.npy")), capsys)
    assert code == 4
    assert document["status"] == "refused"
    assert document["reason"] == "too-little-seen"
    assert document["volume_m3"] is None
    assert main(with_silo(place, "measure", str(place / "dark.npy"))) == 4
    assert "refused" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("more", "code"),
    [
        (["--product", "nothing-like-it"], 2),
        (["--density", "-4"], 2),
        (["--diameter", "9"], 2),
        (["--top", "9"], 2),
        (["--top", "nan"], 2),
        (["--top", "-1000"], 2),
        (["--outlet-diameter", "5"], 2),
        (["--strapping", "no.csv"], 3),
        (["--frame", "7"], 3),
        (["--sensor", "no-such-sensor"], 2),
    ],
)
def test_bad_settings(place: Path, capsys: Shown, more: list[str], code: int) -> None:
    assert main(with_silo(place, "measure", str(place / "frame.npy"), *more)) == code
    assert "error: " in capsys.readouterr().err


def test_a_damaged_calibration_is_named(place: Path, tmp_path: Path, capsys: Shown) -> None:
    bad = tmp_path / "bad.json"
    bad.write_text('{"schema": "siloscope.calibration/1"')
    assert main(["measure", str(place / "frame.npy"), "--calibration", str(bad)]) == 3
    assert "bad.json" in capsys.readouterr().err


def test_the_frame_before_tells_that_it_moves(place: Path, capsys: Shown) -> None:
    story = place / "story"
    command = with_silo(place, "measure", str(story / "1.npy"), "--previous", str(story / "0.npy"))
    _, document = run(command, capsys)
    assert "filling-in-progress" in [remark["code"] for remark in document["quality"]]


class TestTrack:
    def arguments(self, place: Path, *more: str) -> list[str]:
        return with_silo(place, "track", str(place / "story"), "--interval", "21600", *more)

    def test_events_flow_and_forecast(self, place: Path, capsys: Shown) -> None:
        start = ["--start", "2026-03-01T06:00Z", "--density", "650"]
        code, document = run(self.arguments(place, *start), capsys)
        assert code == 0
        assert document["schema"] == "siloscope.track/1"
        assert document["counts"] == {"ok": 6, "refused": 0, "unreadable": 0}
        readings = document["readings"]
        assert readings[0]["time_utc"] == "2026-03-01T06:00:00Z"
        assert readings[1]["flow_m3_h"] == pytest.approx((readings[1]["volume_m3"] - readings[0]["volume_m3"]) / 6.0)
        assert readings[1]["mass_flow_t_h"] == pytest.approx(0.65 * readings[1]["flow_m3_h"])
        kinds = [(event["kind"], event["first"], event["last"]) for event in document["events"]]
        assert kinds == [("withdrawal", 0, 2), ("refill", 3, 4), ("withdrawal", 4, 5)]
        truth = [replace(MADE, feed=Feed("mound", level)).render().true_volume for level in LEVELS]
        amounts = [event["volume_m3"] for event in document["events"]]
        expected = [truth[0] - truth[2], truth[4] - truth[3], truth[4] - truth[5]]
        assert amounts == pytest.approx(expected, rel=0.02)
        use = document["use"]
        assert use["daily_m3"] == pytest.approx((truth[0] - truth[2] + truth[4] - truth[5]) / 1.25, rel=0.03)
        assert use["earliest"] < use["empty_by"]
        assert use["latest"] is None or use["empty_by"] < use["latest"]

    def test_files(self, place: Path, tmp_path: Path, capsys: Shown) -> None:
        pytest.importorskip("pyarrow")
        import pyarrow.parquet

        out = tmp_path / "march"
        assert main(self.arguments(place, "--out", str(out), "--parquet")) == 0
        text = capsys.readouterr().out
        assert "withdrawal" in text
        assert "empty by" in text
        found = {file.name for file in out.iterdir()}
        assert found == {"track.json", "readings.csv", "readings.jsonl", "readings.parquet", "trend.png", "report.html"}
        rows = list(csv.DictReader((out / "readings.csv").open()))
        lines = [json.loads(line) for line in (out / "readings.jsonl").read_text().splitlines()]
        table = pyarrow.parquet.read_table(out / "readings.parquet").to_pylist()
        volumes = [line["volume_m3"] for line in lines]
        assert [float(row["volume_m3"]) for row in rows] == volumes == [row["volume_m3"] for row in table]
        page = (out / "report.html").read_text()
        assert "Refills and withdrawals" in page
        assert "data:image/png;base64" in page

    def test_json_lines(self, place: Path, capsys: Shown) -> None:
        assert main(self.arguments(place, "--jsonl")) == 0
        lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
        assert [line["index"] for line in lines] == list(range(6))

    def test_frames_without_an_answer_do_not_stop_the_story(self, place: Path, tmp_path: Path, capsys: Shown) -> None:
        story = tmp_path / "story"
        story.mkdir()
        for i in range(3):
            (story / f"{i}.npy").write_bytes((place / "story" / f"{i}.npy").read_bytes())
        (story / "3.npy").write_bytes((place / "dark.npy").read_bytes())
        code, document = run(with_silo(place, "track", str(story)), capsys)
        assert code == 5
        assert document["counts"]["refused"] == 1
        assert document["readings"][3]["reason"] == "too-little-seen"
        assert document["use"] is None
        for file in story.iterdir():
            file.write_bytes((place / "dark.npy").read_bytes())
        code, document = run(with_silo(place, "track", str(story)), capsys)
        assert code == 4
        assert document["status"] == "refused"

    def test_frames_that_can_not_be_used_at_all(self, place: Path, tmp_path: Path, capsys: Shown) -> None:
        write_npy(tmp_path / "0.npy", np.ones((40, 60), np.float32))
        assert main(with_silo(place, "track", str(tmp_path))) == 3
        assert "60 x 40" in capsys.readouterr().err

    @pytest.mark.parametrize("more", [["--interval", "-1"], ["--start", "tomorrow"], ["--parquet"]])
    def test_bad_settings(self, place: Path, capsys: Shown, more: list[str]) -> None:
        assert main(with_silo(place, "track", str(place / "story"), *more)) == 2
        assert "error: " in capsys.readouterr().err
