"""The independent oracle is checked itself: by laws, by exact truth, and against the Rust simulator where both can."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import siloscope
from oracle import KINDS, NO_SILO, Intrinsics, Pose, Scene, Vessel, draw, volumes
from oracle.bottoms import Cone, Flat, Pyramid, TwoStage
from oracle.cameras import looking
from oracle.clutter import Bar, Ladder
from oracle.feed import Feed, Tip
from oracle.judging import judge
from oracle.sensors import ASTRA_S, AZURE, D455, Faults, measured
from oracle.sequences import sequence
from oracle.solids import CYLINDER, air
from oracle.store import many, sample, single
from oracle.walls import Bend, Corrugation, Courses, Relief, Round, Wall
from siloscope import simulation as simulator

CAMERA = Intrinsics(160, 120, 142.6, 142.6, 79.5, 59.5)
POSE = Pose(0.11, -0.17, 0.4, 0.3)
VESSEL = Vessel(Wall(1.3), Cone(2.6, 1.3, 1.5), -0.2)
SILO = simulator.Silo(1.3, 2.8, 1.5, top=-0.2)


def a_scene(vessel: Vessel | None = VESSEL, pose: Pose = POSE, **parts: Any) -> Scene:
    return Scene(pose, CAMERA, CAMERA, vessel, **parts)


EVERY_SOLID = [
    a_scene(),
    a_scene(Vessel(Wall(1.3, (Round(2, 0.01, 0.3), Corrugation(0.013, 0.076, 1.0))), VESSEL.bottom, -0.2)),
    a_scene(Vessel(Wall(1.3, (Courses((1.0, 2.0), (0.0, -0.01, 0.005)),)), Flat(2.6), -0.2)),
    a_scene(Vessel(Wall(1.3, (Bend((0.008, 0.002), 0.7, -0.2, 2.6),)), VESSEL.bottom, -0.2)),
    a_scene(Vessel(Wall(1.3), Cone(2.6, 1.3, 1.6, 0.1, offset=(0.5, 0.2)), -0.2), things=(Ladder(1.1, 1.0, 2.5),)),
    a_scene(Vessel(Wall(1.3), TwoStage(2.6, 1.3, 0.6, 0.7, 1.2, 0.1), -0.2)),
    a_scene(Vessel(Wall(1.3), Pyramid(2.6, 1.3, 1.4, 0.4, 0.1), -0.2), feed=Feed(3.2, (0.2, 0.1))),
    a_scene(feed=Feed(2.0, tip=Tip(0.2, 0.1, 2.4, -0.8, alone=False), waves=((0.01, 5.0, 3.0, 1.0),))),
    a_scene(feed=Feed(2.0, tip=Tip(0.2, 0.1, 1.6, 0.5)), things=(Bar((0.0, -0.5, 0.9), (0.4, 0.9, 1.1), 0.03),)),
]


@pytest.mark.parametrize("scene", EVERY_SOLID, ids=range(len(EVERY_SOLID)))
def test_a_ray_ends_on_the_first_surface(scene: Scene) -> None:
    depth, _, points = scene.exact()
    assert (depth > 0.0).all()
    flat = points.reshape(-1, 3)
    assert np.abs(air(scene.solids, *flat.T)).max() < 1e-5
    for share in np.linspace(0.01, 0.99, 60):
        before = scene.pose.origin + share * (flat - scene.pose.origin)
        assert air(scene.solids, *before.T).min() > -1e-3


@pytest.mark.parametrize("scene", EVERY_SOLID, ids=range(len(EVERY_SOLID)))
def test_what_is_called_air_is_air(scene: Scene) -> None:
    """From any place, a step as long as the bound in any direction meets nothing."""
    draws = np.random.default_rng(1)
    depth, _, points = scene.exact()
    places = scene.pose.origin + draws.uniform(size=depth.shape)[..., None] * (points - scene.pose.origin)
    flat = places.reshape(-1, 3)
    bound = air(scene.solids, *flat.T)
    direction = draws.normal(size=flat.shape)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    assert air(scene.solids, *(flat + 0.999 * bound[:, None] * direction).T).min() > -2.5e-3


def test_a_world_twice_as_large_is_twice_as_far() -> None:
    double = Vessel(Wall(2.6), Cone(5.2, 2.6, 3.0), -0.4)
    pose = replace(POSE, t_x=2 * POSE.t_x, t_y=2 * POSE.t_y)
    small, large = a_scene().exact()[0], a_scene(double, pose).exact()[0]
    np.testing.assert_allclose(large, 2.0 * small, atol=1e-8)


def feed_like(silo: simulator.Silo, theirs: simulator.Feed, feed: Feed) -> Feed:
    """The feed at the height that the simulator's has 0.8 m beside its tip or centre."""
    x, y = theirs.centre[0] + 0.8, theirs.centre[1]
    place = np.array([x]), np.array([y])
    down = silo.top + silo.height - float(silo.feed_heights(theirs, [x, y])) - float(feed.depth(*place)[0])
    tip = None if feed.tip is None else replace(feed.tip, z=feed.tip.z + down)
    return replace(feed, z=feed.z + down, tip=tip)


