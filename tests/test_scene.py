"""The synthetic world: laws first, then truth against independent formulas, then disasters."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from siloscope import Camera, SiloPose, UsageError
from siloscope.simulation import ASTRA_S, Feed, Scene, SensorModel, Silo, SimulatedFrame, content_of, discharge
from siloscope.simulation.scenarios import SCENARIOS, SILO1, SILO2, SILO3, looking_at, random_scene, scenario

SMALL = Camera(width=96, height=72, fx=85.5, fy=85.5, cx=47.5, cy=35.5)
SHAPES = ("gaussian", "funnel", "mound", "flat", "tilted", "lumpy", "rathole", "tilted+lumpy+rathole", "funnel+lumpy")


def small(scene: Scene, **changes: Any) -> Scene:
    return replace(scene, camera=SMALL, **changes)


def silo_points(frame: SimulatedFrame) -> np.ndarray:
    rays = frame.camera.rays()
    points = np.concatenate([rays, np.ones((*rays.shape[:2], 1))], axis=2) * frame.depth[..., None]
    return frame.pose.to_silo(points)


def gaussian_height(scene: Scene, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    radius, top = scene.silo.radius, scene.feed.level * scene.silo.height
    return top - 0.75 * radius * (1 - np.exp(-(x**2 + y**2) / radius**2))


@pytest.mark.parametrize("name", [name for name in SCENARIOS if name.startswith("silo")])
def test_every_ray_ends_on_the_surface_its_label_names(name: str) -> None:
    scene = small(scenario(name))
    frame = scene.render()
    x, y, z = np.moveaxis(silo_points(frame), -1, 0)
    r, silo = np.hypot(x, y), scene.silo
    apex = silo.height
    residual = np.select(
        [frame.labels == 1, frame.labels == 2, frame.labels == 3],
        [r - silo.radius, r - silo.radius / silo.cone_height * (apex - z), apex - z - gaussian_height(scene, x, y)],
        np.inf,
    )
    assert np.abs(residual).max() < 1e-12
    assert np.all(z[frame.labels == 1] <= silo.cylinder_height + 1e-12)
    assert np.all(z[frame.labels == 2] >= silo.cylinder_height - 1e-12)
    assert set(np.unique(frame.labels)) == {1, 2, 3}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("level", [0.1, 0.35, 0.7])
def test_nothing_lies_between_the_camera_and_the_hit(shape: str, level: float) -> None:
    """Marching along the rays in small steps never finds a point behind a surface before the depth."""
    scene = small(SILO2, feed=Feed(shape, level, seed=3))
    frame = scene.render()
    inside = silo_points(frame)
    start = np.array([scene.pose.t_x, scene.pose.t_y, 0.0])
    for share in np.linspace(0.02, 0.999, 60):
        x, y, z = np.moveaxis(start + share * (inside - start), -1, 0)
        height = scene.silo.height - z
        assert np.all(height > heights(scene, x, y) - 1e-9)
        assert np.all(np.hypot(x, y) < np.minimum(1.0, height / scene.silo.cone_height) * scene.silo.radius + 1e-9)
    fed = frame.labels == 3
    x, y, z = inside[fed].T
    assert np.abs(scene.silo.height - z - heights(scene, x, y)).max() < 1e-12


def heights(scene: Scene, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Feed heights, with the bare wall as -inf."""
    found = scene.silo.feed_heights(scene.feed, np.stack([x, y], axis=-1))
    return np.where(np.isnan(found), -np.inf, found)


@pytest.mark.parametrize("shape", SHAPES)
def test_normals_are_perpendicular_to_the_surface_and_look_at_the_camera(shape: str) -> None:
    camera = Camera(width=480, height=360, fx=4275.0, fy=4275.0, cx=-60.0, cy=179.5)  # a tenth of the angles
    scene = replace(SILO2, camera=camera, feed=Feed(shape, 0.4, seed=5))
    frame = scene.render()
    rays = np.concatenate([camera.rays(), np.ones((360, 480, 1))], axis=2)
    assert np.all(np.sum(frame.normals * rays, axis=2) < 0)
    assert np.allclose(np.linalg.norm(frame.normals, axis=2), 1, rtol=0, atol=1e-12)
    points = rays * frame.depth[..., None]
    across = np.cross(points[1:-1, 2:] - points[1:-1, :-2], points[2:, 1:-1] - points[:-2, 1:-1])
    across /= np.linalg.norm(across, axis=2, keepdims=True)
    labels = frame.labels
    same = np.all(
        [labels[1:-1, 1:-1] == s for s in (labels[1:-1, 2:], labels[1:-1, :-2], labels[2:, 1:-1], labels[:-2, 1:-1])],
        axis=0,
    )
    agreement = np.abs(np.sum(across * frame.normals[1:-1, 1:-1], axis=2))[same]
    assert np.quantile(agreement, 0.01) > 1 - 1e-4
    assert same.mean() > 0.9


