"""Sensor profiles: those of the library, and files that are none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import siloscope
from siloscope import Camera, InputError, UsageError, sensors
from siloscope.simulation import SensorModel
from siloscope.simulation.scenarios import random_scene
from siloscope.types.intrinsics import IntrinsicsStd

SMALL = Camera(width=96, height=72, fx=85.5, fy=85.5, cx=47.5, cy=35.5)


@pytest.mark.parametrize("name", sensors.names())
def test_every_shipped_profile_says_where_it_comes_from(name: str) -> None:
    profile = sensors.load(name)
    assert profile.source
    near, far = profile.range
    assert 0.0 < near < far < (500.0 if name == "livox-avia" else 100.0)
    assert all((sigma := profile.sigma(depth)) is None or 0.0 < sigma < 0.1 * far for depth in (near, far))


BAD = {
    "not TOML": ("[[[", "docs/your-frame.md"),
    "not text": (b"name = '\xff'", "docs/your-frame.md"),
    "unknown entry": ("colour = 1", "'colour'"),
    "range of one": ("range = [1.0]", "range"),
    "range that is none": ("range = 5", "range"),
    "range inside out": ("range = [5.0, 1.0]", "range"),
    "range of words": ("range = ['near', 'far']", "range"),
    "bias that is none": ("bias = 0.1", "[bias]"),
    "bias in words": ("[bias]\noffset = 'small'", "bias.offset"),
    "negative deviation": ("[bias]\nscale_std = -0.1", "bias.scale_std"),
    "depth that shrinks": ("[bias]\nquadratic = -1.0", "does not grow"),
    "no noise": ("[noise]\nconstant = 0.0", "must be positive"),
    "endless noise": ("[noise]\nconstant = 0.001\npower_factor = 1.0\npower = 1e6", "noise.power"),
    "intrinsics that are none": ("intrinsics = 5", "[[intrinsics]]"),
    "intrinsics in words": ("[[intrinsics]]\nwidth = 'a'\nheight = 3\nfx = 1\nfy = 1\ncx = 1\ncy = 1", "width"),
    "half of the deviations": ("[intrinsics_std]\nf = 0.02", "intrinsics_std.c"),
    "a negative deviation of f": ("[intrinsics_std]\nf = -0.02\nc = 0.01\nk1 = 0.03", "intrinsics_std.f"),
    "half of the intrinsics": ("[[intrinsics]]\nwidth = 640", "[[intrinsics]]"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_profile_is_refused_by_name(name: str, tmp_path: Path) -> None:
    content, told = BAD[name]
    path = tmp_path / "mine.toml"
    path.write_bytes(content if isinstance(content, bytes) else str(content).encode())
    with pytest.raises(InputError) as refused:
        sensors.load(path)
    assert str(path) in str(refused.value)
    assert told in str(refused.value)


def test_a_name_that_is_none_lists_those_that_are() -> None:
    with pytest.raises(UsageError, match="orbbec-astra-s"):
        sensors.load("my-own-eye")


def test_nominal_cameras_are_as_uncertain_as_the_profile_says() -> None:
    """A frame without a camera of its own is seen by the profile's, whose deviations are in the answer."""
    depth = np.zeros((480, 640), np.float32)

    def stated(**known: Any) -> dict[str, float]:
        return siloscope.locate(depth, sensor="realsense-d415", **known).config["intrinsics_std"]

    own = sensors.load("realsense-d415").camera(640, 480)
    assert own is not None
    assert stated() == stated(camera=own, intrinsics="nominal") == {"f": 0.03, "c": 6.4, "k1": 0.03}
    assert stated(camera=own) == {"f": 0.002, "c": 1.0, "k1": 0.003}
    told = replace(own, intrinsics_std=IntrinsicsStd(0.001, 0.5, 0.0))
    assert stated(camera=told) == {"f": 0.001, "c": 0.5, "k1": 0.0}
    assert stated(camera=told, intrinsics="exact") == {"f": 0.0, "c": 0.0, "k1": 0.0}
    assert sensors.UNKNOWN.nominal_std(own).f == 0.02


@pytest.mark.parametrize("name", ["azure-kinect", "realsense-l515"])
def test_times_of_flight_leave_room_for_light_that_goes_round(name: str) -> None:
    """The rms of the scale that the simulator's light makes in silos of usual reflectance."""
    scales = []
    for seed in range(12):
        sensor = SensorModel(multipath=0.05 + 0.15 * seed / 11)
        frame = replace(random_scene(seed, sensor=sensor), camera=SMALL).render()
        scales.append(float((frame.measured / frame.depth).mean()) - 1.0)
    rms = np.sqrt(np.mean(np.square(scales)))
    assert 0.5 * rms < sensors.load(name).bias_std[1] < 2.0 * rms
