"""``siloscope demo``: the report is written, says what was measured, and the frame beside it can be located again."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from siloscope import Calibration
from siloscope.cli import main
from siloscope.reporting.demo import METHODS, SCENE, scenes

Done = tuple[Path, dict[str, Any]]
"""Folder and document of a demo."""


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Done:
    import contextlib
    import io

    out = tmp_path_factory.mktemp("demo") / "new" / "place"
    shown = io.StringIO()
    with contextlib.redirect_stdout(shown):
        assert main(["demo", "--out", str(out), "--steps", "4", "--json"]) == 0
    return out, json.loads(shown.getvalue())


def test_discharge_runs_from_full_to_empty() -> None:
    levels = [scene.feed.level for scene in scenes(5) if scene.feed]
    assert levels == sorted(levels, reverse=True)
    assert levels[0] > 0.9
    assert levels[-1] < 0.1
    assert len({scene.seed for scene in scenes(5)}) == 5, "each frame has its own noise"


def test_document_has_every_frame_and_method(done: Done) -> None:
    _, document = done
    assert document["schema"] == "siloscope.demo/1"
    assert len(document["frames"]) == 4
    for frame in document["frames"]:
        assert set(frame["methods"]) == set(METHODS)


def test_full_silo_is_refused_and_empty_one_is_found_to_a_millimetre(done: Done) -> None:
    first, last = (done[1]["frames"][i]["methods"]["surface"] for i in (0, -1))
    assert first["estimate"]["status"] == "refused"
    assert first["pc_average_distance_m"] is None
    assert last["estimate"]["status"] == "ok"
    assert last["pc_average_distance_m"] < 1e-3


def test_the_content_of_every_frame_is_measured(done: Done) -> None:
    truth = [frame["truth"]["content"]["volume"] for frame in done[1]["frames"]]
    found = [content["volume_m3"] for content in done[1]["contents"]]
    capacity = done[1]["contents"][-1]["capacity_m3"]
    for volume, true in zip(found[1:], truth[1:], strict=True):
        assert volume == pytest.approx(true, abs=5e-3 * capacity)


def test_page_is_whole_and_alone(done: Done) -> None:
    html = (done[0] / "report.html").read_text("utf-8")
    assert html.count("data:image/png;base64,") == 9
    assert len(html) < 5_000_000
    words = re.sub(r"data:image/png;base64,[A-Za-z0-9+/=]+", "", html)
    assert "http" not in words
    assert "nan" not in words


def test_frame_beside_the_page_is_located_again(done: Done, capsys: pytest.CaptureFixture[str]) -> None:
    out = done[0]
    given = ["locate", str(out / "frame.png"), "--camera", str(out / "camera.json"), "--sensor", "orbbec-astra-s"]
    assert main([*given, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    found = np.array([document[name] for name in ("t_x", "t_y")])
    assert np.abs(found - [SCENE.pose.t_x, SCENE.pose.t_y]).max() < 1e-3


def test_place_that_cannot_be_written_is_wrong_usage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("")
    assert main(["demo", "--out", str(tmp_path / "file"), "--steps", "1"]) == 2
    assert str(tmp_path / "file") in capsys.readouterr().err


def test_its_calibration_can_be_continued(done: Done, tmp_path: Path) -> None:
    frame, calibration = str(done[0] / "frame.png"), str(done[0] / "calibration.json")
    assert main(["calibrate", frame, "--continue", calibration, "-o", str(tmp_path / "silo.json")]) == 0
    before = Calibration.load(calibration).counts["used"]
    assert before >= 2
    assert Calibration.load(tmp_path / "silo.json").counts["used"] == before + 1


@pytest.mark.parametrize("steps", [1, 2, 3])
def test_a_discharge_with_hardly_an_answer_has_a_page_too(steps: int, tmp_path: Path) -> None:
    assert main(["demo", "--out", str(tmp_path), "--steps", str(steps)]) == 0
    assert "refused" in (tmp_path / "report.html").read_text("utf-8")
