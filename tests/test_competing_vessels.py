"""Vessels other than a cylinder on a coaxial cone, on scenes of the independent oracle: answered truly or refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import siloscope
from oracle.judging import Verdict, judge
from oracle.store import single
from siloscope.types.intrinsics import CALIBRATED

KINDS = ("control", "oblique", "oblique_small", "flat_empty", "flat_ring", "funnel_aside", "oblique_cone_mostly")
"""Two silos that the coaxial model has right, and kinds in which it is sure of a wrong axis."""
SEEDS = range(100, 103)


def answered(folder: Path, kind: str, seed: int, vessels: str) -> tuple[Verdict, dict[str, object]]:
    taken = single(folder, kind, seed, 320)
    told = {name: value for name, value in taken.truth["true"].items() if name != "k1"}
    depth = taken.depth.astype(np.float32) * 1e-3
    known = {"sensor": taken.truth["sensor"], "intrinsics": "exact", "vessels": vessels}
    answer = siloscope.locate(depth, siloscope.Camera(**told), **known).to_dict()
    return judge(answer, taken.truth), answer


@pytest.fixture(scope="module")
def population(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[Verdict]]:
    folder = tmp_path_factory.mktemp("oracle")
    return {
        vessels: [answered(folder, kind, seed, vessels)[0] for kind in KINDS for seed in SEEDS]
        for vessels in ("any", "coaxial")
    }


def test_no_answer_is_wrong_and_sure(population: dict[str, list[Verdict]]) -> None:
    assert sum(verdict.wrong for verdict in population["any"]) == 0
    assert sum(verdict.wrong for verdict in population["coaxial"]) >= 3  # these scenes can tell


def test_most_frames_are_answered_within_their_deviations(population: dict[str, list[Verdict]]) -> None:
    within = {
        vessels: float(np.mean([abs(z) < 2.0 for verdict in verdicts if verdict.answered for z in verdict.z]))
        for vessels, verdicts in population.items()
    }
    assert sum(verdict.answered for verdict in population["any"]) >= 0.6 * len(population["any"])
    assert within["any"] > max(0.8, within["coaxial"] + 0.1)


def test_models_have_probabilities_and_deviations_without_what_frames_share(tmp_path: Path) -> None:
    _, answer = answered(tmp_path, "oblique", 101, "any")
    models = answer["models"]
    assert isinstance(models, list)
    assert sum(model["probability"] for model in models) == pytest.approx(1.0, abs=1e-6)
    assert models[0]["model"] in {"oblique-cone", "free-cone"}
    assert "models" not in answered(tmp_path, "oblique", 101, "coaxial")[1]


def test_told_intrinsics_widen_the_deviations_but_not_the_relative_ones(tmp_path: Path) -> None:
    taken = single(tmp_path, "control", 100, 320)
    camera = siloscope.Camera(**{name: value for name, value in taken.truth["true"].items() if name != "k1"})
    depth = taken.depth.astype(np.float32) * 1e-3
    exact, usual = (
        siloscope.locate(depth, camera, sensor=taken.truth["sensor"], intrinsics=of).to_dict()
        for of in ("exact", "calibrated")
    )
    assert usual["std"]["r_y"] > 2.0 * exact["std"]["r_y"]
    assert usual["std_relative"]["r_y"] < 0.5 * usual["std"]["r_y"]
    assert usual["std"]["r_y"] < 2.0 * CALIBRATED.c / camera.fx
