"""Products: TOML files with a bulk density, its spread and its compaction."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import PlainValidator

from siloscope.errors import InputError
from siloscope.schema import files
from siloscope.schema.fields import Number, finite
from siloscope.schema.validation import StrictDocument, validated, wrong

LARGEST_FILE = 100_000
"""Bytes; a product is a few lines of text."""

REMEDY = "docs/measuring.md has an example"


def _curve(value: Any) -> tuple[tuple[float, float], ...]:
    if not isinstance(value, list) or not all(isinstance(entry, list) and len(entry) == 2 for entry in value):
        raise wrong("must be a list of [pressure in Pa, density in kg/m³]")
    return tuple((finite(pressure), finite(density)) for pressure, density in value)


class ProductFile(StrictDocument):
    """A product."""

    name: str | None = None
    density: Number
    """As poured, kg/m³."""
    density_std: Number = 0.0
    source: str = ""
    friction: Number = 0.4
    pressure_ratio: Number = 0.5
    steepest_repose: Number | None = None
    """Degrees."""
    compaction: Annotated[tuple[tuple[float, float], ...], PlainValidator(_curve)] = ()


def read(path: Path) -> ProductFile:
    """The product of a TOML file; raises `InputError` naming the entry."""
    content = files.content(path, LARGEST_FILE, "a product", "give a TOML file with a density")
    return parse(files.from_toml(content, str(path), "product", REMEDY), str(path))


def parse(table: Any, source: str) -> ProductFile:
    """A product's table, checked."""
    if not isinstance(table, dict) or "density" not in table:
        raise InputError(f"{source}: a product needs a density, kg/m³; {REMEDY}")
    return validated(ProductFile, table, source, REMEDY)
