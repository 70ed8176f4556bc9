"""A small population, packed once for all tests of runs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import siloscope
from fleet import population
from siloscope.fleet import plan
from siloscope.fleet.pack import pack
from siloscope.fleet.settings import Settings, settings

ARCHIVES, FRAMES, WIDTH = 10, 20, 320
SHARD = 8
"""Frames a shard, so that a silo has several."""
FOLDED = 3
"""Silos without a calibration, which are calibrated from their own frames."""


@pytest.fixture(scope="session")
def archives(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return population.make(tmp_path_factory.mktemp("population"), ARCHIVES, FRAMES, WIDTH)


@pytest.fixture(scope="session")
def store(archives: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("sealed") / "store"
    pack(archives, place, shard_frames=SHARD)
    return place


@pytest.fixture(scope="session")
def calibrations(archives: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("calibrations")
    for path in archives[FOLDED:]:
        siloscope.calibrate(path, sensor=population.SENSOR).save(folder / f"{path.stem}.json")
    return folder


@pytest.fixture(scope="session")
def measuring() -> Settings:
    return settings(None, sensor=population.SENSOR, bottom="cone", product="wheat")


@pytest.fixture
def planned(store: Path, calibrations: Path, measuring: Settings, tmp_path: Path) -> Callable[[str], str]:
    """Plans the run in a new folder of a name; gives the folder."""

    def made(name: str) -> str:
        plan.make(store, tmp_path / name, calibrations, measuring)
        return str(tmp_path / name)

    return made
