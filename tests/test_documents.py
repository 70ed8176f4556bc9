"""Documents are strictly JSON, whatever numbers a result holds."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

import siloscope
from siloscope.reporting.results import write_results
from siloscope.schema import documents
from siloscope.simulation.scenarios import scenario


def strict(text: str) -> object:
    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is no JSON")

    return json.loads(text, parse_constant=refuse)


def test_what_is_no_number_is_null(tmp_path: Path) -> None:
    document = {
        "a": float("nan"),
        1: np.array([1.0, -np.inf]),
        "c": (np.float32(2.0), np.int64(3), np.True_),
        "d": Path("x"),
    }
    expected = {"a": None, "1": [1.0, None], "c": [2.0, 3, True], "d": "x"}
    assert strict(documents.text(document)) == expected
    assert strict(documents.write(tmp_path / "a.json", document).read_text("utf-8")) == expected


def test_an_estimate_s_file_is_strict(tmp_path: Path) -> None:
    frame = scenario("silo1").render().frame()
    estimate = siloscope.locate(frame)
    odd = replace(estimate, extra={**estimate.extra, "fit": {"misfit": float("nan")}})
    write_results(tmp_path, frame, odd)
    assert strict((tmp_path / "estimate.json").read_text("utf-8"))["fit"] == {"misfit": None}  # type: ignore[index]