def wall(*reliefs: Relief) -> Vessel:
    return Vessel(Wall(1.3, reliefs), VESSEL.bottom, -0.2)


STEPPED = replace(SILO, courses=((1.0, 1.31), (2.0, 1.295)))
TILTED = simulator.Feed("tilted", 0.45, tilt=0.2, tilt_azimuth=0.7)
SHARED = {
    "cone": (VESSEL, SILO, None, None, None),
    "level": (VESSEL, SILO, Feed(0.0), simulator.Feed("flat", 0.5), None),
    "tilted": (VESSEL, SILO, Feed(0.0, (-math.tan(0.2) * math.cos(0.7), -math.tan(0.2) * math.sin(0.7))), TILTED, None),
    "funnel": (
        VESSEL,
        SILO,
        Feed(0.0, tip=Tip(0.2, 0.1, 0.0, -math.tan(0.6))),
        simulator.Feed("funnel", 0.5, angle=0.6, tip=2e-4, centre=(0.2, 0.1)),
        None,
    ),
    "crater": (
        Vessel(Wall(1.3), Flat(2.6), -0.2),
        replace(SILO, cone_height=0.0, bottom="flat"),
        Feed(0.0, tip=Tip(0.2, 0.1, 0.5, -math.tan(0.8), False, 2e-3)),
        simulator.Feed("crater", 0.5, angle=0.8, tip=2e-3, centre=(0.2, 0.1), crater_depth=0.5),
        None,
    ),
    "flat": (Vessel(Wall(1.3), Flat(2.6), -0.2), replace(SILO, cone_height=0.0, bottom="flat"), None, None, None),
    "oblique": (
        Vessel(Wall(1.3), Cone(2.6, 1.3, 1.5, offset=(0.5, -0.3)), -0.2),
        replace(SILO, bottom="oblique", outlet_offset=(0.5, -0.3)),
        None,
        None,
        None,
    ),
    "two stages": (
        Vessel(Wall(1.3), TwoStage(2.6, 1.3, 0.5, 0.6, 1.0), -0.2),
        replace(SILO, bottom="two-stage", waist_radius=0.6, waist_depth=0.5),
        None,
        None,
        None,
    ),
    "pyramid": (
        Vessel(Wall(1.3), Pyramid(2.6, 1.3, 1.5, 0.4), -0.2),
        replace(SILO, bottom="pyramid", bottom_azimuth=0.4),
        None,
        None,
        None,
    ),
    "oval": (wall(Round(2, 0.013, 0.5)), SILO, None, None, simulator.defects("oval")),
    "bent": (
        wall(Bend((0.007,), 0.7, -0.2, 2.6)),
        SILO,
        None,
        None,
        simulator.Defects(bend=0.007, bend_azimuth=0.7),
    ),
    "courses": (wall(Courses((0.8, 1.8), (0.01, -0.005, 0.0))), STEPPED, None, None, None),
    "corrugated": (
        wall(Corrugation(0.013, 0.076, math.pi - 2.0 * math.pi * 2.6 / 0.076 + math.pi)),
        SILO,
        None,
        None,
        simulator.defects("corrugated"),
    ),
}
"""Vessel and silo, feed and feed, defects: what both programs can make."""


