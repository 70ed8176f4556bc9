"""Validation on a user's own frames: laws of its statistics, whom it convicts, what the command says."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from scipy import stats

from silos import SMALL, STOUT, scene
from siloscope import _core, sensors, validate
from siloscope.cli import main
from siloscope.errors import UsageError
from siloscope.estimation.priors import Priors
from siloscope.io import writers
from siloscope.simulation import ASTRA_S, Defects, Feed, Silo
from siloscope.types.camera import Camera
from siloscope.types.depth_frame import DepthFrame
from siloscope.types.frame import Frame
from siloscope.types.intrinsics import IntrinsicsStd
from siloscope.types.wall import INTERCEPT, RADIUS, SIZE, SLOPE, Wall
from siloscope.validation.families import patterns, score
from siloscope.validation.frames import MOST_FRAMES, Asked, SeenFrame, read
from siloscope.validation.ideal import Ideal, fitted
from siloscope.validation.levels import by_level
from siloscope.validation.significance import deviation
from siloscope.validation.tiles import against

SENSOR = replace(ASTRA_S, unit=1e-3)
LEVELS = (0.45, 0.4, 0.33, 0.27, 0.2, 0.15, 0.1, 0.05)
TALL = Silo(radius=1.25, cylinder_height=3.0, cone_height=1.6)
PROFILE = sensors.load("orbbec-astra-s")


@cache
def depths(bend: float = 0.0) -> tuple[np.ndarray, ...]:
    """A discharge seen by the paper's sensor: float32 metres."""
    wall = Defects(bend=bend, bend_azimuth=0.7) if bend else None
    made = []
    for seed, level in enumerate(LEVELS, 1):
        feed = Feed("flat", level, seed=seed)
        made.append(scene(feed, TALL, (0.5, 0.2), SENSOR, defects=wall, seed=seed).render().measured.astype(np.float32))
    return tuple(made)


def warped(depth: np.ndarray, by: float) -> np.ndarray:
    """With a relative error that is smooth over the image."""
    v, u = np.meshgrid(*(np.linspace(-1.0, 1.0, n) for n in depth.shape), indexing="ij")
    return (depth * (1.0 + by * np.cos(3.0 * u + 1.0) * np.sin(2.5 * v - 0.4))).astype(np.float32)


def validated(frames: Any, camera: Camera = SMALL, **more: Any) -> Any:
    return validate(frames, camera=camera, **{"sensor": PROFILE, "intrinsics": "exact", "resamples": 0, **more})


@cache
def seen() -> tuple[SeenFrame, ...]:
    asked = Asked.of(PROFILE, camera=SMALL, depth_unit=None, diameter=None, intrinsics="exact")
    return read(depths(), asked).seen


@cache
def ideal() -> Ideal:
    return fitted(seen())


@pytest.mark.parametrize("dof", [1, 5, 20, 60])
@pytest.mark.parametrize("other", [np.inf, 40.0, 200.0])
def test_a_deviation_is_as_rare_as_chi_square_or_fishers_f(dof: int, other: float) -> None:
    for wanted in (0.0, 1.0, 3.0):
        rare = stats.norm.sf(wanted)
        ratio = stats.chi2.isf(rare, dof) / dof if np.isinf(other) else stats.f.isf(rare, dof, other)
        assert abs(deviation(ratio * dof, dof, 1.0, other) - wanted) < (0.2 if dof > 1 else 0.35)


def test_deviations_of_white_noise_are_standard_normal() -> None:
    """Drawn anew on the same tiles: neither the fit nor the scatter from frame to frame makes them larger."""
    whole, draws = ideal(), np.random.default_rng(5)
    weight = 1.0 / np.sqrt(whole.tiles.variance)
    rows = whole.tiles.jacobian[:, whole.free] * weight[:, None]
    basis, found = patterns(whole)["image"], []
    for _ in range(60):
        noise = draws.standard_normal(len(weight))
        rest = noise - rows @ (whole.covariance @ (rows.T @ noise))
        found.append(score(replace(whole, tiles=replace(whole.tiles, residual=rest / weight)), basis).deviation)
    assert abs(np.mean(found)) < 0.45
    assert 0.7 < np.std(found) < 1.4
    assert max(found) < 3.5


