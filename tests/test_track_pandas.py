"""A track as a data frame of the real pandas."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas
import pytest
from numpy.typing import NDArray

import siloscope
from siloscope import Camera, Frame
from siloscope.simulation import ASTRA_S
from siloscope.simulation.scenarios import scenario

CAMERA = Camera(160, 120, 142.6, 142.6, 79.5, 59.5)
SCENE = replace(scenario("silo1"), camera=CAMERA, sensor=ASTRA_S, seed=4)
TIMES = (1.7e9, 1.7e9 + 1800.25, 1.7e9 + 3600.0)


def seen(seed: int) -> NDArray[np.float32]:
    """The scene's depth with its own noise."""
    return np.nan_to_num(replace(SCENE, seed=seed).render().measured).astype(np.float32)


def tracked(times: tuple[float | None, ...]) -> siloscope.Track:
    """A track of frames at several times, the last of them dark."""
    silo = siloscope.calibrate([Frame(depth=seen(0), camera=CAMERA)], sensor="orbbec-astra-s", bottom="cone")
    depths = [*map(seen, range(len(times) - 1)), np.zeros((120, 160), np.float32)]
    frames = [Frame(depth=depth, camera=CAMERA, timestamp=at) for depth, at in zip(depths, times, strict=True)]
    return siloscope.track(frames, silo)


def test_readings_are_rows_with_their_time_as_index() -> None:
    track = tracked(TIMES)
    table = track.to_pandas()
    assert isinstance(table.index, pandas.DatetimeIndex)
    assert str(table.index.tz) == "UTC"
    assert table.index.name == "time_utc"
    assert [at.timestamp() for at in table.index] == pytest.approx(TIMES, abs=1e-3)
    assert table["volume_m3"].iloc[0] == track.readings[0].volume
    assert table["status"].tolist() == [reading.status for reading in track.readings]
    assert pandas.isna(table["volume_m3"].iloc[-1])
    assert pandas.api.types.is_float_dtype(table["volume_m3"])
    assert len(table.resample("1h")["volume_m3"].mean()) == 2


def test_readings_without_times_are_numbered() -> None:
    table = tracked((None, None)).to_pandas()
    assert table.index.tolist() == [0, 1]
    assert table["time_utc"].isna().all()