@pytest.mark.parametrize("name", SHARED)
def test_the_rust_simulator_sees_the_same(name: str) -> None:
    """Two programs that share nothing agree to micrometres; at steps, tips and edges they are rounded otherwise."""
    vessel, silo, feed, theirs, defects = SHARED[name]
    camera = siloscope.Camera(160, 120, 142.6, 142.6, 79.5, 59.5)
    pose = siloscope.SiloPose(POSE.r_x, POSE.r_y, POSE.t_x, POSE.t_y)
    frame = simulator.Scene(silo, pose, camera, theirs, defects=defects).render()
    if feed is not None and theirs is not None:
        feed = feed_like(silo, theirs, feed)
    depth, labels, points = a_scene(vessel, feed=feed).exact()
    same = (labels == frame.labels) & (depth > 0.0)
    assert same.mean() > 0.995
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    same &= (np.hypot(x, y) > 0.05) & (np.hypot(x - 0.2, y - 0.1) > 0.05)
    if defects is not None:
        same &= labels == CYLINDER
    if name == "courses":
        same &= (np.abs(z - 0.8) > 0.03) & (np.abs(z - 1.8) > 0.03)
    if name == "crater":
        same &= np.abs(np.hypot(x - 0.2, y - 0.1) - 0.5 / math.tan(0.8)) > 0.1
    assert np.abs(depth - frame.depth)[same].max() < 3e-6
    assert np.abs(depth - frame.depth)[labels == frame.labels].max() < 0.02


CONTENTS = [name for name in SHARED if SHARED[name][3] is not None or SHARED[name][4] is None]


@pytest.mark.parametrize("name", CONTENTS)
def test_the_rust_simulator_counts_the_same(name: str) -> None:
    vessel, silo, feed, theirs, _ = SHARED[name]
    if theirs is None:
        feed, theirs = Feed(0.0), simulator.Feed("flat", 0.6)
    assert feed is not None
    ours = volumes.content(vessel, feed_like(silo, theirs, feed), 100)
    assert simulator.content_of(silo, theirs).volume == pytest.approx(ours, rel=2e-4)
    full = volumes.ullage(vessel, None, 100)
    assert silo.capacity == pytest.approx(full, rel=2e-4)


def test_rays_follow_the_camera_model_of_the_product() -> None:
    camera = replace(CAMERA, cx=70.0, cy=62.0, k1=-0.08)
    theirs = siloscope.Camera(160, 120, 142.6, 142.6, 70.0, 62.0, "brown_conrady", (-0.08, 0.0, 0.0, 0.0, 0.0))
    np.testing.assert_allclose(camera.rays()[..., :2], theirs.rays(), atol=1e-9)


def test_the_pose_is_the_contract_s() -> None:
    theirs = siloscope.SiloPose(POSE.r_x, POSE.r_y, POSE.t_x, POSE.t_y).T_silo_camera
    np.testing.assert_allclose(POSE.rotation, theirs[:3, :3], atol=1e-14)
    np.testing.assert_allclose(POSE.origin, theirs[:3, 3], atol=1e-14)
    aimed = looking((0.4, -0.3), (-0.2, 0.5, 2.0))
    ahead = aimed.rotation @ [0.0, 0.0, 1.0]
    np.testing.assert_allclose(np.cross(ahead, [-0.6, 0.8, 2.0]), 0.0, atol=1e-12)


