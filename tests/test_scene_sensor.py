"""Every term of the sensor model does what its description says, measured on rendered frames."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from siloscope import Camera, UsageError, _core
from siloscope.simulation import ASTRA, ASTRA_S, Defects, Feed, Scene, SensorModel, SimulatedFrame, true_camera
from siloscope.simulation.scenarios import SILO1, SILO2
from siloscope.simulation.scene import FlatPixels

CAMERA = Camera(width=320, height=240, fx=285.0, fy=285.0, cx=159.5, cy=119.5)
SCENE = replace(SILO2, camera=CAMERA, feed=Feed("funnel", 0.3))


def measured(sensor: SensorModel, scene: Scene = SCENE, seed: int = 1) -> SimulatedFrame:
    return replace(scene, sensor=sensor, seed=seed).render()


def incidence(frame: SimulatedFrame) -> np.ndarray:
    rays = np.concatenate([CAMERA.rays(), np.ones((240, 320, 1))], axis=2)
    cosine = np.abs(np.sum(rays * frame.normals, axis=2)) / np.linalg.norm(rays, axis=2)
    return np.arccos(np.minimum(cosine, 1.0))


def test_readings_are_whole_raw_units_that_fit_into_16_bits() -> None:
    frame = measured(SensorModel(unit=1e-3))
    assert np.allclose(frame.measured / 1e-3, np.rint(frame.measured / 1e-3), rtol=0, atol=1e-6)
    assert np.abs(frame.measured - frame.depth).max() <= 0.5e-3 + 1e-12
    assert np.array_equal(frame.raw(), np.rint(frame.measured * 1000).astype(np.uint16))
    fine = measured(SensorModel(unit=1e-4))
    assert np.array_equal(fine.measured > 0, fine.depth < 6.55345)


def test_range_cuts_what_is_nearer_or_farther() -> None:
    frame = measured(replace(ASTRA_S, min_range=3.0, max_range=6.0))
    whole = measured(ASTRA_S)
    inside = (whole.measured >= 3.0) & (whole.measured <= 6.0)
    assert np.array_equal(frame.measured, np.where(inside, whole.measured, 0.0))
    assert np.array_equal(frame.measured_labels > 0, inside)


def test_surfaces_met_at_a_grazing_angle_give_nothing() -> None:
    limit = math.radians(75)
    frame = measured(SensorModel(max_incidence=limit))
    assert np.array_equal(frame.measured > 0, incidence(frame) <= limit)
    assert 0.1 < (frame.measured > 0).mean() < 0.9


def test_noise_grows_with_the_incidence_angle() -> None:
    frame = measured(SensorModel(noise_floor=1e-3, incidence_gain=0.2))
    angle = incidence(frame)
    sigma = 1e-3 * (1 + 0.2 * (angle / (math.pi / 2 - angle)) ** 2)
    score = (frame.measured - frame.depth) / sigma
    for low, high in [(0.0, 0.8), (0.8, 1.2), (1.2, 1.4), (1.4, 1.5)]:
        part = score[(angle >= low) & (angle < high)]
        assert part.size > 500
        assert abs(part.std() - 1) < 4 / math.sqrt(2 * part.size)


def test_stereo_noise_grows_with_the_depth_squared() -> None:
    frame = measured(SensorModel(noise_scale=0.0015, noise_power=2.0))
    near, far = frame.depth < 2.5, frame.depth > 4.5
    error = frame.measured - frame.depth
    for part in (near, far):
        sigma = 0.0015 * frame.depth[part] ** 2
        assert abs((error[part] / sigma).std() - 1) < 4 / math.sqrt(2 * part.sum())


def test_dropout_loses_its_share_pixel_by_pixel_or_in_patches() -> None:
    n = CAMERA.width * CAMERA.height
    single = measured(SensorModel(dropout=0.3)).measured == 0
    assert abs(single.mean() - 0.3) < 4 * math.sqrt(0.3 * 0.7 / n)
    assert abs(np.corrcoef(single[:, 1:].ravel(), single[:, :-1].ravel())[0, 1]) < 0.02
    patches = [measured(SensorModel(dropout=0.3, dropout_length=6.0), seed=s).measured == 0 for s in range(8)]
    assert abs(np.mean(patches) - 0.3) < 0.03
    assert np.corrcoef(patches[0][:, 1:].ravel(), patches[0][:, :-1].ravel())[0, 1] > 0.7


def test_correlated_noise_has_its_variance_and_its_neighbours_in_common() -> None:
    sensor = SensorModel(noise_floor=1e-2, correlation=0.6, correlation_length=5.0)
    errors = np.stack([(f := measured(sensor, seed=s)).measured - f.depth for s in range(12)]) / 1e-2
    assert abs(errors.std() - 1) < 0.02
    assert 0.5 < np.mean(errors[:, :, 1:] * errors[:, :, :-1]) < 0.62
    assert abs(np.mean(errors[:, :, 60:] * errors[:, :, :-60])) < 0.05


def test_the_warp_of_a_device_lasts_and_grows_with_the_depth_squared() -> None:
    sensor = SensorModel(warp=2e-3, warp_length=20.0)
    one, two = measured(sensor, seed=1), measured(sensor, seed=2)
    assert np.array_equal(one.measured, two.measured)
    field = (one.measured - one.depth) / one.depth**2 / 2e-3
    devices = [replace(sensor, warp_seed=s) for s in range(1, 10)]
    fields = [field, *((f := measured(d)).measured - f.depth for d in devices)]
    fields[1:] = [f / one.depth**2 / 2e-3 for f in fields[1:]]
    assert abs(np.std(fields) - 1) < 0.1
    assert np.corrcoef(field[:, 1:].ravel(), field[:, :-1].ravel())[0, 1] > 0.99


def test_the_bowl_adds_its_depth_at_the_corner_and_none_in_the_middle() -> None:
    frame = measured(SensorModel(bowl=0.02))
    v, u = np.mgrid[0:240, 0:320]
    expected = 0.02 * ((u - 159.5) ** 2 + (v - 119.5) ** 2) / (159.5**2 + 119.5**2)
    assert np.allclose(frame.measured - frame.depth, expected, rtol=0, atol=1e-12)


def test_the_second_imager_misses_a_band_on_the_left() -> None:
    frame = measured(SensorModel(baseline=0.1))
    u = np.arange(320)
    assert np.array_equal(frame.measured > 0, u * frame.depth >= 285.0 * 0.1)
    assert (frame.measured == 0).any()


def test_flying_pixels_lie_between_the_two_sides_of_an_edge() -> None:
    scene = replace(SCENE, defects=Defects(ladder=True))
    frame = measured(SensorModel(flying=0.6), scene)
    flying = frame.false_returns
    assert flying.sum() > 100
    padded = np.pad(frame.depth, 1, mode="edge")
    around = np.stack([padded[:-2, 1:-1], padded[2:, 1:-1], padded[1:-1, :-2], padded[1:-1, 2:]])
    low, high = np.minimum(around.min(0), frame.depth), np.maximum(around.max(0), frame.depth)
    assert np.all((frame.measured >= low) & (frame.measured <= high))
    steps = np.abs(around - frame.depth) > 0.03 * np.minimum(around, frame.depth)
    edge = steps.any(axis=0)
    assert np.array_equal(flying & ~edge, np.zeros_like(flying))
    share = flying[edge].mean()
    assert abs(share - 0.6) < 4 * math.sqrt(0.24 / edge.sum())
    assert np.all(frame.measured_labels[flying] == 4)
    assert np.array_equal(frame.measured[~flying], frame.depth[~flying])


def test_dust_lies_before_the_surface() -> None:
    frame = measured(SensorModel(dust=0.05, min_range=0.3))
    dust = frame.false_returns
    n = dust.size
    assert abs(dust.mean() - 0.05) < 4 * math.sqrt(0.05 * 0.95 / n)
    assert np.all(frame.measured[dust] < frame.depth[dust])
    assert np.all(frame.measured[dust] >= 0.3)
    assert np.array_equal(frame.measured[~dust], frame.depth[~dust])
    ratios = frame.pixel_ratios
    assert math.isclose(ratios.cylinder + ratios.cone + ratios.feed, 1 - dust.mean(), abs_tol=1e-12)


@pytest.mark.parametrize("device", ["none", "brown_conrady"])
def test_a_bent_lens_changes_the_rays_and_nothing_else(device: str) -> None:
    bent = replace(
        CAMERA, distortion_model=device, distortion=(0.05, -0.01, 1e-3, 1e-3, 0.0)[: 5 if device != "none" else 0]
    )
    frame = replace(SCENE, camera=bent, feed=None).render()
    rays = np.concatenate([bent.rays(), np.ones((240, 320, 1))], axis=2)
    x, y, _ = np.moveaxis(SCENE.pose.to_silo(rays * frame.depth[..., None]), -1, 0)
    on_wall = frame.labels == 1
    assert np.abs(np.hypot(x, y)[on_wall] - SCENE.silo.radius).max() < 1e-12


def test_the_binding_takes_any_layout_and_refuses_arrays_that_do_not_belong_together() -> None:
    frame = replace(SCENE, sensor=ASTRA_S, seed=1).render()
    depth, labels, normals = frame.depth.ravel(), frame.labels.ravel(), frame.normals.reshape(-1, 3)
    strided = FlatPixels(np.repeat(depth, 2)[::2], np.repeat(labels, 2)[::2], np.asfortranarray(normals))
    again = _core.measure_depth(ASTRA_S, CAMERA, strided, 1, 1)
    assert np.array_equal(again.depth, frame.measured.ravel())
    blank = _core.measure_depth(ASTRA_S, CAMERA, FlatPixels(depth * np.nan, labels, normals * np.nan), 1, 1)
    assert not blank.depth.any()
    for parts in [(depth[:-1], labels, normals), (depth[:0], labels, normals[:0]), (depth, labels, normals[:, :2])]:
        with pytest.raises(ValueError, match=r"normals|depth"):
            _core.measure_depth(ASTRA_S, CAMERA, FlatPixels(*parts), 1, 1)


def test_light_that_goes_round_lengthens_what_lies_in_a_hollow() -> None:
    silo = replace(SILO1, feed=None, sensor=SensorModel(multipath=0.2)).render()
    error = (silo.measured - silo.depth) / silo.depth
    assert 0.01 < error.mean() < 0.04
    assert error.min() > 0.0
    plane = replace(SILO1, world="wall", feed=None, sensor=SensorModel(multipath=0.2)).render()
    np.testing.assert_array_equal(plane.measured, plane.depth)


@pytest.mark.parametrize(("known", "f", "c", "k1"), [("calibrated", 0.002, 1.0, 0.003), ("nominal", 0.02, 6.4, 0.03)])
def test_cameras_are_off_by_what_is_said_of_them(known: str, f: float, c: float, k1: float) -> None:
    cameras = [true_camera(ASTRA, known, seed) for seed in range(400)]
    rows = np.array(
        [(d.fx / 570.3 - 1, d.fy / 570.3 - 1, d.cx - 319.5, d.cy - 239.5, d.distortion[0]) for d in cameras]
    )
    np.testing.assert_allclose(rows.std(axis=0), [f, f, c, c, k1], rtol=0.15)
    assert np.abs(np.corrcoef(rows.T) - np.eye(5)).max() < 0.2
    assert true_camera(ASTRA, known, 3) == cameras[3]
    assert true_camera(ASTRA, "exact", 3) == ASTRA
    with pytest.raises(UsageError, match="calibrated"):
        true_camera(ASTRA, "guessed", 0)


def test_a_frame_brings_the_camera_that_is_told() -> None:
    true = true_camera(ASTRA, "calibrated", 4)
    frame = replace(SILO1, camera=true, told=ASTRA).render()
    assert frame.frame().camera == ASTRA
    assert frame.camera == true
    assert "told" in frame.scene.to_dict()
    assert "told" not in SILO1.to_dict()