def test_a_mirrored_scene_gives_the_mirrored_frame() -> None:
    feed = Feed("gaussian+tilted+rathole", 0.3, tilt_azimuth=0.7, rathole_centre=(0.3, 0.4))
    scene = small(SILO3, feed=feed)
    pose = scene.pose
    mirrored = replace(
        scene,
        pose=SiloPose(pose.r_x, -pose.r_y, -pose.t_x, pose.t_y),
        feed=replace(feed, tilt_azimuth=math.pi - 0.7, rathole_centre=(-0.3, 0.4)),
    )
    assert np.allclose(scene.render().depth, mirrored.render().depth[:, ::-1], rtol=0, atol=1e-12)


@settings(max_examples=20, deadline=None)
@given(st.floats(0.3, 3.0), st.integers(0, 1000))
def test_scaling_the_world_scales_the_frame(scale: float, seed: int) -> None:
    scene = random_scene(seed, Feed("funnel", 0.3), camera=SMALL)
    silo, pose = scene.silo, scene.pose
    larger = replace(
        scene,
        silo=Silo(silo.radius * scale, silo.cylinder_height * scale, silo.cone_height * scale, top=silo.top * scale),
        pose=replace(pose, t_x=pose.t_x * scale, t_y=pose.t_y * scale),
    )
    one, other = scene.render(), larger.render()
    assert np.allclose(other.depth, one.depth * scale, rtol=1e-11, atol=0)
    assert np.isclose(other.true_volume, one.true_volume * scale**3, rtol=1e-7)


def test_the_number_of_threads_changes_nothing() -> None:
    sensor = replace(ASTRA_S, dust=0.01, flying=0.5, dropout=0.1, correlation=0.3, unit=1e-3)
    scene = small(SILO2, sensor=sensor, seed=4)
    frames = [scene.render(threads) for threads in (1, 2, 3, 100)]
    for frame in frames[1:]:
        assert np.array_equal(frame.depth, frames[0].depth)
        assert np.array_equal(frame.measured, frames[0].measured)
        assert np.array_equal(frame.labels, frames[0].labels)
    assert not np.array_equal(replace(scene, seed=5).render().measured, frames[0].measured)


def test_the_astra_s_errs_as_equations_8_to_10_say() -> None:
    d = np.array([0.6, 1.0, 2.0, 5.0])
    mm = 1000 * d
    assert np.allclose(ASTRA_S.bias_at(d) * 1000, 2.2093e-5 * mm**2 - 0.017878 * mm + 3.4397, rtol=1e-12)
    assert np.allclose(ASTRA_S.sigma_at(d) * 1000, (3e-6 * mm**2 - 5e-4 * mm + 0.5) / (2 * math.sqrt(3)), rtol=1e-12)
    assert 0.46 < ASTRA_S.bias_at(5.0) < 0.48


@pytest.mark.parametrize(
    "sensor",
    [ASTRA_S, replace(ASTRA_S, correlation=0.5), SensorModel(noise_scale=1.9e-3, noise_power=2.36, noise_floor=2e-3)],
)
def test_the_noise_has_the_law_s_mean_and_deviation_at_every_depth(sensor: SensorModel) -> None:
    frame = replace(SILO2, sensor=sensor, seed=8).render()
    error = frame.measured - frame.depth
    score = (error - sensor.bias_at(frame.depth)) / sensor.sigma_at(frame.depth)
    edges = np.quantile(frame.depth, np.linspace(0, 1, 9))
    shared = 1 + 40 * sensor.correlation  # neighbours that move together make fewer independent numbers
    for low, high in itertools.pairwise(edges):
        bin_scores = score[(frame.depth >= low) & (frame.depth < high)]
        n = bin_scores.size / shared**2
        assert abs(bin_scores.mean()) < 4 / math.sqrt(n)
        assert abs(bin_scores.std() - 1) < 4 / math.sqrt(2 * n)


def test_measuring_again_is_rendering_with_another_seed_or_sensor() -> None:
    frame = small(SILO2, sensor=ASTRA_S, seed=1).render()
    again = frame.measured_again(2)
    assert np.array_equal(again.measured, small(SILO2, sensor=ASTRA_S, seed=2).render().measured)
    assert (again.scene.seed, again.depth is frame.depth) == (2, True)
    perfect = frame.measured_again(2, SensorModel())
    assert np.array_equal(perfect.measured, frame.depth)