R, H, Z = 1.3, 2.6, 2.8
CONE_VOLUME = math.pi * R**2 * 1.5 / 3.0
VOLUMES = {
    "full cone": (Vessel(Wall(R), Cone(H, R, 1.5), -0.2), Feed(H), CONE_VOLUME),
    "cylinder and cone": (Vessel(Wall(R), Cone(H, R, 1.5), -0.2), Feed(1.6), CONE_VOLUME + math.pi * R**2),
    "oblique cone (Cavalieri)": (Vessel(Wall(R), Cone(H, R, 1.5, offset=(0.5, 0.3)), -0.2), Feed(H), CONE_VOLUME),
    "flat floor, tilted feed": (Vessel(Wall(R), Flat(H), -0.2), Feed(1.6, (0.3, 0.2)), math.pi * R**2),
    "pile on a floor": (Vessel(Wall(R), Flat(H), -0.2), Feed(H, tip=Tip(0.0, 0.0, H - 0.5, 0.5)), math.pi * 0.5 / 3.0),
    "ring": (
        Vessel(Wall(R), Flat(H), -0.2),
        Feed(H, tip=Tip(0.0, 0.0, H, -0.5)),
        2.0 / 3.0 * math.pi * 0.5 * R**3,
    ),
    "two stages": (
        Vessel(Wall(R), TwoStage(H, R, 0.6, 0.7, 1.2), -0.2),
        Feed(H),
        math.pi / 3.0 * (0.6 * (R**2 + 0.7 * R + 0.7**2) + 1.2 * 0.7**2),
    ),
    "oval": (
        Vessel(Wall(R, (Round(2, 0.05, 0.3),)), Flat(H), -0.2),
        Feed(1.6),
        math.pi * (R**2 + 0.5 * 0.05**2),
    ),
}


@pytest.mark.parametrize("name", VOLUMES)
def test_volumes_of_known_bodies(name: str) -> None:
    vessel, feed, exact = VOLUMES[name]
    assert volumes.content(vessel, feed, 80) == pytest.approx(exact, rel=4e-4)


def test_the_pyramid_in_a_cylinder_is_counted_point_by_point() -> None:
    vessel = Vessel(Wall(R, (Bend((0.02,), 0.3, -0.2, H),)), Pyramid(H, R, 1.4, 0.4), -0.2)
    draws = np.random.default_rng(3)
    points = draws.uniform((-1.4, -1.4, H - 0.5), (1.4, 1.4, H + 1.4), (2_000_000, 3))
    inside = (air(vessel.solids, *points.T) > 0.0).mean() * 2.8 * 2.8 * 1.9
    assert volumes.content(vessel, Feed(H - 0.5), 80) == pytest.approx(inside, rel=4e-3)


def test_content_and_ullage_fill_the_vessel() -> None:
    vessel = Vessel(Wall(R), Cone(H, R, 1.5, 0.1, offset=(0.4, 0.0)), -0.2)
    feed = Feed(2.2, tip=Tip(0.2, 0.1, 2.9, -0.7), waves=((0.02, 4.0, 2.0, 0.5),))
    parts = volumes.content(vessel, feed, 60) + volumes.ullage(vessel, feed, 60)
    assert parts == pytest.approx(volumes.ullage(vessel, None, 60), rel=1e-9)


def test_the_best_line_through_a_bent_wall_is_the_axis() -> None:
    bend = Bend((0.008, 0.003, -0.002), 0.7, -0.2, 2.6)
    z = np.linspace(-0.2, 2.6, 20001)
    assert np.abs(np.polyfit(z, bend.shift(z), 1)).max() < 1e-6
    assert np.abs(bend.shift(z)).max() > 0.008


@pytest.mark.parametrize(
    ("sensor", "name"), [(ASTRA_S, "orbbec-astra-s"), (D455, "realsense-d455"), (AZURE, "azure-kinect")]
)
def test_sensors_are_those_of_the_profiles(sensor: Any, name: str) -> None:
    profile = siloscope.sensors.load(name)
    depth = np.full((200, 300), 3.0)
    one = np.ones(depth.shape)
    readings = measured(sensor, Faults(unit=0.0), depth, one, 0.0 * one, (1,), 5)
    assert readings.std() == pytest.approx(profile.sigma(3.0), rel=0.05)
    off = readings.mean() - (3.0 + np.array([1.0, 3.0, 9.0]) @ profile.bias)
    assert abs(off) < 3.0 * np.hypot(readings.std() / 50.0, np.array([1.0, 3.0, 9.0]) @ profile.bias_std)


