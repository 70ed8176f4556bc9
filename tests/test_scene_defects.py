"""Uneven walls and clutter: every hit lies on the surface, and nothing lies before it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from siloscope import Camera, SiloPose, UsageError
from siloscope.simulation import Defects, Feed, Scene, Silo, SimulatedFrame
from siloscope.simulation.scenarios import SILO1, SILO2, SILO3

SMALL = Camera(width=96, height=72, fx=85.5, fy=85.5, cx=47.5, cy=35.5)

DEFECTS = {
    "corrugated": Defects(corrugation_depth=0.013),
    "oval": Defects(ovality=0.01, ovality_azimuth=0.4),
    "seams": Defects(seam_spacing=0.9, upright_seams=7, bolts=30),
    "dents": Defects(dents=14, seed=3),
    "film": Defects(film_bands=((1.0, 1.8, 0.03), (4.0, 5.0, 0.05)), film_lobes=3),
    "all": Defects(
        corrugation_depth=0.013,
        ovality=0.01,
        seam_spacing=1.1,
        upright_seams=4,
        bolts=20,
        dents=10,
        film_bands=((0.5, 1.0, 0.04),),
        film_lobes=2,
        film_azimuth=1.0,
    ),
}


def silo_points(frame: SimulatedFrame) -> np.ndarray:
    rays = np.concatenate([frame.camera.rays(), np.ones((*frame.depth.shape, 1))], axis=2)
    return frame.pose.to_silo(rays * frame.depth[..., None])


def bump(q: np.ndarray) -> np.ndarray:
    return np.where(q < 1, (1 - np.minimum(q, 1) ** 2) ** 3, 0.0)


def nearest(x: np.ndarray, pitch: float) -> np.ndarray:
    return x - pitch * np.rint(x / pitch)


def film_thickness(silo: Silo, defects: Defects, azimuth: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Smooth-step ends over a quarter of the band, and lobes around the silo."""
    total = np.zeros_like(z)
    for start, end, thick in defects.film_bands:
        u = np.clip(np.minimum(z - silo.top - start, silo.top + end - z) / (0.25 * (end - start)), 0, 1)
        ring = 0.5 + 0.5 * np.cos(defects.film_lobes * (azimuth - defects.film_azimuth))
        total += thick * (6 * u**5 - 15 * u**4 + 10 * u**3) * ring
    return total


