"""The examples run, and on the real recordings they find what others found."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import realdata

EXAMPLES = Path(__file__).parents[1] / "examples"


def example(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def run(name: str, *arguments: str, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    module = example(name)
    monkeypatch.setattr(sys, "argv", [name, *arguments])
    module.main()
    return module


def degrees_apart(one: np.ndarray, other: np.ndarray) -> float:
    sine = np.linalg.norm(np.cross(one, other)) / np.linalg.norm(one) / np.linalg.norm(other)
    return float(np.degrees(np.arcsin(np.minimum(1.0, sine))))


def test_every_example_is_tested() -> None:
    tested = {"locate_simulated", "locate_mug", "locate_pot", "locate_tank", "measure_discharge"}
    assert {path.stem for path in EXAMPLES.glob("*.py")} == tested


def test_simulated(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    run("locate_simulated", monkeypatch=monkeypatch)
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["surface", "shape-tensor"]
    assert all("Eq. 11" in line for line in lines)


def test_discharge(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    run("measure_discharge", monkeypatch=monkeypatch)
    volume, surface, event = capsys.readouterr().out.splitlines()
    assert "m³" in volume
    assert surface.startswith("funnel")
    assert event.startswith("withdrawal")


def test_mug_agrees_with_pcls_cylinder(monkeypatch: pytest.MonkeyPatch) -> None:
    path = str(realdata.path("pcl_mug_cylinder", "table_scene_mug_stereo_textured.pcd"))
    mug = run("locate_mug", path, monkeypatch=monkeypatch)
    estimate = mug.locate(path)
    assert degrees_apart(estimate.pose.axis_direction, mug.PCL_AXIS) < 2.0
    beside = np.cross(mug.PCL_POINT - estimate.pose.axis_point, estimate.pose.axis_direction)
    assert np.linalg.norm(beside) < 5e-3
    assert estimate.silo.radius == pytest.approx(mug.PCL_RADIUS, abs=3e-3)


def test_pot_stands_on_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    path = str(realdata.path("mosd_kinect_cylindric", "learn36.pcd"))
    pot = run("locate_pot", path, monkeypatch=monkeypatch)
    assert degrees_apart(pot.locate(path).pose.axis_direction, pot.TABLE_NORMAL) < 4.0


def test_tank_is_plumb(monkeypatch: pytest.MonkeyPatch) -> None:
    path = str(realdata.path("tank_total_station", "scan.csv"))
    tank = run("locate_tank", path, monkeypatch=monkeypatch)
    estimate = tank.locate(path)
    assert degrees_apart(estimate.pose.axis_direction, np.array([0.0, 0.0, 1.0])) < 1.0