def test_tiles_know_their_wall_and_how_it_moves_them() -> None:
    one, wall = seen()[-1], ideal().wall
    base = _core.wall_tiles(one.frame, one.priors, wall)
    draws = np.random.default_rng(2)
    for column in (0, 1, 2, 3, RADIUS, SLOPE, INTERCEPT, 7, 9, 11, RADIUS + 9, SLOPE + 8):
        step = np.zeros(SIZE)
        step[column] = 1e-6
        moved = [_core.wall_tiles(one.frame, one.priors, wall.moved(sign * step)) for sign in (1.0, -1.0)]
        both = np.intersect1d(np.intersect1d(base.number, moved[0].number), moved[1].number)
        chosen = draws.choice(both, 60)
        rows = [np.searchsorted(tiles.number, chosen) for tiles in (base, *moved)]
        numeric = (moved[0].residual[rows[1]] - moved[1].residual[rows[2]]) / 2e-6
        analytic = base.jacobian[rows[0], column]
        off = np.abs(numeric - analytic) / (1.0 + np.abs(analytic))
        assert np.median(off) < 1e-3, column
        assert np.quantile(off, 0.9) < 0.03, column  # over a tile, the mean of the derivative is not that at its centre


def test_a_wall_reads_what_the_ray_tracer_sees() -> None:
    made = scene(None, place=(0.5, 0.2))
    exact = np.asarray(made.render().depth)
    state = np.zeros(SIZE)
    state[:4] = [getattr(made.pose, name) for name in ("r_x", "r_y", "t_x", "t_y")]
    geometry = STOUT.geometry
    state[RADIUS] = geometry.radius
    state[SLOPE] = geometry.radius / (geometry.apex - geometry.cylinder_bottom)
    state[INTERCEPT] = state[SLOPE] * geometry.apex
    wall = Wall(state, True, True, geometry.cylinder_bottom)
    frame = DepthFrame(exact.astype(np.float32), SMALL, SMALL.rays())
    shown = exact > 0.0
    assert np.abs(_core.wall_readings(frame, wall) - exact)[shown].max() < 1e-9
    tiles = _core.wall_tiles(frame, Priors(PROFILE), wall)
    assert np.abs(np.median(tiles.residual)) < 1e-5


def test_what_the_core_can_not_take_is_refused() -> None:
    one = seen()[0]
    for state in (np.zeros(5), np.full(SIZE, np.nan)):
        with pytest.raises(ValueError, match="wall has"):
            _core.wall_tiles(one.frame, one.priors, Wall(state, True, False, 1.0))
    with pytest.raises(ValueError, match="cylinder or a cone"):
        _core.wall_readings(one.frame, Wall(np.zeros(SIZE), False, False, 1.0))


def test_frames_that_are_as_told_agree() -> None:
    found = validated(depths(), resamples=4)
    assert found.verdict == "agrees"
    assert found.findings == ()
    assert found.resampled.answers == 4
    assert all(scatter < 1.5 * found.resampled.stated[name] for name, scatter in found.resampled.scatter.items())
    assert {split.name for split in found.splits} == {
        "odd and even frames",
        "first and last half",
        "high and low level",
    }
    assert len(found.held_out) == len(LEVELS)
    assert all(0.7 < one.rms / one.expected < 1.3 for one in found.held_out)


@pytest.mark.parametrize(
    ("frames", "camera", "causes"),
    [
        ("warp", SMALL, {"image"}),
        ("clean", replace(SMALL, cx=SMALL.cx + 3.0), {"camera", "image"}),
        ("clean", replace(SMALL, fx=SMALL.fx * 1.005), {"camera", "image"}),
        ("bend", SMALL, {"bend", "rings", "oval"}),
    ],
)
def test_what_is_not_as_told_is_convicted_and_named(frames: str, camera: Camera, causes: set[str]) -> None:
    made = depths(0.004 if frames == "bend" else 0.0)
    if frames == "warp":
        made = tuple(warped(depth, 0.005) for depth in made)
    found = validated(made, camera)
    assert found.verdict == "departs"
    assert found.findings[0].code in causes
    assert found.findings[0].stated == (
        found.findings[0].code in {"bend", "rings", "oval"} >= {*found.findings[0].others}
    )


def test_a_principal_point_is_told_by_how_much_it_is_off() -> None:
    found = validated(depths(), replace(SMALL, cx=SMALL.cx + 3.0))
    off = found.tests["camera"]
    assert abs(-off.amplitudes[2] * SMALL.fx + 3.0) < 5.0 * off.std[2] * SMALL.fx + 0.3


def test_an_error_within_its_stated_deviation_is_none() -> None:
    """The calibration's deviations contain it; told as exact it is convicted (above)."""
    camera = replace(SMALL, cx=SMALL.cx + 3.0, intrinsics_std=IntrinsicsStd(0.002, 3.0, 0.003))
    assert validated(depths(), camera, intrinsics=None).verdict == "agrees"


