"""How much a silo holds: from its geometry, from a datasheet, or from a strapping table."""

from __future__ import annotations

import csv
import itertools
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from siloscope.errors import InputError
from siloscope.types.vessel import Lengths, SiloGeometry
from siloscope.vessel.datasheet import Datasheet
from siloscope.vessel.limits import LENGTH_STD

LARGEST_FILE = 10_000_000
"""Bytes of a strapping table."""


@dataclass(frozen=True, eq=False)
class Strapping:
    """A strapping table: volume (m³) of the silo up to heights (m) above its cone's vertex, both rising."""

    heights: tuple[float, ...]
    volumes: tuple[float, ...]
    source: str = "strapping table"

    def __post_init__(self) -> None:
        pairs = list(zip(self.heights, self.volumes, strict=True))
        if len(pairs) < 2:
            raise InputError(f"{self.source}: a strapping table needs at least two rows of height and volume")
        for (h0, v0), (h1, v1) in itertools.pairwise(pairs):
            if not (h1 > h0 and v1 >= v0):
                raise InputError(f"{self.source}: heights and volumes must rise from row to row; see {h1:g}, {v1:g}")
        if self.volumes[0] < 0.0:
            raise InputError(f"{self.source}: the volume at {self.heights[0]:g} m is negative")

    @property
    def capacity(self) -> float:
        """Volume of the last row, m³."""
        return self.volumes[-1]

    def volume(self, height: float) -> float:
        """Volume under a level plane at a height above the vertex, m³; linear between the rows, none beyond them."""
        return float(np.interp(height, self.heights, self.volumes, left=0.0, right=self.capacity))

    @classmethod
    def read(cls, path: str | Path) -> Strapping:
        """Reads a CSV file of two columns, height (m) and volume (m³), with or without a heading.

        Raises `InputError` that names file, line and cause.
        """
        path = Path(path)
        try:
            if path.stat().st_size > LARGEST_FILE:
                raise InputError(f"{path}: too large for a strapping table; give two columns, height and volume")
            text = path.read_text("utf-8-sig")
        except OSError as error:
            raise InputError(f"{path}: can't be read ({error.strerror}); check its name and permissions") from None
        except UnicodeDecodeError:
            raise InputError(f"{path}: no text; save the strapping table as CSV in UTF-8") from None
        return cls(*_columns(text, path), str(path))


def _columns(text: str, path: Path) -> tuple[tuple[float, ...], tuple[float, ...]]:
    semicolons = ";" in text  # then commas are decimal commas
    rows = csv.reader(text.splitlines(), delimiter=";" if semicolons else ",")
    found: list[tuple[float, float]] = []
    for number, row in enumerate(rows, 1):
        cells = [cell.strip() for cell in row if cell.strip()]
        if not cells or cells[0].startswith("#"):
            continue
        pair = _pair(cells, decimal_comma=semicolons)
        if pair is None and not found and number <= 2:
            continue  # the heading
        if pair is None:
            raise InputError(f"{path}, line {number}: '{', '.join(row)}' is not a height and a volume")
        found.append(pair)
    if not found:
        raise InputError(f"{path}: no rows; give two columns, height (m) and volume (m³)")
    heights, volumes = zip(*found, strict=True)
    return heights, volumes


def _pair(cells: list[str], decimal_comma: bool) -> tuple[float, float] | None:
    try:
        numbers = [float(c.replace(",", ".") if decimal_comma else c) for c in cells[:2]]
    except ValueError:
        return None
    return (numbers[0], numbers[1]) if len(numbers) == 2 and all(map(math.isfinite, numbers)) else None


def complete(seen: SiloGeometry, sheet: Datasheet, top: float | None) -> Lengths:
    """Fills what was not seen from the datasheet; what was seen stays."""
    radius, bottom, apex = seen.radius, seen.cylinder_bottom, seen.apex
    assumed: list[str] = []
    variance = [0.0, 0.0, 0.0]
    bottom_from = apex_from = "wall"
    own = LENGTH_STD**2
    if radius is None and sheet.diameter is not None:
        radius, variance[0] = sheet.diameter / 2.0, own / 4.0
        assumed.append("radius from the given diameter")
    if bottom is None and top is not None and sheet.cylinder is not None:
        bottom, variance[1], bottom_from = top + sheet.cylinder, own, "top"
        assumed.append("cylinder's bottom from the datasheet and the given top")
    if bottom is None and apex is not None and sheet.cone is not None:
        bottom, variance[1], bottom_from = apex - sheet.cone, own, "vertex"
        assumed.append("cylinder's bottom from the vertex and the datasheet's cone")
    if apex is None and bottom is not None and sheet.cone is not None:
        apex, variance[2], apex_from = bottom + sheet.cone, own, "bottom"
        assumed.append("cone's vertex from the cylinder's bottom and the datasheet's cone")
    if sheet.bottom == "flat" and apex is None and bottom is not None:
        apex, variance[2], apex_from = bottom, 0.0, "bottom"
    edge, source = _top(bottom, sheet, top)
    if source == "camera":
        assumed.append("the silo can be filled up to the camera's height")
    added = (variance[0], variance[1], variance[2])
    geometry = SiloGeometry(radius, bottom, apex)
    return Lengths(geometry, edge, source, tuple(assumed), added, bottom_from, apex_from)


def _top(bottom: float | None, sheet: Datasheet, top: float | None) -> tuple[float, str]:
    if top is not None:
        return top, "given"
    if bottom is not None and sheet.cylinder is not None:
        return bottom - sheet.cylinder, "datasheet"
    return 0.0, "camera"


def missing(geometry: SiloGeometry) -> tuple[str, ...]:
    """Names of the lengths that a volume needs and nobody knows."""
    return tuple(name for name in ("radius", "cylinder_bottom", "apex") if getattr(geometry, name) is None)


def lacking(geometry: SiloGeometry, sheet: Datasheet, top: float | None) -> tuple[str, ...]:
    """The same in the words of the options: without a joint that was seen, `top` and `cylinder` have to place it."""
    names = missing(geometry)
    if "cylinder_bottom" not in names:
        return tuple("cone" if name == "apex" else name for name in names)
    placing = (("top", top), ("cylinder", sheet.cylinder))
    wanted = [name for name, value in placing if value is None]
    if "apex" in names and sheet.cone is None and sheet.bottom != "flat" and sheet.shape is None:
        wanted.append("cone")
    return tuple(name for name in names if name == "radius") + tuple(wanted)
