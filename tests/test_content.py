"""The content of simulated silos: laws, exact truth, honest deviations, disasters."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import silos
import siloscope
from silos import known, measured, noisy, percent, scene
from siloscope.content import Datasheet
from siloscope.content.knowledge import know
from siloscope.errors import InputError, UsageError
from siloscope.reasons import CONTENT_REMARKS
from siloscope.simulation import ASTRA_S, PERFECT, Defects, Feed, Silo, defects
from siloscope.simulation.scenarios import random_scene
from siloscope.types.floor import Floor

PLACES = [(0.0, 0.0), (0.4, 0.2), (-0.8, 0.3), (0.2, -0.9)]

WALLED = replace(random_scene(7000, Feed("gaussian", 0.3), sensor=ASTRA_S), camera=silos.SMALL)
"""A silo of which the camera sees much wall."""


class TestLaws:
    def test_the_volume_does_not_depend_on_where_the_camera_hangs(self) -> None:
        feed = Feed("mound+tilted", 0.5, tilt=0.1)
        volumes = [measured(scene(feed, place=place))[0].volume for place in PLACES]
        capacity = silos.STOUT.capacity
        assert np.ptp(np.array(volumes, float)) < 1e-3 * capacity

    @pytest.mark.parametrize("height", [0.3, 0.9, 1.2, 1.5, 2.4])
    def test_a_level_surface_has_its_closed_form(self, height: float) -> None:
        """In the cone, just below the joint, at it, above it, in the cylinder."""
        silo = silos.STOUT
        content, _ = measured(scene(Feed("flat", height / silo.height)))
        in_cone = min(height, silo.cone_height)
        radius = silo.radius * in_cone / silo.cone_height
        volume = math.pi * radius**2 * in_cone / 3.0 + math.pi * silo.radius**2 * (height - in_cone)
        assert content.volume == pytest.approx(volume, abs=2e-4 * silo.capacity)
        assert content.level.mean == pytest.approx(height, abs=1e-3)
        for level in (content.level.min, content.level.max, content.level.at_axis, content.level.at_wall):
            assert level == pytest.approx(height, abs=3e-3)

    def test_what_is_added_is_the_rise_times_the_area(self) -> None:
        low, high = (measured(scene(Feed("funnel", level)))[0] for level in (0.62, 0.7))
        rise = 0.08 * silos.STOUT.height
        added = (high.volume or 0.0) - (low.volume or 0.0)
        assert added == pytest.approx(math.pi * silos.STOUT.radius**2 * rise, rel=2e-3)

    @pytest.mark.parametrize("s", [0.3, 4.0])
    def test_volume_goes_with_the_cube_of_the_size(self, s: float) -> None:
        base = scene(Feed("gaussian", 0.4))
        frame = base.render()
        calibration = known(base)
        assert calibration.parameters is not None
        assert calibration.pose is not None
        lengths = np.array([1, 1, s, s, s, 1, s, 1, 1, 1, 1, 1])
        pose = replace(calibration.pose, t_x=s * calibration.pose.t_x, t_y=s * calibration.pose.t_y)
        g = calibration.silo
        grown = replace(
            calibration,
            pose=pose,
            parameters=calibration.parameters * lengths,
            silo=siloscope.SiloGeometry(*(s * float(v) for v in (g.radius, g.cylinder_bottom, g.apex))),
        )
        one = siloscope.measure(frame.frame(), calibration).volume
        other = siloscope.measure(s * frame.depth, grown, frame.camera).volume
        assert other == pytest.approx(s**3 * (one or 0.0), rel=1e-4)

    @pytest.mark.parametrize("parameter", range(10))
    def test_a_parameters_deviation_is_what_moving_it_does(self, parameter: int) -> None:
        """The analytic derivatives against measuring anew with the parameter moved."""
        exact = replace(PERFECT, bias=ASTRA_S.bias)
        made = scene(Feed("gaussian+tilted", 0.55, tilt=0.1), place=(0.5, -0.2), sensor=exact)
        frame = made.render().frame()
        calibration = known(made)
        step = 2e-4
        covariance = np.zeros((12, 12))
        covariance[parameter, parameter] = step**2
        stated = siloscope.measure(frame, replace(calibration, parameter_covariance=covariance)).parts
        assert stated is not None
        part = stated.pose if parameter < 4 else stated.geometry if parameter < 7 else stated.depth
        moved = [siloscope.measure(frame, _moved(calibration, parameter, sign * step)).volume for sign in (1, -1)]
        change = abs((moved[0] or 0.0) - (moved[1] or 0.0)) / 2.0
        assert part == pytest.approx(change, rel=0.05, abs=2e-6 * made.silo.capacity)

    @pytest.mark.parametrize("parameter", [5, 6])
    def test_of_a_cone_alone_too(self, parameter: int) -> None:
        made = scene(Feed("mound", 0.2))
        frame = made.render().frame()
        calibration = _without_cylinder(known(made))
        step = 2e-4
        covariance = np.zeros((12, 12))
        covariance[parameter, parameter] = step**2
        stated = siloscope.measure(frame, replace(calibration, parameter_covariance=covariance)).parts
        assert stated is not None
        ends = [_without_cylinder(_moved(known(made), parameter, sign * step)) for sign in (1, -1)]
        moved = [siloscope.measure(frame, end).volume or 0.0 for end in ends]
        assert stated.geometry == pytest.approx(abs(moved[0] - moved[1]) / 2.0, rel=0.05)

    def test_a_calibrations_lengths_are_as_sure_as_it_says(self) -> None:
        frames = [noisy(scene(Feed("gaussian", level)), seed).render() for seed, level in enumerate((0.35, 0.3, 0.25))]
        calibration = siloscope.calibrate([frame.frame() for frame in frames], sensor="orbbec-astra-s", bottom="cone")
        std = calibration.silo_std
        found = np.sqrt(np.diag(know(calibration, None, Datasheet(), None, None).covariance))
        assert found[4:7] == pytest.approx([std.radius, std.cylinder_bottom, std.apex])
        assert found[:4] == pytest.approx(np.sqrt(np.diag(calibration.covariance)))

    def test_the_same_frame_gives_the_same_answer(self) -> None:
        frame = noisy(scene(Feed("funnel", 0.5))).render()
        calibration = known(frame.scene)
        first, second = (siloscope.measure(frame.frame(), calibration).to_dict() for _ in range(2))
        first.pop("timing_ms"), second.pop("timing_ms")
        assert first == second

    def test_how_the_frame_is_stored_does_not_matter(self) -> None:
        made = scene(Feed("mound", 0.5))
        frame = made.render()
        calibration = known(made)
        depth = frame.depth
        rays = made.camera.rays()
        points = np.dstack([rays[..., 0] * depth, rays[..., 1] * depth, depth]).reshape(-1, 3)
        strided = np.zeros((2 * depth.shape[0], 2 * depth.shape[1]))
        strided[::2, ::2] = depth
        answers = [
            siloscope.measure(data, calibration, camera).volume
            for data, camera in (
                (depth, made.camera),
                (np.asfortranarray(depth), made.camera),
                (strided[::2, ::2], made.camera),
                (depth.astype(np.float32), made.camera),
                (points, None),
            )
        ]
        raw = siloscope.measure(frame.raw(1e-4), calibration, made.camera, depth_unit=1e-4).volume
        assert np.ptp([float(v or 0.0) for v in answers]) < 1e-4 * made.silo.capacity
        assert raw == pytest.approx(answers[0], abs=1e-4 * made.silo.capacity)


def _without_cylinder(calibration: siloscope.Calibration) -> siloscope.Calibration:
    assert calibration.parameters is not None
    values = calibration.parameters.copy()
    values[4] = np.nan
    return replace(calibration, parameters=values, silo=siloscope.SiloGeometry(apex=calibration.silo.apex))


def _moved(calibration: siloscope.Calibration, parameter: int, step: float) -> siloscope.Calibration:
    assert calibration.parameters is not None
    values = calibration.parameters.copy()
    values[parameter] += step
    radius, slope, intercept = (float(v) for v in values[4:7])
    pose = siloscope.SiloPose(*(float(v) for v in values[:4]))
    silo = siloscope.SiloGeometry(radius, (intercept - radius) / slope, intercept / slope)
    return replace(calibration, parameters=values, pose=pose, silo=silo)


class TestTruth:
    def test_shapes_and_levels_of_exact_frames(self) -> None:
        """Volume errors in % of the capacity, seen from a place between axis and wall."""
        shapes = ("gaussian", "funnel", "mound", "tilted", "gaussian+lumpy")
        errors = [
            percent(*measured(scene(Feed(shape, level, lump_height=0.03 if "lumpy" in shape else None))))
            for shape in shapes
            for level in (0.65, 0.45, 0.2)
        ]
        assert np.median(np.abs(errors)) <= 0.02
        assert np.abs(errors).max() <= 0.3

    def test_deviations_are_honest_under_the_sensors_noise(self) -> None:
        misses = []
        for seed in range(6):
            for feed in (Feed("gaussian", 0.6), Feed("funnel", 0.4), Feed("mound", 0.25)):
                content, frame = measured(noisy(scene(feed, place=PLACES[seed % 4]), seed), sensor="orbbec-astra-s")
                assert content.volume is not None
                assert content.volume_std is not None
                misses.append((content.volume - frame.true_volume) / content.volume_std)
        assert np.abs(misses).max() < 3.0
        assert 0.3 < np.sqrt(np.mean(np.square(misses))) < 1.5

    def test_heights_and_coverage(self) -> None:
        content, frame = measured(scene(Feed("mound", 0.55, angle=0.5)))
        truth = frame.content
        assert content.height_datum == "cone-vertex"
        assert content.level.mean == pytest.approx(truth.mean_height, abs=5e-3)
        assert content.level.max == pytest.approx(truth.max_height, abs=0.03)
        assert content.level.min == pytest.approx(truth.min_height, abs=0.02)
        assert content.coverage is not None
        assert 0.5 < content.coverage <= 1.0
        surface = content.surface
        assert surface is not None
        x, y = np.meshgrid(surface.x, surface.y)
        exact = frame.scene.silo.feed_heights(frame.scene.feed, np.stack([x, y], -1))
        off = surface.heights - exact
        assert np.nanmedian(np.abs(off[surface.seen])) < 2e-3
        assert np.nanmax(np.abs(off) / (surface.std + 1e-2)) < 4.0

    def test_fill_and_free_volume(self) -> None:
        content, frame = measured(scene(Feed("flat", 0.5)))
        assert content.capacity == pytest.approx(frame.scene.silo.capacity)
        assert content.capacity_from == "calibration"
        assert content.fill_fraction == pytest.approx(frame.fill_fraction, abs=1e-3)
        assert content.free == pytest.approx(frame.scene.silo.capacity - frame.true_volume, rel=1e-3)

    @pytest.mark.parametrize(("shape", "sign"), [("mound", -1.0), ("funnel", 1.0)])
    def test_the_angle_of_repose_and_the_centre(self, shape: str, sign: float) -> None:
        content, _ = measured(scene(Feed(shape, 0.5, angle=0.5, centre=(0.2, -0.1))))
        found = content.shape
        assert found is not None
        assert found.form == shape
        assert found.flank == pytest.approx(sign * 0.5, abs=math.radians(2.0))
        assert found.centre is not None
        assert math.hypot(found.centre[0] - 0.2, found.centre[1] + 0.1) < 0.05

    def test_an_empty_silo_holds_nothing(self) -> None:
        content, frame = measured(noisy(scene(None)), sensor="orbbec-astra-s")
        assert content.ok
        assert frame.true_volume == 0.0
        assert content.volume is not None
        assert content.volume_std is not None
        assert 0.0 <= content.volume <= 2.0 * content.volume_std <= 2e-3 * frame.scene.silo.capacity

    def test_content_in_the_cone_needs_no_cylinder(self) -> None:
        made = scene(Feed("mound", 0.2))
        calibration = known(made)
        blind = _without_cylinder(calibration)
        frame = made.render()
        content = siloscope.measure(frame.frame(), blind)
        assert content.volume == pytest.approx(frame.true_volume, abs=1e-3 * made.silo.capacity)
        assert content.capacity is None
        full = replace(made, feed=Feed("flat", 0.6)).render()
        beyond = siloscope.measure(full.frame(), blind)
        assert beyond.volume is None
        assert beyond.missing == ("radius",)
        with_tape = siloscope.measure(full.frame(), blind, diameter=2.0 * made.silo.radius)
        assert with_tape.volume == pytest.approx(full.true_volume, abs=1e-3 * made.silo.capacity)
        taped = replace(blind, config={**blind.config, "diameter": 2.0 * made.silo.radius})
        assert siloscope.measure(full.frame(), taped).volume == with_tape.volume

    def test_a_small_heap_in_an_endless_cone_is_as_sure_as_with_the_cylinder(self) -> None:
        """The map's cells must fit the heap, not the cone continued up to a camera that sees no cylinder."""
        narrow = replace(silos.SMALL, fx=2.0 * silos.SMALL.fx, fy=2.0 * silos.SMALL.fy)
        made = replace(scene(Feed("mound", 0.12)), camera=narrow)
        calibration = known(made)
        blind = _without_cylinder(calibration)
        frame = made.render()
        with_wall, without = (siloscope.measure(frame.frame(), c) for c in (calibration, blind))
        assert without.volume == pytest.approx(frame.true_volume, abs=3.0 * (without.volume_std or 0.0))
        assert (without.volume_std or np.inf) < 2.0 * (with_wall.volume_std or 0.0)

    def test_an_unknown_scale_costs_three_times_itself(self) -> None:
        """The pose's place, all lengths and the scale together: V goes with the cube."""
        made = scene(Feed("funnel", 0.3), sensor=replace(PERFECT, bias=ASTRA_S.bias))
        calibration = known(made)
        values = calibration.parameters
        assert values is not None
        s = 0.01
        along = np.array([0, 0, *values[2:5], 0, values[6], 0, -(1 + values[8]), -2 * values[9], 0, 0])
        found = siloscope.measure(
            made.render().frame(), replace(calibration, parameter_covariance=s**2 * np.outer(along, along))
        )
        assert found.volume_std == pytest.approx(3.0 * s * (found.volume or 0.0), rel=0.03)

    def test_without_the_cone_there_is_a_level_but_no_volume(self) -> None:
        made = scene(Feed("flat", 0.7))
        calibration = known(made)
        assert calibration.parameters is not None
        values = calibration.parameters.copy()
        values[5:7] = np.nan
        seen = siloscope.SiloGeometry(radius=calibration.silo.radius)
        blind = replace(calibration, parameters=values, silo=seen, floor=Floor())
        content = siloscope.measure(made.render().frame(), blind)
        assert content.ok
        assert content.volume is None
        assert content.missing == ("bottom",)
        assert "--empty" in (content.message or "")
        assert content.height_datum == "lowest-seen"
        assert content.level.mean == pytest.approx(0.0, abs=5e-3)
        full = siloscope.measure(made.render().frame(), blind, cylinder=2.5, cone=1.2, top=0.0)
        assert full.volume == pytest.approx(made.render().true_volume, rel=1e-3)
        assert full.volume_std is not None
        assert full.volume_std > 0.01

    def test_without_a_calibration_the_frame_itself_must_do(self) -> None:
        shown = noisy(scene(Feed("gaussian", 0.3))).render()
        content = siloscope.measure(shown.frame(), sensor="orbbec-astra-s", bottom="cone")
        assert content.ok, content.message
        assert abs(percent(content, shown)) < 0.3
        assert "without a calibration" in content.assumed[0]
        hidden = noisy(scene(Feed("flat", 0.85), place=(0.0, 0.0))).render()
        refused = siloscope.measure(hidden.frame(), sensor="orbbec-astra-s")
        assert refused.status == "refused"
        assert refused.volume is None
        assert "calibration" not in (refused.message or "calibration"), "there is none to speak of"

    @given(level=st.floats(0.1, 0.7), tilt=st.floats(0.0, 0.3), x=st.floats(-0.8, 0.8), y=st.floats(-0.8, 0.8))
    @settings(max_examples=12, deadline=None)
    def test_any_tilted_surface(self, level: float, tilt: float, x: float, y: float) -> None:
        content, frame = measured(scene(Feed("tilted", level, tilt=tilt), place=(x, y)))
        assert content.ok, content.message
        assert abs(percent(content, frame)) < 0.15

    def test_an_oval_silo(self) -> None:
        made = scene(Feed("gaussian", 0.3), defects=Defects(ovality=0.02, ovality_azimuth=0.4))
        calibration = known(made)
        assert calibration.parameters is not None
        values = calibration.parameters.copy()
        values[10:] = 0.02 * math.cos(0.8), 0.02 * math.sin(0.8)
        frame = made.render()
        exact = siloscope.measure(frame.frame(), replace(calibration, parameters=values))
        truth = frame.true_volume * (1.0 + 0.5 * 0.02**2)
        assert exact.volume == pytest.approx(truth, abs=1e-3 * made.silo.capacity)