def test_faults_do_what_they_say() -> None:
    depth, one = np.full((240, 320), 3.0), np.ones((240, 320))
    lost = measured(ASTRA_S, Faults(dropout=0.8), depth, one, one, (1,), 1)
    assert (lost > 0.0).mean() == pytest.approx(0.2, abs=0.03)
    dusty = measured(ASTRA_S, Faults(dust=0.3), depth, one, one, (1,), 1)
    assert (dusty < 2.8).mean() == pytest.approx(0.3, abs=0.03)
    steep = measured(ASTRA_S, Faults(multipath=0.02), depth, 0.0 * one, one, (1,), 1)
    open_ = measured(ASTRA_S, Faults(), depth, one, 0.0 * one, (1,), 1)
    assert (steep / open_).mean() == pytest.approx(1.02, abs=1e-3)
    warped = measured(ASTRA_S, Faults(warp=0.004, unit=0.0), 0.0 * depth + 2.0, one, one, (1,), 1)
    again = measured(ASTRA_S, Faults(warp=0.004, unit=0.0), 0.0 * depth + 2.0, one, one, (2,), 1)
    assert np.corrcoef(warped.ravel(), again.ravel())[0, 1] > 0.7
    assert np.rint(1e3 * open_) == pytest.approx(1e3 * open_)


@pytest.mark.parametrize("kind", [*KINDS, *NO_SILO])
def test_every_kind_can_be_drawn(kind: str) -> None:
    shot = draw(kind, 11, width=96).shoot()
    again = draw(kind, 11, width=96).shoot()
    np.testing.assert_array_equal(shot.reading, again.reading)
    assert shot.scene.told.k1 == 0.0
    if kind in NO_SILO:
        assert shot.scene.vessel is None
        assert (shot.reading > 0.0).any()
    else:
        assert shot.scene.vessel is not None
        assert 0.75 <= shot.scene.vessel.wall.radius <= 6.0
        assert shot.scene != draw(kind, 12, width=96)


def test_a_sequence_keeps_what_lasts(tmp_path: Path) -> None:
    still = sequence("farm", 3, frames=6, width=64)
    assert len({(s.vessel, s.pose, s.camera, s.device) for s in still}) == 1
    assert len({s.seed for s in still}) == 6
    moved = sequence("farm", 3, frames=6, width=64, moved=True)
    poses = [s.pose for s in moved]
    assert sum(a != b for a, b in itertools.pairwise(poses)) == 1
    kept = many(tmp_path, "farm", 3, 6, width=64)
    assert [s.truth["pose"]["t_x"] for s in kept] == [s.pose.t_x for s in still]


def test_frames_are_kept(tmp_path: Path) -> None:
    first = single(tmp_path, "control", 0, width=64)
    (path,) = tmp_path.iterdir()
    written = path.stat().st_mtime_ns
    again = single(tmp_path, "control", 0, width=64)
    assert path.stat().st_mtime_ns == written
    np.testing.assert_array_equal(first.depth, again.depth)
    assert first.truth["pose"] == again.truth["pose"]


def an_answer(**off: float) -> dict[str, Any]:
    names = ("r_x", "r_y", "t_x", "t_y")
    pose = {name: getattr(POSE, name) + off.get(name, 0.0) for name in names}
    silo = {"radius": 1.3, "cylinder_bottom": 2.6, "apex": 4.1 + off.get("apex", 0.0)}
    std = {"radius": 1e-3, "cylinder_bottom": 1e-3, "apex": 1e-3}
    return {"status": "ok", "reason": None, **pose, "std": dict.fromkeys(names, 2e-3), "silo": {**silo, "std": std}}


def test_the_judge_tells_right_from_wrong() -> None:
    truth = sample(a_scene().shoot()).truth
    assert judge(an_answer(), truth).z == pytest.approx((0, 0, 0, 0), abs=1e-9)
    fine, wrong = judge(an_answer(t_x=0.007, apex=0.009), truth), judge(an_answer(t_x=0.011, apex=0.011), truth)
    assert not fine.wrong
    assert not fine.geometry_wrong
    assert wrong.wrong
    assert wrong.geometry_wrong
    assert wrong.position_mm == pytest.approx(11.0)
    refused = {"status": "refused", "reason": "why"}
    assert judge(refused, truth).missed
    assert judge(an_answer(), {**truth, "silo": None}).wrong
    assert not judge(refused, {**truth, "silo": None}).missed
    assert judge({**an_answer(), "silo": {**an_answer()["silo"], "bottom": {"kind": "flat"}}}, truth).geometry_wrong
