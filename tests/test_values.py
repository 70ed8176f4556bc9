"""Results are values: pickled, copied, compared, shown, and worked on in other processes."""

from __future__ import annotations

import copy
import functools
import multiprocessing
import pickle
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

import siloscope
from silos import known, measured, scene
from siloscope import Calibration, Camera, Content, Estimate, Frame, _core
from siloscope.content import surface_map
from siloscope.simulation import ASTRA_S, Feed
from siloscope.simulation.scenarios import random_scene
from siloscope.types.by_value import ByValue, same
from siloscope.types.track import Track

HALF = Camera(width=320, height=240, fx=285.15, fy=285.15, cx=159.5, cy=119.5)
MOUND = Feed("mound", 0.4, angle=0.5)


@functools.cache
def frame(seed: int, world: str = "silo") -> Frame:
    """A frame of a silo drawn at random, or of what is no silo."""
    return replace(random_scene(seed, sensor=ASTRA_S), camera=HALF, world=world).render().frame()


def cloud(seed: int) -> np.ndarray[Any, Any]:
    f = frame(seed)
    assert f.camera is not None
    assert f.depth is not None
    depth = np.asarray(f.depth, float) * (f.depth_unit or 1.0)
    return (np.dstack([f.camera.rays(), np.ones_like(depth)]) * depth[..., None])[depth > 0.0]


@functools.cache
def estimates() -> tuple[Estimate, ...]:
    """Answers of every kind: known, unknown and lent sensors, priors, clouds, both methods, refused ones."""
    located = [siloscope.locate(frame(seed), sensor="orbbec-astra-s") for seed in range(300, 306)]
    located += [siloscope.locate(frame(seed), diameter=2.0, gravity=[0.0, 0.0, 9.81]) for seed in range(306, 309)]
    located += [siloscope.locate(frame(seed), method="shape-tensor") for seed in range(300, 302)]
    located += [siloscope.locate(frame(1, world), sensor="orbbec-astra-s") for world in ("corner", "sphere", "nothing")]
    located.append(siloscope.locate(frame(1, "wall"), method="shape-tensor"))
    located.append(siloscope.locate(cloud(300)))
    located.append(siloscope.locate(frame(301), sensor="orbbec-astra-s", start=located[1]))
    return tuple(located)


@functools.cache
def calibrations() -> tuple[Calibration, ...]:
    kept = [e for e in estimates() if e.method == "surface" and "gravity" not in e.extra]
    fused = siloscope.calibrate([kept[0]] * 4, sensor="orbbec-astra-s")
    averaged = siloscope.calibrate([kept[0]] * 4, sensor="orbbec-astra-s", rule="mean-of-last-10")
    refused = siloscope.calibrate([e for e in kept if not e.ok][:2], sensor="orbbec-astra-s")
    return fused, averaged, refused


@functools.cache
def contents() -> tuple[Content, ...]:
    full = scene(MOUND)
    cone_unknown = replace(known(full), silo=replace(known(full).silo, apex=None, cylinder_bottom=None))
    seen = full.render().frame()
    blind = replace(seen, depth=np.zeros_like(np.asarray(seen.depth)))
    found = [measured(full)[0], measured(scene(None))[0], measured(full, density=700.0, product=None)[0]]
    found += [siloscope.measure(seen, cone_unknown), siloscope.measure(blind, known(full))]
    return tuple(found)


@functools.cache
def track() -> Track:
    levels = [scene(replace(MOUND, level=level)) for level in (0.5, 0.4, 0.3)]
    frames = [replace(s.render().frame(), timestamp=1.7e9 + 3600.0 * i) for i, s in enumerate(levels)]
    return siloscope.track(frames, known(levels[0]))


def values() -> list[Any]:
    return [*estimates(), *calibrations(), *contents(), track()]


def held(value: Any) -> list[ByValue]:
    """A value, and the values in it."""
    inner = [getattr(value, field.name) for field in fields(value)]
    return [value, *(deep for one in inner if isinstance(one, ByValue) for deep in held(one))]


def pickled(value: Any) -> Any:
    return pickle.loads(pickle.dumps(value))


def test_the_population_holds_answers_and_refusals_of_every_kind() -> None:
    for kind in (estimates(), calibrations(), contents()):
        assert {value.status for value in kind} == {"ok", "refused"}
    assert {e.method for e in estimates() if not e.ok} == {"surface", "shape-tensor"}
    assert any(c.surface is None for c in contents() if c.ok)
    assert track().last is not None


@pytest.mark.parametrize("way", [pickled, copy.copy, copy.deepcopy])
def test_what_goes_through_a_pickle_or_a_copy_is_the_same(way: Callable[[Any], Any]) -> None:
    for value in values():
        for one in held(value):
            again = way(one)
            assert again is not one
            assert again == one
            assert hash(again) == hash(one)
            assert type(again) is type(one)
        if hasattr(value, "to_dict"):
            assert same(way(value).to_dict(), value.to_dict())


