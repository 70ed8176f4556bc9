"""The plan: exact views, deviations that are those of real answers, and places that can't be."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import siloscope
from siloscope import sensors
from siloscope.cli import main
from siloscope.errors import UsageError
from siloscope.io import writers
from siloscope.planning.expectation import View, expected
from siloscope.planning.places import AIMS, Placement, aimed, placements
from siloscope.planning.plan import plan
from siloscope.planning.view import Interior, exact_depth
from siloscope.simulation import ASTRA_S, Scene, Silo
from siloscope.types.camera import Camera
from siloscope.vessel.vessel import Vessel, load

sys.path.append(str(Path(__file__).parents[1]))
from benchmarks.plan import row, site

CAMERA = Camera(width=160, height=120, fx=142.6, fy=142.6, cx=79.5, cy=59.5)
HOPPER = """diameter = 2.8
cylinder = 3.6
[bottom]
kind = "cone"
height = 1.9
"""
FLAT = 'diameter = 3.4\ncylinder = 4.0\n[bottom]\nkind = "flat"\n'
OBLIQUE = 'diameter = 2.8\ncylinder = 3.6\n[bottom]\nkind = "oblique"\nheight = 1.9\nvertex = [0.5, 0.0]\n'
SENSOR = sensors.load("orbbec-astra-s")


def vessel(text: str, folder: Path) -> Vessel:
    file = folder / "vessel.toml"
    file.write_text(text, "utf-8")
    return load(file)


def test_what_is_seen_of_an_empty_hopper_is_what_the_ray_tracer_sees(tmp_path: Path) -> None:
    inside = Interior.of(vessel(HOPPER, tmp_path), 0.2)
    silo = Silo(radius=1.4, cylinder_height=3.6, cone_height=1.9, top=-0.2)
    for placement in placements(inside):
        scene = Scene(silo, placement.pose, feed=None, camera=CAMERA)
        assert np.abs(exact_depth(inside, CAMERA, placement.pose, 0.0) - scene.render().depth).max() < 1e-6


def test_the_feed_is_a_funnel_between_wall_and_axis(tmp_path: Path) -> None:
    inside = Interior.of(vessel(FLAT, tmp_path), 0.2)
    pose = aimed(inside, 0.6, 0.0, "at the foot of the opposite wall")
    depth = exact_depth(inside, CAMERA, pose, 0.3)
    rays = np.dstack([CAMERA.rays(), np.ones(depth.shape)])
    x, y, z = np.moveaxis(pose.to_silo((rays * depth[..., None]).reshape(-1, 3)), -1, 0)
    on_wall = np.abs(np.hypot(x, y) - 1.7) < 1e-6
    assert np.abs(z[~on_wall] - inside.surface(x, y, 0.3)[~on_wall]).max() < 1e-6
    assert (z[on_wall] <= inside.feed_edge(0.3) + 1e-6).all()
    assert 0.05 < on_wall.mean() < 0.95


def test_aims_look_where_they_say(tmp_path: Path) -> None:
    inside = Interior.of(vessel(HOPPER, tmp_path), 0.2)
    sights = {name: aimed(inside, 0.8, 0.3, name).T_silo_camera[:3, 2] for name in AIMS}
    assert np.allclose(sights["straight down"], (0.0, 0.0, 1.0))
    place = np.array([0.8, 0.3, 0.0])
    on_axis = place + sights["at half the depth of the axis"] * np.linalg.norm(place - (0.0, 0.0, inside.edge / 2))
    assert np.allclose(on_axis, (0.0, 0.0, inside.edge / 2), atol=1e-12)


@pytest.mark.parametrize(("x", "level"), [(0.0, 0.1), (0.7, 0.2), (1.1, 0.35)])
def test_deviations_are_those_of_answers_for_noisy_frames(x: float, level: float, tmp_path: Path) -> None:
    about = vessel(HOPPER, tmp_path)
    inside = Interior.of(about, 0.2)
    camera = SENSOR.intrinsics[0]
    pose = aimed(inside, x, 0.0, "at half the depth of the axis")
    view = View.of(about, 0.2, SENSOR, camera, "calibrated")
    foreseen = expected(view, Placement(x, 0.0, "", pose), level)
    assert foreseen.std is not None
    exact = exact_depth(inside, camera, pose, level)
    noise = np.random.default_rng(3).standard_normal(exact.shape)
    read = np.where(exact > 0.0, exact + ASTRA_S.bias_at(exact) + noise * ASTRA_S.sigma_at(exact), 0.0)
    answer = siloscope.locate(read, camera, sensor=SENSOR, intrinsics="calibrated")
    stated = answer.to_dict()["std"]
    for name, std in foreseen.std.items():
        assert 0.7 < std / stated[name] < 1.4, name


@pytest.mark.parametrize("seed", [0, 9, 13])
def test_answers_scatter_as_foreseen(seed: int) -> None:
    """`python -m benchmarks.plan` has 20 places; chance alone makes a tenth of difference in 40 draws."""
    found = row(site(seed, "calibrated"), 40)
    assert found is not None
    assert found[0] == pytest.approx(1.0, abs=0.3)


def test_more_is_known_with_exact_intrinsics(tmp_path: Path) -> None:
    about = vessel(HOPPER, tmp_path)
    inside = Interior.of(about, 0.2)
    place = Placement(0.7, 0.0, "", aimed(inside, 0.7, 0.0, "at half the depth of the axis"))
    views = [View.of(about, 0.2, SENSOR, None, name) for name in ("exact", "calibrated", "nominal")]
    stds = [expected(view, place, 0.1).axis_std for view in views]
    assert all(std is not None for std in stds)
    assert stds[0] < 0.6 * stds[1] < 0.5 * stds[2]


def test_the_command_ranks_places_and_says_what_it_assumed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "hopper.toml"
    file.write_text(HOPPER, "utf-8")
    picture, camera = tmp_path / "plan.png", tmp_path / "camera.json"
    writers.write_camera(CAMERA, camera)
    words = ["plan", str(file), "--sensor", "orbbec-astra-s", "--camera", str(camera), "--levels", "0.1,0.5"]
    words += ["--out", str(picture), "--json"]
    assert main(words) == 0
    made = json.loads(capsys.readouterr().out)
    assert made["schema"] == "siloscope.plan/1"
    assert made["assumed"] == ["the camera hangs 0.1 m below the wall's upper edge"]
    answered = [place["answered"] for place in made["places"]]
    assert answered == sorted(answered, reverse=True)
    assert answered[0] >= 1
    assert made["calibration_levels"][0]["axis_std_m"] > 0.0
    assert picture.stat().st_size > 10_000


def test_a_place_beyond_the_sensors_range_is_named(tmp_path: Path) -> None:
    about = vessel(HOPPER, tmp_path)
    inside = Interior.of(about, 0.2)
    short = replace(SENSOR, range=(0.4, 2.0))
    place = Placement(0.7, 0.0, "", aimed(inside, 0.7, 0.0, "straight down"))
    found = expected(View.of(about, 0.2, short), place, 0.05)
    assert any("beyond the sensor's 2 m" in warning for warning in found.warnings)


def test_asymmetric_bottoms_are_looked_at_from_all_sides(tmp_path: Path) -> None:
    round_one, aside = (Interior.of(vessel(text, tmp_path), 0.2) for text in (HOPPER, OBLIQUE))
    assert len(list(placements(aside))) > 2 * len(list(placements(round_one)))


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        ('diameter = 2.8\n[bottom]\nkind = "flat"\n', {}, "cylinder"),
        ("diameter = 2.8\ncylinder = 3.0\n", {}, "bottom"),
        (HOPPER, {"drop": -0.1}, "drop"),
        (HOPPER, {"levels": (1.2,)}, "levels"),
    ],
)
def test_what_can_not_be_is_refused(text: str, options: dict[str, float], said: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=said):
        plan(vessel(text, tmp_path), SENSOR, **options)  # type: ignore[arg-type]
