"""A table, as Markdown for readers and as CSV for programs."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

Cell = str | float | int | None

NOTHING = "–"
"""Stands where there is no number."""

LEAST = 0.001
"""Smaller numbers are not told apart; no unit of the tables makes sense below it."""


@dataclass(frozen=True)
class Table:
    """Rows of text and numbers below a heading; None is something that there is not."""

    name: str
    """Stem of its CSV file."""
    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.head):
                raise ValueError(f"table '{self.name}': {len(row)} cells below {len(self.head)} columns: {row}")

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {"title": self.title, "head": list(self.head), "rows": [list(row) for row in self.rows]}

    def markdown(self) -> str:
        """A Markdown table with its title and note."""
        aligned = ["---:" if self._numeric(column) else "---" for column in range(len(self.head))]
        lines = [_line(self.head), _line(aligned), *(_line([shown(cell) for cell in row]) for row in self.rows)]
        return "\n".join([f"**{self.title}**", "", *lines, *(["", self.note] if self.note else [])])

    def csv(self) -> str:
        """Comma-separated values with all digits."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerows([self.head, *(["" if cell is None else cell for cell in row] for row in self.rows)])
        return text.getvalue()

    def _numeric(self, column: int) -> bool:
        return any(isinstance(row[column], (int, float)) for row in self.rows)


def shown(cell: Cell) -> str:
    """A cell as text."""
    if cell is None:
        return NOTHING
    return number(cell) if isinstance(cell, float) else str(cell)


def number(value: float) -> str:
    """A number with about three digits; a dash for NaN."""
    size = abs(value)
    if math.isnan(value):
        return NOTHING
    if size < LEAST:
        return "0" if size == 0.0 else f"< {LEAST:g}"
    return f"{value:.{0 if size >= 99.95 else 2 if size >= 0.095 else 3}f}"


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
