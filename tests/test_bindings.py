"""The compiled core's border: names instead of tuples and tables, arrays of any layout."""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import siloscope
from siloscope import _core
from siloscope.estimation.inputs import metres
from siloscope.estimation.priors import Priors
from siloscope.types.depth_frame import DepthFrame
from test_values import HALF, cloud, frame

STUB = Path(siloscope.__file__).parent / "_core.pyi"
PICKLED = "__getnewargs__"


def test_calls_are_short_and_results_have_names() -> None:
    calls = [node for node in ast.walk(ast.parse(STUB.read_text("utf-8"))) if isinstance(node, ast.FunctionDef)]
    assert len(calls) > 100
    for call in calls:
        given = [*call.args.posonlyargs, *call.args.args, *call.args.kwonlyargs]
        assert len([one for one in given if one.arg not in ("self", "cls")]) <= 6, call.name
        assert "dict" not in ast.unparse(call), call.name
        named = any(ast.unparse(decorator) == "property" for decorator in call.decorator_list)
        assert named or call.name == PICKLED or "tuple" not in ast.unparse(call), call.name


def test_classes_of_the_core_are_frozen() -> None:
    found = _core.fit_depth(depth_frame(), Priors(siloscope.sensors.load("orbbec-astra-s")))
    assert isinstance(found, _core.SurfaceFit)
    parts: list[tuple[Any, str]] = [(found, "chi_square"), (found.factor, "step"), (found.warm_start, "inside")]
    for one, name in [*parts, (found.coverage, "counts"), (_core.refusals()[0], "slug")]:
        for attribute in (name, "another"):
            with pytest.raises(AttributeError):
                setattr(one, attribute, 1.0)


def depth_frame(seed: int = 304) -> DepthFrame:
    return DepthFrame(metres(frame(seed)), HALF, HALF.rays())


def layouts(array: np.ndarray[Any, Any]) -> list[np.ndarray[Any, Any]]:
    """The same array laid out otherwise: by columns, with gaps, backwards, off the words of memory."""
    gaps = np.repeat(np.repeat(array, 2, axis=0), 2, axis=1)[::2, ::2]
    unaligned = np.frombuffer(b"\0" + array.tobytes(), np.uint8)[1:].view(array.dtype).reshape(array.shape)
    assert not unaligned.flags.aligned
    return [np.asfortranarray(array), gaps, np.ascontiguousarray(array[::-1, ::-1])[::-1, ::-1], unaligned]


def test_arrays_of_any_layout_are_read_right() -> None:
    depth = metres(frame(304))
    priors = Priors(siloscope.sensors.load("orbbec-astra-s"))
    frames = [
        DepthFrame(d, HALF, r)
        for d, r in zip([depth, *layouts(depth)], [HALF.rays(), *layouts(HALF.rays())], strict=True)
    ]
    found = [_core.fit_depth(f, priors) for f in frames]
    for one, f in zip(found, frames, strict=True):
        assert isinstance(one, _core.SurfaceFit)
        assert isinstance(found[0], _core.SurfaceFit)
        np.testing.assert_array_equal(one.parameters, found[0].parameters)
        np.testing.assert_array_equal(one.labels(f), found[0].labels(frames[0]))
    points = cloud(304)
    for layout in layouts(points):
        one, other = (_core.fit_points(p, priors, 0.05) for p in (points, layout))
        assert isinstance(one, _core.SurfaceFit)
        assert isinstance(other, _core.SurfaceFit)
        np.testing.assert_array_equal(one.parameters, other.parameters)


def test_arrays_without_measurements_are_refused_and_wrong_ones_named() -> None:
    priors = Priors(siloscope.sensors.load(None))
    for empty in (np.zeros((240, 320), np.float32), np.full((240, 320), np.nan, np.float32)):
        found = _core.fit_depth(DepthFrame(empty, HALF, HALF.rays()), priors)
        assert isinstance(found, _core.Refusal)
        assert found.slug == "no-depth"
        assert found in _core.refusals()
    for nothing in (np.zeros((0, 3)), np.full((100, 3), np.nan)):
        assert isinstance(_core.fit_points(nothing, priors, 0.05), _core.Refusal)
    with pytest.raises(ValueError, match=r"\(N, 3\)"):
        _core.fit_points(np.zeros((3, 4)), priors, 0.05)
    with pytest.raises(ValueError, match="camera"):
        _core.fit_depth(DepthFrame(np.zeros((320, 240), np.float32), HALF, HALF.rays()), priors)
    with pytest.raises(ValueError, match="rays"):
        _core.fit_depth(DepthFrame(np.zeros((240, 320), np.float32), HALF, np.zeros((320, 240, 2))), priors)
    with pytest.raises(ValueError, match="float32"):
        _core.fit_depth(DepthFrame(np.zeros((240, 320)), HALF, HALF.rays()), priors)


def test_a_lens_that_distorts_needs_its_rays() -> None:
    bent = replace(HALF, distortion_model="brown_conrady", distortion=(0.05,))
    depth = np.ones((240, 320), np.float32)
    with pytest.raises(ValueError, match="rays"):
        _core.back_project(DepthFrame(depth, bent))
    points = _core.back_project(DepthFrame.of(depth, bent))
    np.testing.assert_array_equal(points[:, :2], bent.rays().reshape(-1, 2))