def test_readings_that_change_from_frame_to_frame_are_unsteady() -> None:
    signs = (1.0, -1.0) * (len(LEVELS) // 2)
    found = validated([warped(depth, 0.004 * sign) for depth, sign in zip(depths(), signs, strict=True)])
    assert "unsteady" in {one.code for one in found.findings}


def test_a_cone_of_feed_is_no_vessels_cone() -> None:
    one = seen()[-1]
    feed = replace(one, factor=replace(one.factor, model="free-cone"))
    assert against([one], ideal().wall).on_cone.any()
    assert not against([feed], ideal().wall).on_cone.any()
    straight = replace(ideal().wall, has_cone=False)  # whose cylinder goes on behind the cone
    assert (np.abs(against([feed.without_feed()], straight).residual) < 0.05).all()
    assert (np.abs(against([feed], straight).residual) > 0.05).any()


def test_levels_have_every_frame_once_and_the_fullest_first() -> None:
    levels = by_level(seen())
    assert sorted(number for level in levels for number in level) == list(range(len(seen())))
    tiles = [np.mean([seen()[number].shown.sum() for number in level]) for level in levels]
    assert tiles == sorted(tiles)
    standing = by_level([seen()[0]] * 7)
    assert sorted(number for level in standing for number in level) == list(range(7))


def test_of_many_frames_some_are_asked_evenly() -> None:
    asked = Asked.of(PROFILE, camera=SMALL, depth_unit=None, diameter=None, intrinsics="exact")
    frames = (Frame(depth=depths()[-1], camera=SMALL, source=str(number)) for number in range(2 * MOST_FRAMES + 21))
    found = read(frames, asked)
    assert found.every == 2
    assert [int(one.name) for one in found.seen] == list(range(0, 2 * MOST_FRAMES + 21, 2))


def test_frames_that_can_not_tell_are_refused() -> None:
    assert validated(depths()[:3]).reason == "too-few-frames"
    nothing = validated([np.zeros((240, 320), np.float32)] * 5)
    assert (nothing.status, nothing.reason) == ("refused", "no-frame-answers")
    assert "5 of 5" in nothing.message
    with pytest.raises(UsageError, match="resamples"):
        validated(depths(), resamples=-1)


def test_the_same_frames_give_the_same_document() -> None:
    first, again = (validated(depths(), resamples=2, seed=3).to_dict() for _ in range(2))
    assert first == again


@pytest.fixture
def stored(tmp_path: Path) -> list[str]:
    for number, depth in enumerate(depths()):
        Image.fromarray(np.rint(1000.0 * depth).astype(np.uint16)).save(tmp_path / f"{number}.png")
    writers.write_camera(SMALL, tmp_path / "camera.json")
    words = ["--camera", str(tmp_path / "camera.json"), "--sensor", "orbbec-astra-s", "--depth-unit", "0.001"]
    return [*(str(tmp_path / f"{number}.png") for number in range(len(LEVELS))), *words, "--intrinsics", "exact"]


def test_the_command_writes_a_page_and_one_document(
    stored: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "check"
    assert main(["validate", *stored, "--resamples", "2", "--out", str(out), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["schema"] == "siloscope.validation/1"
    assert document["verdict"] == "agrees"
    assert document["frames"]["used"] == len(LEVELS)
    assert json.loads((out / "validation.json").read_text("utf-8")) == document
    page = (out / "report.html").read_text("utf-8")
    assert page.count("data:image/png") == 2 + len(document["splits"])
    assert document["summary"] in page


def test_a_sensor_with_another_bias_is_convicted() -> None:
    found = validated(depths(), sensor=replace(PROFILE, bias=(0.0, 0.0, 0.0)))
    assert found.verdict == "departs"


def test_a_wrong_diameter_is_convicted() -> None:
    found = validated(depths(), diameter=2.509)
    assert found.findings[0].code == "diameter"
    assert "9 mm smaller" in found.findings[0].message
    assert validated(depths(), diameter=2.501).verdict == "agrees"


def test_the_command_says_in_words_what_is_off(stored: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    writers.write_camera(replace(SMALL, cx=SMALL.cx + 3.0), Path(stored[stored.index("--camera") + 1]))
    assert main(["validate", *stored, "--resamples", "0"]) == 0
    shown = capsys.readouterr()
    assert shown.out.startswith("departs")
    assert main(["validate", *stored[:2], *stored[len(LEVELS) :]]) == 4
    assert "fewer than 4 frames" in capsys.readouterr().out