class TestClutter:
    def test_feed_stuck_on_the_wall_is_told_and_not_counted(self) -> None:
        stuck = Defects(film_bands=((1.3, 1.7, 0.12),))
        content, frame = measured(scene(Feed("flat", 0.5), silo=silos.STOUT, defects=stuck))
        assert content.ok, content.message
        assert abs(percent(content, frame)) < 1.0

    def test_feed_on_the_wall_is_no_move_of_the_camera(self) -> None:
        made = replace(WALLED, defects=defects("film", 7000))
        content, frame = measured(made)
        assert [remark.code for remark in content.quality] == ["stuck-feed"]
        assert abs(percent(content, frame)) < 0.05

    def test_a_small_move_of_the_camera_widens_the_deviation_and_a_larger_one_refuses(self) -> None:
        def seen(move: float) -> siloscope.Content:
            pose = replace(WALLED.pose, t_x=WALLED.pose.t_x + move, r_y=WALLED.pose.r_y + move / 3.0)
            return siloscope.measure(replace(WALLED, pose=pose).render().frame(), known(WALLED, 1e-4))

        still, little, much = (seen(move) for move in (0.0, 0.003, 0.006))
        assert still.quality == ()
        assert little.ok
        assert little.has("camera-moved")
        assert (little.volume_std or 0.0) > (still.volume_std or 0.0)
        assert much.reason == "camera-moved"

    def test_a_ladder_and_cables_do_not_count_as_content(self) -> None:
        bare = scene(Feed("gaussian", 0.4), place=(-0.3, 0.2))
        full = replace(bare, defects=Defects(ladder=True, cables=3))
        content, frame = measured(full)
        assert content.ok, content.message
        assert abs(percent(content, frame)) < 0.3

    def test_a_rathole_is_seen_and_its_volume_is_missing_from_the_content(self) -> None:
        content, frame = measured(scene(Feed("flat+rathole", 0.6), place=(0.4, 0.2)))
        assert abs(percent(content, frame)) < 0.6
        assert content.has("rathole")

    @pytest.mark.parametrize("share", [0.02, 0.3])
    def test_dust_is_told_and_does_not_shift_the_surface(self, share: float) -> None:
        dusty = replace(ASTRA_S, dust=share, min_range=0.3)
        made = replace(scene(Feed("mound", 0.4)), sensor=dusty, seed=3)
        content, frame = measured(made, sensor="orbbec-astra-s")
        assert content.has("dust-or-fog")
        assert abs(percent(content, frame)) < 0.1

    def test_dropouts_only_cost_coverage(self) -> None:
        made = replace(scene(Feed("mound", 0.4)), sensor=replace(ASTRA_S, dropout=0.6), seed=3)
        content, frame = measured(made, sensor="orbbec-astra-s")
        assert abs(percent(content, frame)) < 0.1


