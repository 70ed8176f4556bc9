"""What commands are told of a vessel by single options, against what frames show; units of text."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from siloscope.cli import main
from siloscope.content.units import BUSHEL, POUND

Captured = pytest.CaptureFixture[str]
SILO = {"--radius": "1.25", "--cylinder": "4.5", "--cone": "2"}
"""Of 58°: such a cone is no feed."""


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An empty silo with a steep cone, and two frames with feed; the camera hangs at the upper edge."""
    out = tmp_path_factory.mktemp("vessel") / "frames"
    shape = [part for pair in SILO.items() for part in pair]
    assert main(["simulate", *shape, "--sensor", "astra-s", "--steps", "3", "--out", str(out)]) == 0
    return out


def call(place: Path, *arguments: str) -> list[str]:
    return [*arguments, "--camera", str(place / "camera.json"), "--sensor", "orbbec-astra-s"]


def told(place: Path, command: str, capsys: Captured, *options: str) -> list[dict[str, Any]]:
    """Remarks on a contradicted vessel."""
    file = str(place / "calibration.json")
    writes = ["-o", file] if command == "calibrate" else []
    assert main(call(place, command, str(place / "frame_0002.png"), *writes, *options, "--json")) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["silo"]["apex"] == pytest.approx(6.5, abs=0.02)
    return [remark for remark in document["quality"] if remark["code"] == "vessel-contradicted"]


RIGHT = (["--cone", "2"], ["--cylinder", "4.5", "--top", "0"], ["--bottom", "cone"], ["--cylinder", "9"])
WRONG = (["--cone", "1"], ["--cone", "0"], ["--bottom", "flat"], ["--cylinder", "4", "--top", "0"])


@pytest.mark.parametrize("command", ["locate", "calibrate"])
@pytest.mark.parametrize("options", [*RIGHT, *WRONG], ids=" ".join)
def test_lengths_that_frames_contradict_are_warned_of(
    command: str, options: list[str], place: Path, capsys: Captured
) -> None:
    capsys.readouterr()
    remarks = told(place, command, capsys, *options)
    assert len(remarks) == (options in WRONG)
    assert all(remark["severity"] == "warning" for remark in remarks)


def test_track_speaks_in_the_units_of_the_trade(place: Path, capsys: Captured) -> None:
    file = str(place / "calibration.json")
    frames = [str(place / f"frame_000{i}.png") for i in (1, 2)]
    assert main(call(place, "calibrate", *frames, "--bottom", "cone", "-o", file)) == 0
    story = call(place, "track", *frames, "--calibration", file, "--interval", "1h", "--density", "700")
    capsys.readouterr()
    assert main([*story, "--jsonl"]) == 0
    readings = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert main([*story, "--unit", "bu,lb"]) == 0
    head, *rows = capsys.readouterr().out.splitlines()
    assert "volume (bu)" in head
    assert "mass (lb)" in head
    volume = float(rows[0].split("start")[1].split("±")[0])
    assert volume == pytest.approx(readings[0]["volume_m3"] / BUSHEL, rel=1e-3)
    assert f"{readings[0]['mass_kg'] / POUND:.0f}" in rows[0]
