"""Conservation of volume: a known part moves, and two readings must differ by it."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from siloscope.content.units import MASSES, VOLUMES
from siloscope.errors import InputError, UsageError
from siloscope.schema import CONTENT
from siloscope.types.content import HIDDEN_ALIKE, Content

AGREES = 2.0
"""Deviations within which both sides agree."""


@dataclass(frozen=True)
class Amount:
    """A volume with its standard deviation, m³."""

    volume: float
    std: float


@dataclass(frozen=True)
class Conservation:
    """What was measured beside what was moved. m³."""

    measured: Amount
    moved: Amount

    @property
    def difference(self) -> float:
        """Measured less moved."""
        return self.measured.volume - self.moved.volume

    @property
    def std(self) -> float:
        """Standard deviation of the difference."""
        return math.hypot(self.measured.std, self.moved.std)

    @property
    def deviations(self) -> float:
        """The difference in its standard deviations."""
        return self.difference / max(self.std, 1e-12)

    @property
    def agrees(self) -> bool:
        """Whether both sides are the same within two deviations."""
        return abs(self.deviations) <= AGREES

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "schema": "siloscope.conservation/1",
            "measured_m3": self.measured.volume,
            "measured_std_m3": self.measured.std,
            "moved_m3": self.moved.volume,
            "moved_std_m3": self.moved.std,
            "difference_m3": self.difference,
            "deviations": self.deviations,
            "agrees": self.agrees,
        }


def change(before: Content | dict[str, Any], after: Content | dict[str, Any]) -> Amount:
    """Volume gained between two readings of one vessel, by ullage where one has no volume.

    Unlike `Content.change_since` its deviation contains what radius and depth scale do to the change itself: the check
    is there to find such an error.

    Raises
    ------
    InputError
        Where a reading shows no surface.
    """
    first, second = (c.to_dict() if isinstance(c, Content) else c for c in (before, after))
    for sign, value, parts in ((1.0, "volume_m3", "volume_std_parts_m3"), (-1.0, "ullage_m3", "ullage_std_parts_m3")):
        if all(side.get(value) is not None and side.get(parts) for side in (first, second)):
            gained = sign * (float(second[value]) - float(first[value]))
            return Amount(gained, math.hypot(*(_own(side, value, parts, gained) for side in (first, second))))
    raise InputError("a reading shows no surface, so nothing can be compared; measure a frame that does")


def _own(side: dict[str, Any], value: str, parts: str, gained: float) -> float:
    """A reading's part of a change's deviation: what differs from frame to frame, and half of what scales with it."""
    of = side[parts]
    common = math.hypot(of["geometry"], of["depth"]) / max(abs(float(side[value])), 1e-9)
    return math.hypot(of["noise"], of["grid"], HIDDEN_ALIKE * of["unseen"], common * gained / math.sqrt(2.0))


def check_volume(measured: Amount, moved: Amount) -> Conservation:
    """Both sides beside each other; signs don't matter: what left one side is what came to the other."""
    return Conservation(Amount(abs(measured.volume), measured.std), Amount(abs(moved.volume), moved.std))


def moved_amount(
    text: str, density: float | None = None, density_std: float = 0.0, relative_std: float = 0.0
) -> Amount:
    """A volume, or a mass by its density: "3.5m3", "120bu", "2400kg", "2.4t".

    Raises
    ------
    UsageError
        For a text that is none, or a mass without a density.
    """
    plain = text.strip().lower().replace("m³", "m3")
    name = next((u for u in sorted([*VOLUMES, *MASSES], key=len, reverse=True) if plain.endswith(u)), None)
    try:
        value = abs(float(plain.removesuffix(name or "")))
    except ValueError:
        value = math.nan
    if name is None or not 0.0 < value < 1e9:
        raise UsageError(f"--moved '{text}': give an amount with its unit, such as 3.5m3 or 2400kg")
    if name in VOLUMES:
        volume = value * VOLUMES[name][0]
        return Amount(volume, relative_std * volume)
    if density is None:
        raise UsageError(f"--moved '{text}' is a mass; give --density too")
    volume = value * MASSES[name][0] / density
    return Amount(volume, volume * math.hypot(relative_std, density_std / density))


def read_reading(path: str | Path) -> dict[str, Any]:
    """A reading that `measure --json` or `measure --out` wrote.

    Raises
    ------
    InputError
        For a file that is none.
    """
    try:
        found = json.loads(Path(path).read_bytes())
    except (OSError, ValueError, RecursionError):
        raise InputError(f"{path}: no reading; give what `siloscope measure --json` printed") from None
    if not isinstance(found, dict) or found.get("schema") != CONTENT:
        raise InputError(f"{path}: no reading of the schema {CONTENT}; give what `siloscope measure --json` printed")
    return found