def _moved_camera() -> siloscope.Content:
    made = scene(Feed("gaussian", 0.4))
    pose = replace(made.pose, t_x=made.pose.t_x + 0.06, r_y=made.pose.r_y + 0.02)
    return siloscope.measure(replace(made, pose=pose).render().frame(), known(made))


def _filling() -> siloscope.Content:
    before, _ = measured(scene(Feed("mound", 0.4)))
    made = scene(Feed("mound", 0.42))
    return siloscope.measure(made.render().frame(), known(made), previous=before)


def _filmy() -> siloscope.Content:
    made = scene(Feed("gaussian", 0.4))
    depth = made.render().depth
    depth[:, 200:] = 0.0
    return siloscope.measure(depth, known(made), made.camera)


def _buried() -> siloscope.Content:
    made = noisy(scene(Feed("gaussian", 0.4)))
    noise = 0.05 + 0.01 * np.random.default_rng(0).random(made.render().depth.shape)
    return siloscope.measure(noise, known(made), made.camera, sensor="orbbec-astra-s")


def _obstructed() -> siloscope.Content:
    made = scene(Feed("gaussian", 0.4))
    depth = made.render().depth
    depth[90:150, 120:200] = 1.0
    return siloscope.measure(depth, known(made), made.camera)


def _nothing() -> siloscope.Content:
    made = scene(Feed("gaussian", 0.4))
    return siloscope.measure(np.zeros((240, 320), np.float32), known(made), made.camera)


