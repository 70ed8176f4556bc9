"""Sensor profiles: those of the library, and files that are none."""

from __future__ import annotations

from pathlib import Path

import pytest

from siloscope import InputError, UsageError, sensors


@pytest.mark.parametrize("name", sensors.names())
def test_every_shipped_profile_says_where_it_comes_from(name: str) -> None:
    profile = sensors.load(name)
    assert profile.source
    near, far = profile.range
    assert 0.0 < near < far < 100.0
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