def test_an_empty_silo_holds_nothing_and_a_flat_one_what_geometry_says() -> None:
    silo = Silo(1.5, 3.0, 2.0)
    assert content_of(silo, None).volume == 0.0
    assert content_of(silo, Feed("flat", 0.0)).volume == 0.0
    cone = math.pi * 1.5**2 * 2.0 / 3
    assert math.isclose(content_of(silo, Feed("flat", 0.2)).volume, cone / 8, rel_tol=1e-9)
    assert math.isclose(content_of(silo, Feed("flat", 0.4)).volume, cone, rel_tol=1e-9)
    assert math.isclose(content_of(silo, Feed("flat", 1.0)).volume, silo.capacity, rel_tol=1e-9)
    assert math.isclose(content_of(silo, Feed("flat", 0.6)).area, math.pi * 1.5**2, rel_tol=1e-9)


def test_gaussian_feed_in_the_cylinder_has_the_closed_form_volume() -> None:
    silo = Silo(1.5, 3.0, 2.0)
    content = content_of(silo, Feed("gaussian", 0.9))
    mean_drop = 0.75 * 1.5 * (1 - (1 - math.exp(-1)))  # mean of exp(-q) over q in 0..1 is 1 - 1/e
    disc, cone = math.pi * 1.5**2, math.pi * 1.5**2 * 2.0 / 3
    expected = disc * (4.5 - mean_drop) - (disc * 2.0 - cone)
    assert math.isclose(content.volume, expected, rel_tol=1e-9)
    assert math.isclose(content.mean_height or 0.0, 4.5 - mean_drop, rel_tol=1e-9)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("level", [0.15, 0.5])
def test_volume_level_and_area_agree_with_brute_force(shape: str, level: float) -> None:
    silo, feed = Silo(1.2, 2.5, 1.5), Feed(shape, level, seed=2)
    content = content_of(silo, feed)
    n = 1500
    axis = (np.arange(n) + 0.5) / n * 2.4 - 1.2
    places = np.stack(np.meshgrid(axis, axis), axis=-1)
    found = silo.feed_heights(feed, places)
    cell = (2.4 / n) ** 2
    thickness = np.nan_to_num(found - 1.5 * np.hypot(places[..., 0], places[..., 1]) / 1.2)
    assert math.isclose(content.volume, thickness.sum() * cell, rel_tol=3e-4)
    assert math.isclose(content.area, np.isfinite(found).sum() * cell, rel_tol=2e-3)
    assert math.isclose(np.nanmax(found), level * silo.height, abs_tol=2e-3)
    assert np.nanmax(found) <= level * silo.height + 1e-6
    assert math.isclose(content.max_height or 0.0, level * silo.height, abs_tol=1e-6)
    assert math.isclose(content.min_height or 0.0, np.nanmin(found), abs_tol=5e-3)


def test_level_of_a_discharge_falls_from_highest_to_lowest() -> None:
    scenes = list(discharge(small(SILO1), 5, highest=0.8, lowest=0.2))
    assert np.allclose([scene.feed.level for scene in scenes], [0.8, 0.65, 0.5, 0.35, 0.2])
    volumes = [scene.render().true_volume for scene in scenes]
    assert all(a > b for a, b in itertools.pairwise(volumes))
    assert len({scene.seed for scene in scenes}) == 5


def test_a_camera_above_the_edge_sees_only_through_the_opening() -> None:
    scene = Scene(Silo(1.0, 3.0, 1.0, top=1.0), SiloPose(0, 0, 0, 0), SMALL, None)
    frame = scene.render()
    x, y = np.moveaxis(SMALL.rays(), -1, 0)
    assert np.array_equal(frame.labels > 0, np.hypot(x, y) < 1.0)
    assert np.allclose(
        silo_points(frame)[frame.labels == 1][:, :2] @ np.eye(2), silo_points(frame)[frame.labels == 1][:, :2]
    )
    assert not frame.depth[frame.labels == 0].any()


def test_a_ray_that_looks_up_leaves_through_the_open_top_or_meets_the_roof() -> None:
    silo, pose = Silo(1.0, 3.0, 1.0, top=-0.2), SiloPose(1.5, 0.0, 0.0, 0.0)
    open_frame = Scene(silo, pose, SMALL, None).render()
    roofed = Scene(replace(silo, roof=True), pose, SMALL, None).render()
    assert (open_frame.labels == 0).any()
    assert np.array_equal(open_frame.labels == 0, roofed.labels == 4)
    assert np.allclose(silo_points(roofed)[roofed.labels == 4][:, 2], -0.2, rtol=0, atol=1e-12)