def _partly() -> siloscope.Content:
    made = scene(Feed("flat", 0.8), place=(0.9, 0.0))
    return siloscope.measure(made.render().frame(), known(made))


def _other_silo() -> siloscope.Content:
    made = scene(Feed("gaussian", 0.2))
    short = replace(made, silo=Silo(radius=1.25, cylinder_height=1.6, cone_height=1.2), feed=Feed("gaussian", 0.2))
    return siloscope.measure(made.render().frame(), known(short))


def _without_radius() -> siloscope.Calibration:
    made = known(scene(None))
    assert made.parameters is not None
    values = made.parameters.copy()
    values[4:7] = np.nan
    return replace(made, parameters=values, silo=siloscope.SiloGeometry(), floor=Floor())


def _deep() -> siloscope.Content:
    """The surface lies beyond the Astra's 8 m: nothing comes back from it."""
    made = scene(Feed("flat", 0.1), silo=Silo(radius=1.25, cylinder_height=10.0, cone_height=1.2))
    made = replace(made, sensor=replace(ASTRA_S, max_range=8.0))
    return siloscope.measure(made.render().frame(), known(made), sensor="orbbec-astra-s")


CASES: dict[str, Callable[[], siloscope.Content]] = {
    "too-little-seen": _nothing,
    "partly-seen": _partly,
    "sensor-buried": _buried,
    "dust-or-fog": lambda: measured(
        replace(scene(Feed("mound", 0.4)), sensor=replace(ASTRA_S, dust=0.1, min_range=0.3)), sensor="orbbec-astra-s"
    )[0],
    "lens-film": _filmy,
    "obstruction": _obstructed,
    "stuck-feed": lambda: measured(scene(Feed("flat", 0.3), defects=Defects(film_bands=((1.9, 2.3, 0.12),))))[0],
    "rathole": lambda: measured(scene(Feed("flat+rathole", 0.6), place=(0.4, 0.2)))[0],
    "filling-in-progress": _filling,
    "camera-moved": _moved_camera,
    "below-the-floor": _other_silo,
    "radius-unknown": lambda: siloscope.measure(np.ones((240, 320), np.float32), _without_radius(), silos.SMALL),
    "beyond-range": _deep,
    "bottom-unknown": lambda: measured(scene(Feed("mound", 0.4)), bottom="unknown")[0],
    "vessel-contradicted": lambda: measured(scene(Feed("mound", 0.4)), diameter=2.6)[0],
}


