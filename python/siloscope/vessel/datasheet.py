"""A vessel's inner lengths as its maker gives them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from siloscope.errors import UsageError
from siloscope.types.camera import is_number
from siloscope.vessel.limits import LONGEST

if TYPE_CHECKING:
    from siloscope.vessel.bottoms import Bottom


BOTTOMS = ("cone", "flat", "unknown")
"""Bottoms that an option tells."""


@dataclass(frozen=True)
class Datasheet:
    """A silo's inner lengths as its maker gives them, m; None where it does not tell."""

    diameter: float | None = None
    cylinder: float | None = None
    """Height of the cylinder."""
    cone: float | None = None
    """Height of the cone, from the cylinder's bottom to its vertex; 0 for a flat floor."""
    outlet_diameter: float = 0.0
    """Diameter of the outlet pipe; 0 for none."""
    outlet_length: float = 0.0
    """How far the pipe's closed end lies below the cone's vertex."""
    bottom: str | None = None
    """"cone", "flat" or "unknown"; None where it is not told."""
    shape: Bottom | None = None
    """A bottom of another kind."""

    def __post_init__(self) -> None:
        for name, least in (("diameter", 0.01), ("cylinder", 0.0), ("cone", 0.0)):
            value = getattr(self, name)
            if value is not None and not (is_number(value) and least <= value <= LONGEST):
                raise UsageError(f"{name} must be between {least:g} and {LONGEST:g} m, got {value}")
        if self.bottom not in (None, *BOTTOMS):
            raise UsageError(f"bottom '{self.bottom}': give one of {', '.join(BOTTOMS)}")
        if self.bottom == "flat" and self.cone:
            raise UsageError(f"a flat bottom has no cone of {self.cone:g} m; give one of the two")
        for name in ("outlet_diameter", "outlet_length"):
            value = getattr(self, name)
            if not (is_number(value) and 0.0 <= value <= 20.0):
                raise UsageError(f"{name.replace('_', '-')} must be between 0 and 20 m, got {value}")

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        plain = {name: getattr(self, name) for name in self.__dataclass_fields__ if name != "shape"}
        return {**plain, "bottom": self.bottom if self.shape is None else self.shape.kind}
