"""Vessel files: TOML with what a datasheet, a drawing or a tape says of a vessel. Metres; angles in degrees."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, PlainValidator, model_validator

from siloscope.schema import files
from siloscope.schema.fields import Number, at_least, finite
from siloscope.schema.validation import StrictDocument, validated, wrong

LARGEST_FILE = 1_000_000
"""Bytes; a vessel is a page of text."""

REMEDY = "docs/vessels.md has an example"

MOST_CORNERS = 500


def _length(value: float) -> float:
    if not 0.0 <= value <= 200.0:
        raise wrong(f"must be between 0 and 200 m, not {value:g}")
    return value


def _place(count: int) -> PlainValidator:
    def check(value: Any) -> tuple[float, ...]:
        if not isinstance(value, list) or len(value) != count:
            raise wrong(f"must be {count} numbers")
        return tuple(finite(v) for v in value)

    return PlainValidator(check)


def _outline(value: Any) -> tuple[tuple[float, float], ...]:
    if not isinstance(value, list) or not 3 <= len(value) <= MOST_CORNERS:
        raise wrong(f"must be 3 to {MOST_CORNERS} corners [x, y]")
    if not all(isinstance(corner, list) and len(corner) == 2 for corner in value):
        raise wrong("must be corners [x, y]")
    return tuple((finite(x), finite(y)) for x, y in value)


Length = Annotated[float, BeforeValidator(finite), AfterValidator(_length)]
Positive = Annotated[float, BeforeValidator(finite), AfterValidator(at_least(1e-3)), AfterValidator(_length)]


class Bottom(StrictDocument):
    """``[bottom]``."""

    kind: Literal["cone", "flat", "oblique", "two-stage", "pyramid", "wedge", "unknown"]
    height: Positive | None = None
    """From the cylinder's lower edge to the lowest point, as if no outlet cut it."""
    vertex: Annotated[tuple[float, ...], _place(2)] = (0.0, 0.0)
    """Where the vertex of an oblique cone lies, x and y in the silo frame."""
    upper: Positive | None = None
    """Height of the upper of two stages."""
    waist: Positive | None = None
    """Diameter where the two stages meet."""
    azimuth: Number = 0.0
    """Direction in which a side falls, degrees from the silo frame's x."""
    outlet: Length = 0.0
    """Diameter, side or width of the opening that ends it."""

    @model_validator(mode="after")
    def _whole(self) -> Bottom:
        wanted = {"oblique": ("height",), "two-stage": ("height", "upper", "waist"), "pyramid": ("height",),
                  "wedge": ("height",)}.get(self.kind, ())  # fmt: skip
        for name in wanted:
            if getattr(self, name) is None:
                raise wrong(f"is missing for the kind {self.kind}", name)
        if self.kind == "flat" and self.height:
            raise wrong("must be left out for a flat bottom", "height")
        if self.upper is not None and self.height is not None and self.upper >= self.height:
            raise wrong("must be less than the height of both stages", "upper")
        return self


class Course(StrictDocument):
    """``[[course]]``: a ring of the wall whose diameter differs."""

    bottom: Length
    """Height of its lower edge over the cylinder's."""
    diameter: Positive


class Roof(StrictDocument):
    """``[roof]``: a cone over the cylinder."""

    height: Positive
    """From the cylinder's upper edge to the opening."""
    opening: Length = 0.0
    """Diameter of the opening."""


class Outlet(StrictDocument):
    """``[outlet]``: a pipe below the vertex of a coaxial cone."""

    diameter: Positive
    length: Length = 0.0


class Obstacle(StrictDocument):
    """``[[obstacle]]``: a round bar from one place to another; heights over the cylinder's lower edge."""

    name: str = "obstacle"
    start: Annotated[tuple[float, ...], _place(3)]
    end: Annotated[tuple[float, ...], _place(3)]
    diameter: Positive


class VesselFile(StrictDocument):
    """A vessel."""

    name: str | None = None
    diameter: Positive | None = None
    cylinder: Length | None = None
    """Height of the cylinder."""
    top: Number | None = None
    """z of the cylinder's upper edge below the camera; negative above it."""
    fill_height: Positive | None = None
    """Up to where it is filled, over the cylinder's lower edge; the upper edge unless given."""
    bottom: Bottom | None = None
    outlet: Outlet | None = None
    roof: Roof | None = None
    course: list[Course] = Field(default_factory=list)
    obstacle: list[Obstacle] = Field(default_factory=list)
    outline: Annotated[tuple[tuple[float, float], ...], PlainValidator(_outline)] | None = None
    """Corners of a bin that is not round, in the silo frame."""


def read(path: Path) -> VesselFile:
    """The vessel of a TOML file; raises `InputError` naming the entry."""
    content = files.content(path, LARGEST_FILE, "a vessel", "give a TOML file with the vessel's lengths")
    return validated(VesselFile, files.from_toml(content, str(path), "vessel", REMEDY), str(path), REMEDY)