class TestQuality:
    @pytest.mark.parametrize("code", CONTENT_REMARKS)
    def test_every_code_has_a_case_that_shows_it(self, code: str) -> None:
        content = CASES[code]()
        assert content.has(code), (content.status, content.quality)
        remark = next(r for r in content.quality if r.code == code)
        assert remark.message == CONTENT_REMARKS[code][0]
        assert remark.to_dict()["advice"]
        assert remark.severity in ("note", "warning", "refusal")
        if remark.refuses:
            assert content.status == "refused"
            assert content.volume is None
            assert content.to_dict()["level_m"]["mean"] is None

    def test_a_clean_frame_has_no_remark(self) -> None:
        for level in (0.15, 0.4, 0.6):
            content, _ = measured(noisy(scene(Feed("gaussian", level))), sensor="orbbec-astra-s")
            assert content.quality == (), level


class TestDisasters:
    @pytest.mark.parametrize(
        "depth",
        [np.full((240, 320), np.nan), np.zeros((0, 0)), np.zeros((4, 5)), np.full((240, 320), -1.0), "text", None],
    )
    def test_what_is_no_frame_is_refused_by_name(self, depth: object) -> None:
        made = scene(Feed("flat", 0.4))
        with pytest.raises(InputError, match=r"frame|depth|array"):
            siloscope.measure(depth, known(made), made.camera)  # type: ignore[arg-type]

    def test_random_frames_never_crash(self) -> None:
        made = scene(Feed("flat", 0.4))
        draw = np.random.default_rng(5)
        for spread in (0.01, 0.5, 3.0, 50.0):
            depth = np.abs(draw.normal(2.0, spread, (240, 320)))
            depth[draw.random(depth.shape) < 0.2] = np.nan
            content = siloscope.measure(depth, known(made), made.camera)
            assert content.status in ("ok", "refused")

    @pytest.mark.parametrize("count", [1, 3, 30, 300])
    def test_a_few_points_are_refused_not_guessed(self, count: int) -> None:
        made = scene(Feed("flat", 0.4))
        depth = np.zeros((240, 320))
        depth.flat[np.random.default_rng(0).choice(depth.size, count, replace=False)] = 2.0
        content = siloscope.measure(depth, known(made), made.camera)
        assert content.status == "refused"
        assert content.volume is None

    def test_settings_out_of_bounds(self) -> None:
        made = scene(Feed("flat", 0.4))
        frame, calibration = made.render().frame(), known(made)
        for bad in (
            {"density": -1.0},
            {"density": 600.0, "product": "wheat"},
            {"product": "gravel-of-mars"},
            {"density_std": 5.0},
            {"diameter": 0.0},
            {"diameter": 3.0},
            {"bottom": "round"},
            {"bottom": "flat", "cone": 1.0},
            {"cone": -1.0},
            {"outlet_diameter": 100.0},
            {"sensor": "orbbec-astra-s"},
        ):
            with pytest.raises(UsageError):
                siloscope.measure(frame, calibration, **bad)
        with pytest.raises(InputError, match="no answer"):
            siloscope.measure(frame, siloscope.Calibration("refused", reason="no-frame-answers"))
        with pytest.raises(InputError):
            siloscope.measure(frame, "no-such-file.json")
