"""Vessels other than a cylinder on a coaxial cone, on scenes of the independent oracle: answered truly or refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import siloscope
from oracle.cameras import Pose
from oracle.judging import Verdict, judge
from oracle.store import Sample, single
from siloscope.types.intrinsics import CALIBRATED

KINDS = ("control", "oblique", "oblique_small", "flat_empty", "flat_ring", "funnel_aside", "oblique_cone_mostly")
"""A plain silo, and kinds in which a cylinder on a coaxial cone would be sure of a wrong axis."""
SEEDS = range(100, 103)


def true_camera(taken: Sample) -> siloscope.Camera:
    told = dict(taken.truth["true"])
    k1 = told.pop("k1")
    return siloscope.Camera(**told, distortion_model="brown_conrady", distortion=(k1, 0, 0, 0, 0))


def answered(folder: Path, kind: str, seed: int, **known: Any) -> tuple[Verdict, dict[str, Any]]:
    taken = single(folder, kind, seed, 320)
    depth = taken.depth.astype(np.float32) * 1e-3
    told = {"sensor": taken.truth["sensor"], "intrinsics": "exact", **known}
    answer = siloscope.locate(depth, true_camera(taken), **told).to_dict()
    return judge(answer, taken.truth), answer


@pytest.fixture(scope="module")
def population(tmp_path_factory: pytest.TempPathFactory) -> list[Verdict]:
    folder = tmp_path_factory.mktemp("oracle")
    return [answered(folder, kind, seed)[0] for kind in KINDS for seed in SEEDS]


def test_no_answer_is_wrong_and_sure(population: list[Verdict]) -> None:
    """A fit of a cylinder on a coaxial cone alone was sure and wrong in at least 3 of these frames."""
    assert sum(verdict.wrong for verdict in population) == 0


def test_most_frames_are_answered_within_their_deviations(population: list[Verdict]) -> None:
    within = float(np.mean([abs(z) < 2.0 for verdict in population if verdict.answered for z in verdict.z]))
    assert sum(verdict.answered for verdict in population) >= 0.6 * len(population)
    assert within > 0.8


def test_models_have_probabilities_and_deviations_without_what_frames_share(tmp_path: Path) -> None:
    _, answer = answered(tmp_path, "oblique", 101)
    models = answer["models"]
    assert isinstance(models, list)
    assert sum(model["probability"] for model in models) == pytest.approx(1.0, abs=1e-6)
    assert models[0]["model"] in {"oblique-cone", "free-cone"}


def test_told_intrinsics_widen_the_deviations_but_not_the_relative_ones(tmp_path: Path) -> None:
    taken = single(tmp_path, "control", 100, 320)
    camera = true_camera(taken)
    depth = taken.depth.astype(np.float32) * 1e-3
    exact, usual = (
        siloscope.locate(depth, camera, sensor=taken.truth["sensor"], intrinsics=of).to_dict()
        for of in ("exact", "calibrated")
    )
    assert usual["std"]["r_y"] > 2.0 * exact["std"]["r_y"]
    assert usual["std_relative"]["r_y"] < 0.5 * usual["std"]["r_y"]
    assert usual["std"]["r_y"] < 2.0 * CALIBRATED.c / camera.fx


def down(kind: str, seed: int, folder: Path) -> np.ndarray:
    """Gravity's direction in the camera frame."""
    rotation: np.ndarray = Pose(**single(folder, kind, seed, 320).truth["pose"]).rotation
    return np.asarray(rotation[2])


@pytest.mark.parametrize("kind", ["horizon", "tank"])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_bare_cylinder_that_is_seen_from_aside_may_be_upside_down(kind: str, seed: int, tmp_path: Path) -> None:
    verdict, answer = answered(tmp_path, kind, seed)
    assert verdict.reason == "end-unknown"
    assert "give gravity" in str(answer["message"])


@pytest.mark.parametrize("seed", SEEDS)
def test_gravity_tells_which_end_of_a_bare_cylinder_is_down(seed: int, tmp_path: Path) -> None:
    gravity = down("tilted", seed, tmp_path)
    verdict, _ = answered(tmp_path, "tilted", seed, gravity=gravity)
    assert verdict.answered
    assert not verdict.wrong


def test_gravity_out_of_the_cameras_back_is_no_pose(tmp_path: Path) -> None:
    taken = single(tmp_path, "horizon", 100, 320)
    camera = true_camera(taken)
    gravity = down("horizon", 100, tmp_path)
    frame = siloscope.Frame(depth=taken.depth.astype(np.float32) * 1e-3, camera=camera, gravity=gravity)
    assert siloscope.locate(frame, sensor=taken.truth["sensor"]).reason == "above-horizon"


@pytest.mark.parametrize("kind", ["pyramid", "two_stage", "invalid", "narrow", "courses"])
def test_what_shows_enough_wall_is_answered(kind: str, tmp_path: Path) -> None:
    """Bottoms behind a cone, few pixels, a narrow view of curved wall, a stepped wall: each was refused once."""
    verdicts = [answered(tmp_path, kind, seed)[0] for seed in SEEDS]
    assert sum(verdict.answered for verdict in verdicts) >= 2
    assert not any(verdict.wrong for verdict in verdicts)


def test_only_a_silos_own_cone_is_called_its_bottom(tmp_path: Path) -> None:
    bottoms = {kind: answered(tmp_path, kind, 101)[1]["silo"]["bottom"] for kind in ("control", "oblique", "flat_ring")}
    cone = bottoms["control"]
    assert cone["kind"] == "cone"
    assert 0.0 < cone["cylinder_bottom"] < cone["apex"]
    assert cone["std"]["apex"] > 0.0
    assert {bottoms[kind]["kind"] for kind in ("oblique", "flat_ring")} == {"unknown"}
    assert bottoms["oblique"]["seen"] in {"oblique-cone", "free-cone"}
