"""The settings of a fleet's run as a TOML file: what is known of every silo, and of single ones."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field

from siloscope.schema import files
from siloscope.schema.validation import StrictDocument, validated

_LARGEST = 4 << 20
_REMEDY = "see docs/fleet.md for the entries"


class Measuring(StrictDocument):
    """Settings of `siloscope.measure` by their names; lengths in m, densities in kg/m³, moisture in percent."""

    sensor: str | None = None
    vessel: str | None = None
    diameter: float | None = None
    cylinder: float | None = None
    cone: float | None = None
    bottom: str | None = None
    top: float | None = None
    outlet_diameter: float | None = None
    outlet_length: float | None = None
    strapping: str | None = None
    density: float | None = None
    density_std: float | None = None
    product: str | None = None
    test_weight: str | None = None
    moisture: float | None = None


class Locating(StrictDocument):
    """How frames are located for a calibration where none is given."""

    frames: int | None = Field(default=None, ge=1)


class FleetFile(StrictDocument):
    """The whole file."""

    measure: Measuring = Field(default_factory=Measuring)
    locate: Locating = Field(default_factory=Locating)
    silo: dict[str, Measuring] = Field(default_factory=dict)


def read(path: Path) -> FleetFile:
    """The settings of a file; raises `InputError` with file, entry and remedy."""
    data = files.content(path, _LARGEST, "a fleet's settings", _REMEDY)
    return validated(FleetFile, files.from_toml(data, str(path), "settings", _REMEDY), str(path), _REMEDY)
