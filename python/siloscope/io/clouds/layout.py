"""Finds out what the columns of a text table are; refuses where they can't be told."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from siloscope.errors import InputError
from siloscope.io.clouds.columns import LABEL_NAMES

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d+)?|[+-]?(nan|inf|infinity)", re.IGNORECASE)
_COMMA_NUMBER = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?")
_FORTRAN = re.compile(r"\d[dD][+-]?\d")
_COMMENTS = ("#", "//", "%")
_AXES = {"x": ("x", "points:0", "coordx"), "y": ("y", "points:1", "coordy"), "z": ("z", "points:2", "coordz", "depth")}
_UNITS = {"": 1.0, "m": 1.0, "meters": 1.0, "metres": 1.0, "cm": 0.01, "mm": 0.001}
_PIXEL = ("i", "j")
"""Columns of the pixel's place, as rs-convert names them."""
_NAME = re.compile(r"([a-z:]+\d?)[\s_]*[\[(]?(mm|cm|meters|metres|m|)[\])]?")
SMALLEST_IMAGE = (8, 16)
"""Rows and columns from which a table without a header is a depth image."""


@dataclass(frozen=True)
class Layout:
    """How to read a table of numbers.

    Attributes
    ----------
    first : int
        Index of the first line of values.
    delimiter : str or None
        Between the columns; None is white space.
    decimal_comma, fortran : bool
        Numbers written 1,5 or 1.5D0.
    columns : tuple of int, or None
        Where x, y and z are; None for a depth image.
    label : int or None
        Where a label is.
    pixel : tuple of int, int, or None
        Where the column and row of the point's pixel are.
    unit : float
        Metres per unit of the coordinates.
    unit_from : str or None
        What named the unit.
    whole : bool
        The values looked at are all whole numbers.
    """

    first: int
    delimiter: str | None
    decimal_comma: bool
    fortran: bool
    columns: tuple[int, ...] | None
    label: int | None = None
    pixel: tuple[int, int] | None = None
    unit: float = 1.0
    unit_from: str | None = None
    whole: bool = False


def is_number(word: str) -> bool:
    """Whether a word is a number as C, Fortran or Python write it."""
    return _NUMBER.fullmatch(word.strip().strip('"')) is not None


def layout(name: str, lines: Sequence[str]) -> Layout:
    """The layout of a table from some of its lines, the first among them."""
    first = _first_row(lines)
    if first is None:
        raise InputError(f"{name}: no line with three numbers or more; export the points as x, y, z a line")
    rows = [line for line in lines[first:] if line.strip() and not line.lstrip().startswith(_COMMENTS)]
    delimiter, comma = _delimiter(rows[0])
    table = [_split(row, delimiter, comma) for row in rows]
    whole = all(re.fullmatch(r"[+-]?\d*", cell) for row in table for cell in row if is_number(cell))
    known = Layout(first, delimiter, comma, any(_FORTRAN.search(row) for row in rows[:100]), None, whole=whole)
    return _with_columns(name, known, lines[:first], table)


def _first_row(lines: Sequence[str]) -> int | None:
    for i, line in enumerate(lines):
        if line.lstrip().startswith(_COMMENTS):
            continue
        delimiter, comma = _delimiter(line)
        if sum(map(is_number, _split(line, delimiter, comma))) >= 3:
            return i
    return None


def _delimiter(line: str) -> tuple[str | None, bool]:
    """What is between the columns of a line, and whether its numbers have decimal commas."""
    if ";" in line:
        cells = line.split(";")
        return ";", any(_COMMA_NUMBER.fullmatch(cell.strip()) for cell in cells) and "." not in line
    words = line.split()
    if len(words) >= 3 and all(_COMMA_NUMBER.fullmatch(word) for word in words):
        return None, True
    return ("," if "," in line else None), False


def _split(line: str, delimiter: str | None, decimal_comma: bool) -> list[str]:
    cells = [cell.strip().strip('"') for cell in line.split(delimiter)]
    return [cell.replace(",", ".") for cell in cells] if decimal_comma else cells


def _with_columns(name: str, known: Layout, before: Sequence[str], table: list[list[str]]) -> Layout:
    headings = [_split(line.strip().lstrip("#/% ").lower(), known.delimiter, False) for line in reversed(before)]
    for heading in headings:
        if (named := _named(heading)) is not None:
            columns, unit = named
            label = next((i for i, key in enumerate(heading) if key in LABEL_NAMES), None)
            pixel = (heading.index("i"), heading.index("j")) if set(_PIXEL) <= set(heading) else None
            origin = None if unit is None else "column names"
            return replace(known, columns=columns, label=label, pixel=pixel, unit=unit or 1.0, unit_from=origin)
    for heading, line in zip(headings, reversed(before), strict=True):
        if len(heading) == len(table[0]) and not line.lstrip().startswith(_COMMENTS):
            raise InputError(f"{name}: no columns x, y and z among {', '.join(heading)}; name them so")
    return _without_names(name, known, table)


def _named(heading: list[str]) -> tuple[tuple[int, ...], float | None] | None:
    """Columns of x, y, z and their unit where it is named; None where they are not there."""
    found: dict[str, tuple[int, str]] = {}
    for i, key in enumerate(heading):
        match = _NAME.fullmatch(key)
        axis = next((axis for axis, names in _AXES.items() if match and match[1] in names), None)
        if match and axis and axis not in found:
            found[axis] = (i, match[2])
    units = {unit for _, unit in found.values()}
    if len(found) != 3 or len(units) != 1:
        return None
    unit = units.pop()
    return tuple(found[axis][0] for axis in "xyz"), _UNITS[unit] if unit else None


def _without_names(name: str, known: Layout, table: list[list[str]]) -> Layout:
    width = max(len(row) for row in table)
    columns = [[row[i] for row in table if i < len(row)] for i in range(width)]
    while len(columns) > 1 and not any(columns[-1]):  # lines that end with a delimiter
        columns.pop()
    numeric = [i for i, column in enumerate(columns) if all(map(is_number, column))]
    rows_least, columns_least = SMALLEST_IMAGE
    if len(numeric) == len(columns) >= columns_least and len(table) >= rows_least:
        return known
    text = [i for i in range(len(columns)) if i not in numeric]
    if len(numeric) == 3:
        return replace(known, columns=tuple(numeric), label=text[0] if text else None)
    if len(numeric) > 3 and not text and not _counts(columns[0], columns[1:]):
        return replace(known, columns=(0, 1, 2))
    raise InputError(
        f"{name}: can't tell which of the {width} columns are x, y and z (first line: {', '.join(table[0])[:80]}); "
        "put a line 'x,y,z,…' with the columns' names above them"
    )


def _counts(column: list[str], others: list[list[str]]) -> bool:
    """Whether a column is a number of the point rather than a coordinate: whole where others are not."""
    return all(cell.isdigit() for cell in column) and any("." in cell for other in others for cell in other)
