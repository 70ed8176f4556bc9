"""Tables 6 and 7, Fig. 16: four sensors in one empty silo (sections 2.4.5 and 3.4)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from siloscope.reproduction.evaluation import published
from siloscope.reproduction.evaluation.chapter import Chapter, Picture, Verdict
from siloscope.reproduction.evaluation.plan import Plan
from siloscope.reproduction.evaluation.series import Numbers
from siloscope.reproduction.evaluation.tables import Cell, Table, number
from siloscope.reproduction.evaluation.verdicts import holds, judged, listed, millimetres
from siloscope.reproduction.jobs import Job
from siloscope.reproduction.running import Results
from siloscope.reproduction.sensor_trials import ACCELEROMETER_STD, SPACING, TRUTH, WITH_GRAVITY, SensorTrial
from siloscope.reproduction.solvers import ALL, SOLVERS
from siloscope.simulation import metrics
from siloscope.simulation.stand_ins import FOUR_SENSORS, Mounted
from siloscope.types.pose import SiloPose

DEVICES = 10
"""Devices of each kind: the paper had one; what one device does is chance."""

INTRODUCTION = f"""
The empty silo of section 2.4.5 (stand-in: simulated), each sensor with its own intrinsics, noise law and pose. Every
kind of sensor is tried with several devices, each with its own bias within what the profile leaves open. The distance
of Table 6 is that of the adjusted cloud to the ideal silo's cloud, a point every {1e3 * SPACING:g} mm; the column "true
pose" says what of it is the sensor's own error, which no pose takes away. Accelerometers err by
{1e3 * ACCELEROMETER_STD:g} mrad (one standard deviation) in each direction.
"""

COLUMNS = (TRUTH, *ALL)


def jobs(plan: Plan) -> list[Job]:
    """Every device of every kind."""
    return [trial for mounted in FOUR_SENSORS for trial in _trials(mounted, plan)]


def _trials(mounted: Mounted, plan: Plan) -> list[SensorTrial]:
    return [SensorTrial(mounted, device) for device in range(plan.few(DEVICES))]


def chapter(plan: Plan, results: Results) -> Chapter:
    """What came out."""
    found = {mounted.name: [results[trial] for trial in _trials(mounted, plan)] for mounted in FOUR_SENSORS}
    return Chapter(
        "Four sensors (section 3.4): stand-ins",
        (INTRODUCTION, _table6(found), _table7(found), _picture(found)),
        (_range(found), *_table7_verdicts(found)),
    )


def _table6(found: dict[str, list[dict[str, Any]]]) -> Table:
    head = ("sensor (stand-in)", "PC average distance, mm", "paper", TRUTH, *(SOLVERS[name].heading for name in ALL))
    rows: list[tuple[Cell, ...]] = []
    for sensor, devices in found.items():
        for what, pick in (("median device", np.median), ("worst device", np.max)):
            paper = published.TABLE6[sensor] if pick is np.median else None
            rows.append((sensor, what, paper, *(_picked(devices, name, pick, "distances") for name in COLUMNS)))
    return Table("table6", f"Table 6: distance to the ideal silo, {_count(found)} devices each", head, tuple(rows))


def _count(found: dict[str, list[dict[str, Any]]]) -> int:
    return len(next(iter(found.values())))


def _picked(devices: Sequence[dict[str, Any]], name: str, pick: Any, kind: str) -> float | None:
    """Median or largest distance over the devices that gave an answer, mm."""
    known = [device[kind][name] for device in devices if name in device[kind]]
    return 1e3 * float(pick(known)) if known else None


def _table7(found: dict[str, list[dict[str, Any]]]) -> Table:
    head = ("sensor (stand-in)", "row", "paper r_x", "paper r_y", "r_x", "r_y", "distance, mm")
    rows = [row for mounted in FOUR_SENSORS if mounted.accelerometer for row in _rows7(mounted, found[mounted.name])]
    note = (
        "Angles in mrad. The first rows are of one device, as in the paper; the last ones are root mean squares over "
        "all devices, against the truth, which the paper could not know. Distances are Eq. 11 to the true pose."
    )
    return Table("table7", "Table 7: accelerometer beside the method", head, tuple(rows), note)


def _rows7(mounted: Mounted, devices: list[dict[str, Any]]) -> Iterator[tuple[Cell, ...]]:
    paper, first, name = published.TABLE7[mounted.name], devices[0], mounted.name
    reading = 1e3 * np.array(first["accelerometer"])
    yield (name, "accelerometer", *paper.accelerometer, float(reading[0]), float(reading[1]), None)
    for solver in ("shape-tensor", "surface", WITH_GRAVITY):
        angles = _angles(first, solver)
        printed = paper.method if solver == "shape-tensor" else (None, None)
        yield (name, _heading(solver), *printed, *_pair(angles), _millimetres(first, solver))
    for solver in ("shape-tensor", "surface", WITH_GRAVITY):
        apart = _rms([_angles(d, solver) - 1e3 * np.array(d["accelerometer"]) for d in devices if _has(d, solver)])
        printed = _differences(paper) if solver == "shape-tensor" else (None, None)
        yield (name, f"{_heading(solver)} minus accelerometer, rms", *printed, *_pair(apart), None)
    for solver in ("shape-tensor", "surface", WITH_GRAVITY):
        off = _rms([_angles(d, solver) - _angles(d, TRUTH) for d in devices if _has(d, solver)])
        distance = _picked(devices, solver, np.median, "pose_distances")
        yield (name, f"{_heading(solver)} minus truth, rms; median distance", None, None, *_pair(off), distance)


def _differences(paper: published.AccelerometerRow) -> tuple[float, float]:
    return tuple(abs(a - b) for a, b in zip(paper.accelerometer, paper.method, strict=True))  # type: ignore[return-value]


def _heading(solver: str) -> str:
    return "surface, told the accelerometer" if solver == WITH_GRAVITY else SOLVERS[solver].heading


def _has(device: dict[str, Any], solver: str) -> bool:
    return device["poses"][solver] is not None


def _angles(device: dict[str, Any], solver: str) -> Numbers:
    """(r_x, r_y) in mrad, NaN where refused."""
    pose = device["poses"][solver]
    return np.full(2, np.nan) if pose is None else 1e3 * np.array(pose[:2])


def _rms(values: list[Numbers]) -> Numbers:
    return np.sqrt(np.mean(np.square(values), axis=0)) if values else np.full(2, np.nan)


def _pair(values: Numbers) -> tuple[float | None, float | None]:
    return tuple(float(v) if np.isfinite(v) else None for v in values)  # type: ignore[return-value]


def _millimetres(device: dict[str, Any], solver: str) -> float | None:
    distance = device["pose_distances"].get(solver)
    return None if distance is None else 1e3 * float(distance)


def _range(found: dict[str, list[dict[str, Any]]]) -> Verdict:
    ours = {sensor: _picked(devices, "shape-tensor", np.median, "distances") for sensor, devices in found.items()}
    least = {sensor: _picked(devices, TRUTH, np.median, "distances") for sensor, devices in found.items()}
    worst = max((value for value in ours.values() if value is not None), default=None)
    paper = max(published.TABLE6.values())
    return Verdict(
        "Table 6: distance to the ideal silo, all sensors",
        listed([f"{millimetres(value)} ({name})" for name, value in published.TABLE6.items()]),
        listed([f"{millimetres(value)} ({name})" for name, value in ours.items()]),
        judged(worst, paper),
        "The true pose itself leaves "
        + listed([f"{millimetres(value)} ({name})" for name, value in least.items()])
        + ": most of the rest is the sensors' depth, not the pose.",
    )


def _table7_verdicts(found: dict[str, list[dict[str, Any]]]) -> Iterator[Verdict]:
    for mounted in FOUR_SENSORS:
        if mounted.accelerometer:
            yield _near_accelerometer(mounted.name, found[mounted.name])


def _near_accelerometer(sensor: str, devices: list[dict[str, Any]]) -> Verdict:
    paper = published.TABLE7[sensor]
    apart = [_angles(d, "shape-tensor") - 1e3 * np.array(d["accelerometer"]) for d in devices]
    ours = float(np.nanmax(_rms([gap for gap in apart if np.isfinite(gap).all()])))
    printed = max(_differences(paper))
    return Verdict(
        f"Table 7, {sensor}: method and accelerometer are close",
        f"{number(printed)} mrad",
        f"{number(ours)} mrad (rms)",
        holds(ours <= 2.0 * printed),
        "The accelerometer's own error is a good part of it.",
    )


def _picture(found: dict[str, list[dict[str, Any]]]) -> Picture:
    def draw() -> Any:
        from siloscope.reproduction.evaluation import figures

        return figures.sensors({m.name: _clouds(m, found[m.name][0]) for m in FOUR_SENSORS})

    return Picture("fig16", "Fig. 16: what the four sensors see, and the same adjusted by shape-tensor.", draw)


def _clouds(mounted: Mounted, device: dict[str, Any]) -> tuple[Numbers, Numbers]:
    """A device's cloud in its own frame and in the silo frame."""
    frame = mounted.scene(0).render()
    points = metrics.camera_points(frame.measured, frame.camera)[frame.measured > 0]
    pose = device["poses"]["shape-tensor"]
    return points, points[:0] if pose is None else SiloPose(*pose).to_silo(points)
