"""A vessel as a datasheet or a drawing gives it: lengths, courses, roof, obstacles, outline."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import UsageError
from siloscope.vessel import bottoms
from siloscope.vessel.datasheet import Datasheet
from siloscope.vessel.limits import LONGEST

if TYPE_CHECKING:
    from siloscope.schema import vessel as schema


PIECES = 200
"""Pieces of a bar when its volume under the surface is counted."""


@dataclass(frozen=True)
class Course:
    """A ring of the wall."""

    bottom: float
    """Height of its lower edge over the cylinder's, m."""
    radius: float


@dataclass(frozen=True)
class Roof:
    """A cone over the cylinder, open at its top."""

    height: float
    opening: float = 0.0
    """Diameter of the opening, m."""


@dataclass(frozen=True)
class Obstacle:
    """A round bar; places in the silo frame, with the height over the cylinder's lower edge. Metres."""

    name: str
    start: tuple[float, float, float]
    end: tuple[float, float, float]
    diameter: float

    def ends(self, edge: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Both ends in the silo frame; `edge` is z of the cylinder's lower edge."""
        start, end = (np.array([x, y, edge - height]) for x, y, height in (self.start, self.end))
        return start, end

    def pieces(self, edge: float) -> tuple[NDArray[np.float64], float]:
        """Middles (`PIECES`, 3) of equal pieces of the bar, and the volume of each, m³."""
        start, end = self.ends(edge)
        along = (np.arange(PIECES) + 0.5) / PIECES
        volume = math.pi * self.diameter**2 / 4.0 * float(np.linalg.norm(end - start))
        return start + along[:, None] * (end - start), volume / PIECES


@dataclass(frozen=True)
class Vessel:
    """What is given of a vessel. Metres."""

    sheet: Datasheet = field(default_factory=Datasheet)
    top: float | None = None
    """z of the upper edge below the camera."""
    fill_height: float | None = None
    """Over the cylinder's lower edge; the upper edge where not given."""
    courses: tuple[Course, ...] = ()
    roof: Roof | None = None
    obstacles: tuple[Obstacle, ...] = ()
    outline: tuple[tuple[float, float], ...] | None = None
    name: str | None = None

    @property
    def fill_top(self) -> float | None:
        """z of the height up to which the cylinder is filled; None where the file does not tell."""
        if self.fill_height is None or self.top is None or self.sheet.cylinder is None:
            return self.top
        return self.top + max(self.sheet.cylinder - self.fill_height, 0.0)

    def radius_change(self, low: float, high: float, radius: float) -> float:
        """Volume, m³, that the courses add between two heights over the cylinder's lower edge to a radius's."""
        if not self.courses or high <= low:
            return 0.0
        edges = [*(course.bottom for course in self.courses), math.inf]
        added = 0.0
        for course, end in zip(self.courses, edges[1:], strict=True):
            span = max(min(high, end) - max(low, course.bottom), 0.0)
            added += math.pi * (course.radius**2 - radius**2) * span
        return added

    def roof_volume(self, radius: float) -> float:
        """Volume under the roof that is filled, m³: none unless the fill height lies above the cylinder."""
        if self.roof is None or self.fill_height is None or self.sheet.cylinder is None:
            return 0.0
        height = min(max(self.fill_height - self.sheet.cylinder, 0.0), self.roof.height)
        end = radius + (self.roof.opening / 2.0 - radius) * height / self.roof.height
        return math.pi * height * (radius**2 + radius * end + end**2) / 3.0

    def in_obstacle(self, points: NDArray[np.float64], edge: float, margin: float) -> NDArray[np.bool_]:
        """Which points (N, 3) of the silo frame lie in an obstacle; `edge` is z of the cylinder's lower edge."""
        inside = np.zeros(len(points), np.bool_)
        for bar in self.obstacles:
            start, end = bar.ends(edge)
            along = end - start
            place = np.clip((points - start) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
            apart = np.linalg.norm(points - start - place[:, None] * along, axis=1)
            inside |= apart <= bar.diameter / 2.0 + margin
        return inside

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            **self.sheet.to_dict(),
            "name": self.name,
            "top": self.top,
            "fill_height": self.fill_height,
            "courses": [[course.bottom, course.radius] for course in self.courses],
            "roof": None if self.roof is None else [self.roof.height, self.roof.opening],
            "obstacles": [bar.name for bar in self.obstacles],
            "outline": None if self.outline is None else [list(corner) for corner in self.outline],
        }


def load(path: str | Path) -> Vessel:
    """The vessel of a TOML file; raises `InputError` naming the file, the entry and the remedy."""
    from siloscope.schema import vessel as schema

    told = schema.read(Path(path))
    return Vessel(
        _sheet(told),
        told.top,
        told.fill_height,
        tuple(sorted((Course(c.bottom, c.diameter / 2.0) for c in told.course), key=lambda c: c.bottom)),
        None if told.roof is None else Roof(told.roof.height, told.roof.opening),
        tuple(Obstacle(o.name, _place(o.start), _place(o.end), o.diameter) for o in told.obstacle),
        told.outline,
        told.name,
    )


def given(vessel: Vessel | str | Path | None, top: float | None, **lengths: Any) -> Vessel:
    """A vessel file with single options over it.

    Raises
    ------
    UsageError
        For lengths that can't be, or that don't fit the file's kind of bottom.
    """
    base = Vessel() if vessel is None else vessel if isinstance(vessel, Vessel) else load(vessel)
    own = {name: getattr(base.sheet, name) for name in Datasheet.__dataclass_fields__}
    told = {name: value for name, value in lengths.items() if value is not None}
    told = {name: value for name, value in told.items() if value != 0.0 or not name.startswith("outlet")}
    if own["shape"] is not None and {"cone", "bottom"} & told.keys():
        own["shape"] = None
    if told.get("bottom") == "flat" and "cone" not in told:
        own["cone"] = None
    if told.get("cone") and "bottom" not in told:
        own["bottom"] = None
    edge = base.top if top is None else top
    if edge is not None and not abs(edge) <= LONGEST:
        raise UsageError(f"top must be between -{LONGEST:g} and {LONGEST:g} m, got {edge}")
    return Vessel(
        Datasheet(**{**own, **told}),
        edge,
        base.fill_height,
        base.courses,
        base.roof,
        base.obstacles,
        base.outline,
        base.name,
    )


def _place(place: tuple[float, ...]) -> tuple[float, float, float]:
    x, y, height = place
    return x, y, height


def _sheet(told: schema.VesselFile) -> Datasheet:
    bottom = told.bottom
    lengths: dict[str, Any] = {"diameter": told.diameter, "cylinder": told.cylinder}
    if told.outlet is not None:
        lengths |= {"outlet_diameter": told.outlet.diameter, "outlet_length": told.outlet.length}
    if bottom is None:
        return Datasheet(**lengths)
    if bottom.kind in ("cone", "flat", "unknown"):
        return Datasheet(**lengths, bottom=bottom.kind, cone=bottom.height)
    return Datasheet(**lengths, shape=_shape(bottom, told.diameter))


def _shape(told: schema.Bottom, diameter: float | None) -> bottoms.Bottom:
    height, outlet, azimuth = told.height or 0.0, told.outlet, math.radians(told.azimuth)
    if diameter is not None and max(outlet, told.waist or 0.0, 2.0 * math.hypot(*told.vertex)) >= diameter:
        raise UsageError("the bottom's outlet, waist or vertex does not fit the vessel's diameter; check the numbers")
    match told.kind:
        case "oblique":
            return bottoms.Oblique(height, outlet, told.vertex[0], told.vertex[1])
        case "two-stage":
            return bottoms.TwoStage(height, outlet, told.upper or 0.0, told.waist or 0.0)
        case "pyramid":
            return bottoms.Pyramid(height, outlet, azimuth)
        case _:
            return bottoms.Wedge(height, outlet, azimuth)
