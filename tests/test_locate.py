"""The public `locate`: what comes through the door, and what does not."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import siloscope
from siloscope import Camera, Frame, InputError, SiloscopeError, UsageError
from siloscope.simulation.scenarios import scenario

SCENE = scenario("silo1")
CAMERA = replace(SCENE.camera, width=160, height=120, fx=142.6, fy=142.6, cx=79.5, cy=59.5)
SMALL = replace(SCENE, camera=CAMERA)
DEPTH = np.nan_to_num(SMALL.render().depth)


def test_every_form_of_the_same_frame_gives_the_same_pose() -> None:
    truth = SMALL.pose
    raw = np.round(DEPTH / 0.0001).astype(np.uint16)
    strided = np.asfortranarray(np.repeat(DEPTH, 2, axis=1))[:, ::2]
    points = np.dstack([CAMERA.rays() * DEPTH[..., None], DEPTH])
    forms: list[tuple[Any, dict[str, Any]]] = [
        (DEPTH, {}),
        (DEPTH.astype(np.float32), {}),
        (strided, {}),
        (raw, {"depth_unit": 0.0001}),
        (raw.astype(np.int32), {"depth_unit": 0.0001}),
        (np.round(DEPTH / 0.00001).astype(np.uint32), {"depth_unit": 0.00001}),
        (Frame(depth=raw, camera=CAMERA, depth_unit=0.0001), {}),
        (DEPTH.tolist(), {}),
        (np.ma.masked_less(np.where(DEPTH > 5.3, 0.7, DEPTH), 1.0), {}),
        (points, {}),
        (points.reshape(-1, 3), {}),
    ]
    for data, extra in forms:
        camera = None if isinstance(data, Frame) or np.shape(data)[-1] == 3 else CAMERA
        estimate = siloscope.locate(data, camera, **extra)
        assert estimate.pose is not None, estimate.message
        assert estimate.pose.t_x == pytest.approx(truth.t_x, abs=2e-3)
        assert estimate.pose.r_y == pytest.approx(truth.r_y, abs=2e-3)


def test_a_mask_and_a_box_leave_the_pose_where_it_is() -> None:
    mask = np.ones(DEPTH.shape, bool)
    mask[:, :40] = False
    for extra in ({"mask": mask}, {"crop": (-5, 5, -5, 5, 0.1, 3.5)}):
        estimate = siloscope.locate(DEPTH, CAMERA, **extra)
        assert estimate.t_x == pytest.approx(SMALL.pose.t_x, abs=1e-4)


BAD: dict[str, tuple[Any, dict[str, Any], type[SiloscopeError], str]] = {
    "objects": (np.array([[None, {}], [1, 2]], object), {}, InputError, "object"),
    "text": (np.array([["a", "b"]]), {}, InputError, "measurements"),
    "complex": (np.ones((120, 160), complex), {}, InputError, "complex"),
    "empty": (np.ones((0, 160)), {}, InputError, "empty"),
    "line": (np.ones(160), {}, InputError, "shape"),
    "four channels": (np.ones((120, 160, 4)), {}, InputError, "shape"),
    "raw without unit": (np.ones((120, 160), np.uint16), {}, InputError, "give depth_unit"),
    "raw with a wild unit": (np.ones((120, 160), np.uint16), {"depth_unit": 50.0}, InputError, "unit"),
    "millimetres as floats": (np.full((120, 160), 3000.0), {}, InputError, "millimetres"),
    "all NaN": (np.full((120, 160), np.nan), {}, InputError, "invalid"),
    "all sentinels": (np.full((120, 160), 65535, np.uint16), {"depth_unit": 0.001}, InputError, "invalid"),
    "another size": (np.ones((60, 80)), {}, InputError, "camera"),
    "mask of another shape": (DEPTH, {"mask": np.ones((2, 2), bool)}, InputError, "mask"),
    "empty box": (DEPTH, {"crop": (90, 91, 0, 1, 0, 1)}, InputError, "crop"),
    "box inside out": (DEPTH, {"crop": (1, 0, 0, 1, 0, 1)}, UsageError, "crop"),
    "raw with a unit of 0": (
        Frame(depth=np.ones((120, 160), np.uint16), depth_unit=0.001),
        {"depth_unit": 0.0},
        InputError,
        "unit",
    ),
    "map coordinates": (np.ones((500, 3)) * (5e5, 4e6, 100.0), {}, InputError, "4031 km"),
    "unknown method": (DEPTH, {"method": "magic"}, UsageError, "method"),
    "unknown sensor": (DEPTH, {"sensor": "magic"}, UsageError, "sensor"),
    "negative diameter": (DEPTH, {"diameter": -1.0}, UsageError, "diameter"),
    "diameter in words": (DEPTH, {"diameter": "2.5"}, UsageError, "diameter"),
    "no gravity": (DEPTH, {"gravity": (0, 0, 0)}, UsageError, "gravity"),
    "gravity in words": (DEPTH, {"gravity": "down"}, UsageError, "gravity"),
    "endless gravity": (DEPTH, {"gravity": (1e308, 1e308, 1e308)}, UsageError, "gravity"),
    "no threads": (DEPTH, {"threads": 0}, UsageError, "threads"),
    "threads that are none": (DEPTH, {"threads": float("nan")}, UsageError, "threads"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_refused_by_name(name: str) -> None:
    data, extra, error, word = BAD[name]
    with pytest.raises(error, match=word):
        siloscope.locate(data, CAMERA, **extra)


def test_depth_without_any_camera_is_refused() -> None:
    with pytest.raises(InputError, match="camera"):
        siloscope.locate(DEPTH)


def test_a_profile_lends_its_nominal_camera_and_says_so() -> None:
    estimate = siloscope.locate(SCENE.render().depth, sensor="orbbec-astra")
    assert "nominal" in estimate.config["intrinsics"]


@settings(max_examples=60, deadline=None)
@given(
    hnp.arrays(
        st.sampled_from([np.float32, np.float64]),
        hnp.array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=90),
        elements=st.floats(width=32, allow_nan=True, allow_infinity=True),
    )
)
def test_hostile_arrays_are_refused_never_answered(depth: np.ndarray[Any, Any]) -> None:
    height, width = depth.shape
    camera = Camera(width, height, 60.0, 60.0, width / 2, height / 2)
    try:
        estimate = siloscope.locate(depth, camera)
    except InputError:
        return
    assert estimate.status == "refused"
    assert estimate.reason is not None
    assert estimate.to_dict()["r_x"] is None


@pytest.mark.parametrize("world", ["noise", "flat", "slope", "sphere", "nothing"])
def test_what_is_no_silo_is_refused_with_a_reason(world: str) -> None:
    rays = SCENE.camera.rays()
    rng = np.random.default_rng(5)
    length2 = 1 + (rays**2).sum(axis=-1)
    depth = {
        "noise": rng.uniform(0.5, 6.0, rays.shape[:2]),
        "flat": np.full(rays.shape[:2], 3.0),
        "slope": 3.0 / (1 + 0.7 * rays[..., 0]),
        "sphere": 2.0 / np.sqrt(length2) + 1.5 * (1 / length2),
        "nothing": np.zeros(rays.shape[:2]),
    }[world]
    estimate = siloscope.locate(depth + (rng.normal(0, 0.002, depth.shape) if world != "nothing" else 0), SCENE.camera)
    assert estimate.status == "refused"
    assert estimate.message
    document = estimate.to_dict()
    assert document["T_silo_camera"] is None
    assert document["silo"]["radius"] is None
