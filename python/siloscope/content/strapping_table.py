"""A strapping table with its uncertainty budget: the volume of a vessel by height, from its calibration."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.content.fitting import lengths_for_core
from siloscope.content.knowledge import Knowledge
from siloscope.content.setup import CoreVessel
from siloscope.errors import InputError
from siloscope.types.floor import FloorMap
from siloscope.vessel.vessel import Vessel

COVERAGE_FACTOR = 2.0
"""k of the expanded uncertainty (GUM, 6.3.3): 95 % for a normal variable."""

WALL_FORM_STD = 0.002
"""How far a real wall is off the fitted one on the whole, m; 2.8 mm was the most in a comparison of a laser scan with
strapping (FLOMEKO 2010)."""

STEP = 1e-4
"""Half the step of the differences by a length, m."""


@dataclass(frozen=True)
class Row:
    """Volume under a level plane."""

    height: float
    """Over the lowest point of the floor, m."""
    volume: float
    std: float


@dataclass(frozen=True)
class Table:
    """A strapping table."""

    rows: tuple[Row, ...]
    budget: tuple[tuple[str, float, float], ...]
    """Contribution, its own standard deviation (m), and what it does to the full vessel's volume (m³)."""
    datum: str
    assumed: tuple[str, ...]
    silo: dict[str, Any]

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "schema": "siloscope.strapping/1",
            "datum": self.datum,
            "coverage_factor": COVERAGE_FACTOR,
            "rows": [{"height_m": r.height, "volume_m3": r.volume, "std_m3": r.std} for r in self.rows],
            "budget": [{"contribution": n, "std_m": s, "volume_std_m3": v} for n, s, v in self.budget],
            "assumed": list(self.assumed),
            "silo": self.silo,
        }


def strapping_table(known: Knowledge, vessel: Vessel, step: float = 0.01) -> Table:
    """The table in steps of height, with the deviation of each row.

    Raises
    ------
    InputError
        Where the bottom or a length is not known.
    """
    if known.missing or known.lengths.geometry.radius is None:
        lacking = ", ".join(known.missing or ("radius",))
        raise InputError(f"no table without the {lacking}; say what the bottom is, or calibrate with --empty FRAME")
    silo = lengths_for_core(known, vessel.sheet)
    floor = known.floor.map
    lowest = silo[2] if floor is None else floor.lowest
    count = int((lowest - silo[3]) / step + 1e-9)
    heights = np.append(step * np.arange(count + 1), lowest - silo[3])
    heights = np.unique(np.round(heights, 9))
    causes = list(_causes(known, silo, vessel))
    volumes = _volumes(silo, floor, vessel, lowest - heights)
    changes = {name: (change(lowest - heights) - volumes) for name, _, change in causes}
    std = np.sqrt(sum(np.square(change) for change in changes.values()))
    rows = tuple(Row(*(float(v) for v in row)) for row in zip(heights, volumes, std, strict=True))
    budget = tuple((name, own, abs(float(changes[name][-1]))) for name, own, _ in causes)
    datum = "lowest point of the floor" if floor is not None or known.floor.kind == "flat" else "cone's vertex"
    plain = {"radius": silo[0], "cylinder_bottom": known.lengths.geometry.cylinder_bottom, "lowest": lowest,
             "top": silo[3], "bottom": known.floor.kind}  # fmt: skip
    return Table(rows, budget, datum, known.assumed, plain)


def _volumes(silo: CoreVessel, floor: FloorMap | None, vessel: Vessel, z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Volumes under level planes at heights z, m³."""
    edge = silo[1]
    if floor is None:
        made = np.array(_core.vessel_volume_below(silo, z.tolist()))
    else:
        x, y = FloorMap.middles(floor.reach, len(floor.z))
        inside = np.hypot(x, y) <= silo[0]
        bottom, area = floor.z[inside], math.pi * silo[0] ** 2 / inside.sum()
        made = np.array([np.maximum(bottom - plane, 0.0).sum() * area for plane in z])
        edge = float(bottom.min())
    courses = np.array([vessel.radius_change(0.0, edge - plane, silo[0]) for plane in z])
    return np.asarray(made + courses)


def _causes(known: Knowledge, silo: CoreVessel, vessel: Vessel) -> Iterator[tuple[str, float, Any]]:
    """Contributions: name, standard deviation, and the volumes with the length moved by it.

    The datum is the floor's lowest point and moves with it; correlations between lengths only make the sum smaller.
    """
    floor = known.floor.map
    std = np.sqrt(np.maximum(np.diag(known.covariance), 0.0))
    scale = float(std[8])

    def moved(place: int, by: float) -> Any:
        lengths = list(silo)
        lengths[place] += by
        lengths[2] = max(lengths[2], lengths[1])
        return lambda z: _volumes(CoreVessel(*lengths), floor, vessel, z + (by if place == 2 else 0.0))

    yield "radius", float(std[4]), moved(0, float(std[4]))
    yield "wall's form", WALL_FORM_STD, moved(0, WALL_FORM_STD)
    if floor is None and known.floor.kind == "cone":
        yield "cylinder's bottom", float(std[5]), moved(1, float(std[5]))
        yield "vertex", float(std[6]), moved(2, float(std[6]))
    if floor is not None:
        x, y = FloorMap.middles(floor.reach, len(floor.z))
        mean = float(floor.std[np.hypot(x, y) <= silo[0]].mean())
        yield "floor", mean, lambda z: _volumes(silo, floor, vessel, z) + mean * math.pi * silo[0] ** 2
    if scale > 0.0:
        yield "depth scale (relative)", scale, lambda z: _volumes(silo, floor, vessel, z) * (1.0 + 3.0 * scale)


def write_csv(path: Path, table: Table) -> Path:
    """Height, volume, standard deviation and expanded uncertainty, one row a step; `--strapping` reads it back."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(("height_m", "volume_m3", "std_m3", "expanded_m3"))
        for row in table.rows:
            numbers = (row.height, row.volume, row.std, COVERAGE_FACTOR * row.std)
            writer.writerow([f"{value:.6f}" for value in numbers])
    return path
