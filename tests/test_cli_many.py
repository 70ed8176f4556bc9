"""The command line with several files, folders, patterns, standard input, and results beside older ones."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path
from typing import Any

import pytest

import siloscope
from siloscope.cli import main, options
from siloscope.cli.inputs import expanded
from siloscope.errors import InputError, UsageError
from siloscope.io import writers

Captured = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three frames of a silo that is being emptied; the first, nearly full one has no answer."""
    out = tmp_path_factory.mktemp("many") / "frames"
    size = ["--width", "160", "--height", "120"]
    assert main(["simulate", "--scenario", "silo1", "--sensor", "d455", "--steps", "3", *size, "--out", str(out)]) == 0
    return out


def call(frames: Path, *files: str) -> list[str]:
    return [*files, "--camera", str(frames / "camera.json"), "--sensor", "realsense-d455"]


def lines(text: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in text.splitlines()]


@pytest.mark.parametrize("command", ["locate", "measure"])
def test_many_frames_give_a_line_each_however_they_are_named(command: str, frames: Path, capsys: Captured) -> None:
    capsys.readouterr()
    names = [f"frame_000{i}.png" for i in range(3)]
    ways = ([str(frames)], [str(frames / "frame_*.png")], [str(frames / name) for name in names])
    told = []
    for files in ways:
        assert main([command, *call(frames, *files), "--json"]) == 5
        told.append(lines(capsys.readouterr().out))
    assert [document["status"] for document in told[0]] == ["refused", "ok", "ok"]
    assert all(document["schema"] in ("siloscope.estimate/1", "siloscope.content/1") for document in told[0])
    for documents in told:
        assert [Path(document["frame"]).name.split(", ")[-1] for document in documents] == names
        assert [document["status"] for document in documents] == [document["status"] for document in told[0]]


def test_a_table_has_a_row_a_frame_with_its_reason(frames: Path, capsys: Captured) -> None:
    assert main(["locate", *call(frames, str(frames))]) == 5
    rows = capsys.readouterr().out.splitlines()
    assert len(rows) == 4
    assert "refused: no-wall" in rows[1]
    assert "±" in rows[2]
    assert main(["measure", *call(frames, str(frames)), "--product", "corn"]) == 5
    assert "bottom-unknown" in capsys.readouterr().out


def test_one_frame_of_several_and_the_first_of_a_recording_are_one_document(
    frames: Path, tmp_path: Path, capsys: Captured
) -> None:
    assert main(["locate", *call(frames, str(frames)), "--frame", "1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["status"] == "ok"
    archive = tmp_path / "day.zarr"
    assert main(["convert", str(frames), "-o", str(archive)]) == 0
    assert main(["locate", str(archive), "--sensor", "realsense-d455", "--json"]) == 4
    assert json.loads(capsys.readouterr().out)["reason"] == "no-wall"
    assert main(["locate", str(archive), "--sensor", "realsense-d455", "--all", "--json"]) == 5
    assert len(lines(capsys.readouterr().out)) == 3


def test_frames_that_can_not_be_read_are_told_and_no_frame_with_an_answer_is_code_4(
    frames: Path, tmp_path: Path, capsys: Captured
) -> None:
    (tmp_path / "broken.png").write_bytes((frames / "frame_0001.png").read_bytes()[:900])
    assert main(["locate", *call(frames, str(frames / "frame_0001.png"), str(tmp_path / "broken.png"))]) == 5
    assert "broken.png" in capsys.readouterr().err
    first = str(frames / "frame_0000.png")
    assert main(["locate", *call(frames, first, first)]) == 4


def test_standard_input_is_any_frame(frames: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured) -> None:
    class Stdin:
        buffer = io.BytesIO((frames / "frame_0001.png").read_bytes())

    monkeypatch.setattr(sys, "stdin", Stdin())
    assert main(["locate", *call(frames, "-")]) == 0
    assert capsys.readouterr().out.startswith("ok      standard-input:")


def test_patterns_that_match_nothing_and_files_with_such_names(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="matches no file"):
        expanded([tmp_path / "*.png"])
    odd = tmp_path / "frame[1].png"
    odd.touch()
    assert expanded([odd]) == [odd]


@pytest.mark.parametrize(("command", "document"), [("locate", "estimate"), ("measure", "content")])
def test_no_older_result_stays_beside_a_refusal(command: str, document: str, frames: Path, tmp_path: Path) -> None:
    out = tmp_path / "result"
    (out / "mine.txt").parent.mkdir()
    (out / "mine.txt").write_text("not ours")
    assert main([command, *call(frames, str(frames / "frame_0001.png")), "--out", str(out)]) == 0
    assert len(list(out.iterdir())) > 3
    assert main([command, *call(frames, str(frames / "frame_0000.png")), "--out", str(out)]) == 4
    left = {path.name for path in out.iterdir()}
    assert left <= {f"{document}.json", "depth.png", "mine.txt"}
    assert json.loads((out / f"{document}.json").read_text())["status"] == "refused"
    assert "mine.txt" in left


def test_an_interrupted_simulation_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written = writers.write_png

    def interrupted(path: Path, depth: Any) -> None:
        if path.name == "frame_0001.png":
            raise KeyboardInterrupt
        written(path, depth)

    monkeypatch.setattr(writers, "write_png", interrupted)
    size = ["--width", "80", "--height", "60"]
    assert main(["simulate", "--steps", "3", *size, "--out", str(tmp_path / "set")]) == 130
    assert list(tmp_path.iterdir()) == []


def test_the_bare_name_prints_the_help(capsys: Captured) -> None:
    assert main([]) == 0
    assert "Usage: siloscope" in capsys.readouterr().out


@pytest.mark.parametrize(("text", "value"), [("90", 90.0), ("15min", 900.0), ("1h", 3600.0), ("1.5 d", 129_600.0)])
def test_durations_have_units(text: str, value: float) -> None:
    assert options.seconds(text, "--interval") == value


@pytest.mark.parametrize("text", ["", "h", "-1h", "1 fortnight", "1:30"])
def test_durations_that_are_none_are_refused(text: str) -> None:
    with pytest.raises(UsageError, match="interval"):
        options.seconds(text, "--interval")


@pytest.mark.parametrize(("alias", "name"), [("corn", "maize"), ("Soya", "soybeans"), ("soybean_meal", "soybean-meal")])
def test_products_have_other_names(alias: str, name: str) -> None:
    assert siloscope.content.density.load(alias) == siloscope.content.products()[name]


@pytest.mark.parametrize("width", [40, 60, 100])
def test_help_keeps_to_the_width(width: int, monkeypatch: pytest.MonkeyPatch, capsys: Captured) -> None:
    monkeypatch.setenv("TERMINAL_WIDTH", str(width))
    monkeypatch.setenv("COLUMNS", str(width))
    assert main(["locate", "--help"]) == 0
    assert max(map(len, capsys.readouterr().out.splitlines())) <= width