def test_a_pickle_leaves_out_what_can_be_worked_out_again() -> None:
    camera = Camera(640, 480, 570.3, 570.3, 319.5, 239.5)
    camera.rays()
    assert len(pickle.dumps(camera)) < 500
    assert pickled(camera) == camera
    for content in contents():
        small = len(pickle.dumps(content))
        if content.surface is not None:
            assert content.surface.heights.size  # kept from now on
            assert content.surface.std.size
        assert len(pickle.dumps(content)) == small < 40_000


def test_an_estimate_without_details_is_small() -> None:
    sizes = [len(pickle.dumps(replace(estimate, details=None))) for estimate in estimates()]
    assert max(sizes) <= 10_000, sizes


def test_details_keep_labels_and_start_through_a_pickle() -> None:
    for estimate in estimates():
        details = estimate.details
        if details is None or details.labels is None:
            continue
        again = pickled(estimate).details
        np.testing.assert_array_equal(again.labels, details.labels)
        assert again.wall == details.wall
        assert len(pickle.dumps(details)) < 250_000


def test_an_estimate_from_a_pickle_starts_a_frame_as_the_first_did() -> None:
    start = estimates()[0]
    found = [siloscope.locate(frame(300), sensor="orbbec-astra-s", start=one) for one in (start, pickled(start))]
    assert found[0] == found[1]
    assert "known_wall" in found[1].timing_ms


def test_labels_are_worked_out_by_the_fit_that_was_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    found = siloscope.locate(frame(302), sensor="orbbec-astra-s")
    labels = siloscope.locate(frame(302), sensor="orbbec-astra-s").details
    monkeypatch.setattr(_core, "fit_depth", None)
    assert found.details is not None
    assert found.details.labels is not None
    assert labels is not None
    assert found.details.labels is found.details.labels
    np.testing.assert_array_equal(found.details.labels, labels.labels)
    assert np.unique(found.details.labels).size > 1


def changed(value: Any) -> Any:
    """Something else of the same kind, as little else as can be."""
    if isinstance(value, np.ndarray):
        if not value.size:
            return np.zeros(1)
        other = value.copy()
        if other.dtype == bool:
            other.flat[0] = not other.flat[0]
        else:
            other.flat[-1] = np.nextafter(other.flat[-1], 2.0) if np.isfinite(other.flat[-1]) else 1.0
        return other
    if isinstance(value, bool):
        return not value
    if isinstance(value, float):
        return float(np.nextafter(value, 1e9))
    if isinstance(value, dict):
        return {**value, "another": 1.0}
    if isinstance(value, tuple):
        return (*value, "another")
    return "another"


def test_values_differ_where_any_part_of_them_does() -> None:
    for one in (part for value in values() for part in held(value)):
        for field in fields(one):
            if not field.init:
                continue
            other = replace(one, **{field.name: changed(getattr(one, field.name))})
            assert (one == other) is not field.compare, (type(one).__name__, field.name)
    assert estimates()[0] != "an estimate"


def test_times_do_not_make_answers_different() -> None:
    again = siloscope.locate(frame(300), sensor="orbbec-astra-s")
    assert again == estimates()[0]
    assert again.timing_ms != estimates()[0].timing_ms


def test_a_surface_from_a_pickle_has_the_same_values_everywhere() -> None:
    places = np.random.default_rng(3).uniform(-1.2, 1.2, (200, 2))
    surfaces = [content.surface for content in contents() if content.surface is not None]
    surfaces.append(surface_map(cloud(303), [0.0, 0.0, -1.0]))
    for surface in surfaces:
        again = pickled(surface)
        for name in ("heights", "std", "kinds", "x", "y", "axes"):
            np.testing.assert_array_equal(getattr(again, name), getattr(surface, name))
        np.testing.assert_array_equal(again.height(places), surface.height(places))
        assert again.shape == surface.shape
        assert pickled(again) == again


def located_there(seed: int) -> Estimate:
    return siloscope.locate(frame(seed), sensor="orbbec-astra-s")


def unchanged(value: Any) -> Any:
    return value


def test_values_cross_to_other_processes_and_back() -> None:
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        assert list(pool.map(located_there, range(300, 303))) == list(estimates()[:3])
        assert list(pool.map(unchanged, values())) == values()


def test_a_repr_fits_on_one_screen() -> None:
    for one in (part for value in values() for part in held(value)):
        lines = repr(one).splitlines()
        assert len(lines) <= 32, repr(one)
        assert max(map(len, lines)) <= 220, repr(one)
        assert lines[0].startswith(type(one).__name__)
    assert "status='refused'" in repr(estimates()[-4])
    assert f"r_x={estimates()[0].r_x}"[:10] in repr(estimates()[0])