def wall_radius(scene: Scene, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """The wall as the docstring of `Defects` tells it, written once more."""
    silo, defects = scene.silo, scene.defects
    azimuth, bottom = np.arctan2(y, x), silo.top + silo.cylinder_height
    on_cylinder = z < bottom
    relief = -film_thickness(silo, defects, azimuth, z)
    for centre, at, radius, depth in defects.resolved(silo).dents:
        arc = silo.radius * nearest(azimuth - centre, 2 * math.pi)
        relief -= depth * bump(np.hypot(arc, z - at) / radius)
    sheet = 0.5 * defects.corrugation_depth * np.sin(2 * math.pi * (bottom - z) / defects.corrugation_pitch)
    if defects.seam_spacing:
        around = nearest(z - silo.top - 0.5 * defects.seam_spacing, defects.seam_spacing)
        along = silo.radius * nearest(azimuth, 2 * math.pi / defects.upright_seams)
        bolt = silo.radius * nearest(azimuth, 2 * math.pi / defects.bolts)
        half = defects.seam_width / 2
        sheet -= defects.seam_height * (bump(np.abs(around) / half) + bump(np.abs(along) / half))
        sheet -= defects.bolt_height * bump(np.hypot(around, bolt) / defects.bolt_radius)
    relief += np.where(on_cylinder, sheet, 0.0)
    perfect = silo.radius * np.clip((bottom + silo.cone_height - z) / silo.cone_height, 0, 1)
    oval = 1 + defects.ovality * np.cos(2 * (azimuth - defects.ovality_azimuth))
    return perfect * oval + relief * perfect / silo.radius


@pytest.mark.parametrize("scene", [SILO1, SILO2, SILO3])
@pytest.mark.parametrize("name", DEFECTS)
def test_hits_lie_on_the_uneven_wall_and_nothing_lies_before_them(scene: Scene, name: str) -> None:
    scene = replace(scene, camera=SMALL, defects=DEFECTS[name], feed=None)
    frame = scene.render()
    x, y, z = np.moveaxis(silo_points(frame), -1, 0)
    hit = frame.labels > 0
    assert hit.mean() > 0.999
    gap = wall_radius(scene, x, y, z) - np.hypot(x, y)
    assert np.abs(gap[hit]).max() < 1e-9
    start = np.array([scene.pose.t_x, scene.pose.t_y, 0.0])
    for share in np.concatenate([np.linspace(0.05, 0.9, 30), np.linspace(0.9, 0.99999, 200)]):
        x, y, z = np.moveaxis(start + share * (silo_points(frame) - start), -1, 0)
        assert np.all((wall_radius(scene, x, y, z) - np.hypot(x, y))[hit] > -1e-9)


@pytest.mark.parametrize("name", DEFECTS)
def test_normals_follow_the_uneven_wall(name: str) -> None:
    scene = replace(SILO2, camera=SMALL, defects=DEFECTS[name], feed=None)
    frame = scene.render()
    rays = np.concatenate([SMALL.rays(), np.ones((72, 96, 1))], axis=2)
    assert np.all(np.sum(rays * frame.normals, axis=2) <= 1e-9)
    p, h = silo_points(frame), 1e-6
    steps = np.eye(3) * h

    def gap(q: np.ndarray) -> np.ndarray:
        x, y, z = np.moveaxis(q, -1, 0)
        return wall_radius(scene, x, y, z) - np.hypot(x, y)

    gradient = np.stack([(gap(p + step) - gap(p - step)) / (2 * h) for step in steps], axis=-1)
    gradient /= np.linalg.norm(gradient, axis=-1, keepdims=True)
    smooth = np.abs(p[..., 2] - scene.silo.cylinder_height) > 1e-3
    normals = frame.normals @ scene.pose.T_silo_camera[:3, :3].T
    assert np.abs(gradient - normals)[smooth & (frame.labels > 0)].max() < 1e-4


def test_no_defects_is_the_perfect_silo_and_tiny_ones_are_nearly_it() -> None:
    perfect = replace(SILO2, camera=SMALL).render()
    none = replace(SILO2, camera=SMALL, defects=Defects()).render()
    assert np.array_equal(perfect.depth, none.depth)
    tiny = replace(SILO2, camera=SMALL, defects=Defects(corrugation_depth=1e-12)).render()
    assert np.allclose(tiny.depth, perfect.depth, rtol=0, atol=1e-9)
    assert np.array_equal(tiny.labels, perfect.labels)


def test_film_on_the_wall_is_feed() -> None:
    defects = DEFECTS["film"]
    scene = replace(SILO2, camera=SMALL, defects=defects, feed=None)
    frame = scene.render()
    x, y, z = np.moveaxis(silo_points(frame), -1, 0)
    thick = film_thickness(scene.silo, defects, np.arctan2(y, x), z)
    assert np.array_equal(frame.labels == 3, thick > 2e-3)
    assert (frame.labels == 3).any()


def test_an_oval_silo_has_its_outlet_too() -> None:
    silo = replace(SILO1.silo, outlet_radius=0.25, outlet_offset=(0.1, 0.05))
    camera = replace(SMALL, fx=300.0, fy=300.0)
    frame = replace(SILO1, silo=silo, camera=camera, feed=None, defects=Defects(ovality=0.01)).render()
    x, y, z = silo_points(frame)[frame.labels == 4].T
    on_pipe, on_end = np.abs(np.hypot(x - 0.1, y - 0.05) - 0.25) < 1e-12, np.abs(z - 5.8) < 1e-12
    assert np.all(on_pipe | on_end)
    assert on_end.sum() > 100


def bar_distance(points: np.ndarray, bar: tuple[float, ...]) -> np.ndarray:
    a, b = np.array(bar[:3]), np.array(bar[3:6])
    share = np.clip((points - a) @ (b - a) / np.dot(b - a, b - a), 0, 1)
    return np.linalg.norm(points - a - share[..., None] * (b - a), axis=-1) - bar[6]


def least_distance(start: np.ndarray, ends: np.ndarray, bar: tuple[float, ...]) -> np.ndarray:
    """Least distance of the way to each point from a bar; distance to a convex body is convex along a line."""
    low, high = np.zeros(ends.shape[:-1]), np.ones(ends.shape[:-1])
    for _ in range(60):
        one, two = low + (high - low) / 3, high - (high - low) / 3
        at = [bar_distance(start + share[..., None] * (ends - start), bar) for share in (one, two)]
        low, high = np.where(at[0] > at[1], one, low), np.where(at[0] > at[1], high, two)
    return bar_distance(start + low[..., None] * (ends - start), bar)


@pytest.mark.parametrize("defects", [Defects(ladder=True), Defects(cables=6, seed=2), Defects(auger=True)])
def test_clutter_is_hit_where_it_is_and_nowhere_else(defects: Defects) -> None:
    scene = replace(SILO2, camera=SMALL, defects=defects, feed=Feed("funnel", 0.3))
    frame, bare = scene.render(), replace(scene, defects=None).render()
    points, clutter = silo_points(frame), frame.labels == 4
    bars = [bar for bundle in defects.resolved(scene.silo).bundles for bar in bundle]
    distance = np.min([bar_distance(points, bar) for bar in bars], axis=0)
    assert clutter.sum() > 20
    assert np.abs(distance[clutter]).max() < 1e-9
    assert np.array_equal(frame.depth[~clutter], bare.depth[~clutter])
    assert np.all(frame.depth[clutter] < bare.depth[clutter])
    start = np.array([scene.pose.t_x, scene.pose.t_y, 0.0])
    assert min(least_distance(start, points, bar).min() for bar in bars) > -1e-9


def test_a_mirrored_defect_gives_a_mirrored_frame() -> None:
    defects = Defects(ovality=0.02, ovality_azimuth=0.5, ladder=True, ladder_azimuth=2.0, auger=True, auger_azimuth=0.3)
    scene = replace(SILO3, camera=SMALL, defects=defects)
    pose = scene.pose
    mirrored = replace(
        scene,
        pose=SiloPose(pose.r_x, -pose.r_y, -pose.t_x, pose.t_y),
        defects=replace(
            defects, ovality_azimuth=math.pi - 0.5, ladder_azimuth=math.pi - 2.0, auger_azimuth=math.pi - 0.3
        ),
    )
    assert np.allclose(scene.render().depth, mirrored.render().depth[:, ::-1], rtol=0, atol=1e-9)


@pytest.mark.parametrize("world", ["wall", "corner", "shaft", "sphere"])
def test_other_worlds_have_their_own_geometry(world: str) -> None:
    silo = Silo(1.0, 2.0, 1.0)
    frame = Scene(silo, SiloPose(0.3, -0.2, 0.1, 0.05), SMALL, None, world=world).render()
    x, y, z = np.abs(np.moveaxis(silo_points(frame), -1, 0))
    distances = {
        "wall": z - 3.0,
        "corner": np.minimum(np.minimum(np.abs(z - 3.0), np.abs(x - 1.0)), np.abs(y - 1.0)),
        "shaft": np.maximum(x, y) - np.minimum(1.0, 3.0 - z),
        "sphere": np.sqrt(x**2 + y**2 + (z - 1.35) ** 2) - 1.65,
    }
    assert np.all(frame.labels == 4)
    assert np.abs(distances[world]).max() < 1e-12
    assert frame.true_volume == 0.0
    assert frame.truth()["silo"] is None


def test_noise_has_no_surface_and_nothing_has_no_depth() -> None:
    scene = replace(SILO1, camera=SMALL, world="noise")
    frame = scene.render()
    assert abs(np.corrcoef(frame.depth[:, :-1].ravel(), frame.depth[:, 1:].ravel())[0, 1]) < 0.05
    assert np.isclose(frame.depth.mean(), 0.55 * 5.5, rtol=0.02)
    assert np.array_equal(frame.depth, scene.render(threads=2).depth)
    assert not np.array_equal(frame.depth, replace(scene, seed=1).render().depth)
    empty = replace(scene, world="nothing").render()
    assert not empty.depth.any()
    assert empty.pixel_ratios.cylinder == 0.0


@pytest.mark.parametrize(
    "changes",
    [
        {"corrugation_depth": math.nan},
        {"corrugation_depth": 0.5},
        {"corrugation_depth": 0.01, "corrugation_pitch": 0.0},
        {"ovality": 0.5},
        {"ovality": -0.01},
        {"seam_spacing": 1e-9},
        {"seam_spacing": 1.0, "bolts": 10_000},
        {"upright_seams": 5000},
        {"dents": 3, "dent_radius": 0.0},
        {"dents": 3, "dent_depth": math.inf},
        {"film_bands": ((2.0, 1.0, 0.01),)},
        {"film_bands": ((1.0, 2.0, 9.0),)},
        {"film_bands": ((1.0, 2.0),)},
        {"film_bands": "abc"},
        {"film_bands": ((1.0, 2.0, 0.01),), "film_lobes": 1000},
        {"dents": -1},
        {"dents": 1.5},
        {"cables": 10**9},
        {"seed": -1},
        {"seed": "x"},
    ],
)
def test_impossible_defects_are_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(UsageError):
        replace(SILO1, camera=SMALL, defects=Defects(**changes)).render()


def test_a_camera_within_the_defects_and_an_unknown_world_are_refused() -> None:
    with pytest.raises(UsageError, match="inside the silo"):
        replace(SILO1, camera=SMALL, pose=SiloPose(0, 0, 1.249, 0), defects=Defects(corrugation_depth=0.013)).render()
    with pytest.raises(UsageError, match="unknown world"):
        replace(SILO1, world="moon")
    with pytest.raises(UsageError, match="inside the room"):
        replace(SILO1, camera=SMALL, world="sphere", pose=SiloPose(0, 0, 5, 5)).render()