def test_the_outlet_is_a_pipe_with_a_closed_end() -> None:
    silo = Silo(1.0, 2.0, 1.0, outlet_radius=0.2, outlet_length=0.5, outlet_offset=(0.1, -0.05))
    camera = replace(SMALL, fx=300.0, fy=300.0)
    frame = Scene(silo, looking_at(silo, 0.3, 0.1), camera, None).render()
    x, y, z = silo_points(frame)[frame.labels == 4].T
    r = np.hypot(x - 0.1, y + 0.05)
    on_wall, on_end = np.abs(r - 0.2) < 1e-12, np.abs(z - 3.5) < 1e-12
    assert np.all(on_wall | on_end)
    assert on_wall.any()
    assert on_end.any()
    cone = silo_points(frame)[frame.labels == 2]
    assert np.all(np.hypot(cone[:, 0] - 0.1, cone[:, 1] + 0.05) >= 0.2 - 1e-12)


def test_random_scenes_are_the_same_for_the_same_seed_and_look_into_the_silo() -> None:
    assert random_scene(3) == random_scene(3)
    assert random_scene(3) != random_scene(4)
    for seed in range(30):
        frame = replace(random_scene(seed), camera=SMALL).render()
        assert (frame.labels > 0).mean() > 0.95


def test_looking_at_aims_the_optical_axis_at_the_vertex() -> None:
    silo = Silo(1.5, 1.9, 2.6, top=-0.3)
    pose = looking_at(silo, 0.6, -0.5)
    optical = pose.T_silo_camera[:3, 2]
    assert np.allclose(np.cross(optical, [-0.6, 0.5, 4.2]), 0, rtol=0, atol=1e-12)
    assert np.isclose(SILO2.pose.r_y, looking_at(SILO2.silo, 1.35, 0).r_y, rtol=0, atol=1e-5)


@pytest.mark.parametrize("field", ["radius", "cylinder_height", "cone_height", "top", "outlet_radius", "outlet_length"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -1e9, 1e9])
def test_impossible_silos_are_refused_by_name(field: str, value: Any) -> None:
    with pytest.raises(UsageError, match=field):
        replace(SILO1.silo, **{field: value})


@pytest.mark.parametrize("field", ["bias", "noise"])
def test_impossible_error_laws_are_refused(field: str) -> None:
    values: list[Any] = [(math.nan, 0, 0), (0.0, 0.0), "abc", None]
    for value in values:
        with pytest.raises(UsageError, match=field):
            SensorModel(**{field: value})


@pytest.mark.parametrize("field", ["dust", "dropout", "flying", "correlation", "unit", "noise_scale", "min_range"])
@pytest.mark.parametrize("value", [math.nan, -0.1, math.inf, "x"])
def test_impossible_sensor_numbers_are_refused_by_name(field: str, value: Any) -> None:
    with pytest.raises(UsageError, match=field):
        SensorModel(**{field: value})


@pytest.mark.parametrize(
    "feed",
    [
        Feed(level=1.5),
        Feed(level=math.nan),
        Feed("funnel", angle=1.6),
        Feed("funnel", tip=0.0),
        Feed("lumpy", lump_size=0.0),
        Feed("lumpy", lump_size=1e-12),
        Feed("lumpy", seed=-1),
        Feed("rathole", rathole_radius=0.0),
        Feed("rathole", rathole_centre=(9.0, 0.0)),
        Feed("tilted", tilt=2.0),
        Feed("tilted", tilt_azimuth=math.inf),
        Feed(centre=(math.nan, 0.0)),
    ],
)
def test_impossible_feeds_are_refused(feed: Feed) -> None:
    with pytest.raises(UsageError):
        small(SILO1, feed=feed).render()


@pytest.mark.parametrize("shape", ["", "sand", "gaussian+funnel", "lumpy+lumpy", "gaussian+"])
def test_unknown_feed_shapes_are_refused(shape: str) -> None:
    with pytest.raises(UsageError, match="feed shape"):
        Feed(shape)


@pytest.mark.parametrize("part", ["silo", "pose", "camera", "feed", "sensor", "defects", "seed", "world"])
def test_parts_of_another_kind_are_refused_by_name(part: str) -> None:
    with pytest.raises(UsageError, match=part):
        replace(SILO1, **{part: 1.5})  # type: ignore[arg-type]


def test_a_buried_or_outside_camera_and_bad_threads_are_refused() -> None:
    with pytest.raises(UsageError, match="bury"):
        small(SILO1, feed=Feed("flat", 1.0)).render()
    with pytest.raises(UsageError, match="inside the silo"):
        small(SILO1, pose=SiloPose(0, 0, 1.3, 0)).render()
    for threads in (0, -1, 10**6):
        with pytest.raises(UsageError):
            small(SILO1).render(threads)
    with pytest.raises(UsageError, match="r_x"):
        small(SILO1, pose=SiloPose(math.nan, 0, 0, 0)).render()
    with pytest.raises(UsageError, match="unknown scenario"):
        scenario("silo9")
