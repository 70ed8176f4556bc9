"""The common form of Tables 3 to 5: errors and PC average distance, a block of rows a silo, a column a method."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass

from siloscope.reproduction.evaluation.published import MEASURES, NAMES, UNITS, Adjustment
from siloscope.reproduction.evaluation.series import Series
from siloscope.reproduction.evaluation.tables import Cell, Table
from siloscope.types.pose import SiloPose


@dataclass(frozen=True)
class Column:
    """A way to come from a discharge to one pose."""

    key: str
    heading: str
    pose: Callable[[Series], SiloPose | None]


@dataclass(frozen=True)
class Adjusted:
    """Every column's pose and error for every silo."""

    columns: tuple[Column, ...]
    poses: dict[str, dict[str, SiloPose | None]]
    """By silo and column."""
    errors: dict[str, dict[str, Adjustment | None]]

    @classmethod
    def of(cls, series: Sequence[Series], columns: Sequence[Column]) -> Adjusted:
        """Asks every column about every silo."""
        poses = {one.name: {column.key: column.pose(one) for column in columns} for one in series}
        errors = {
            one.name: dict(zip(poses[one.name], one.adjustments(list(poses[one.name].values())), strict=True))
            for one in series
        }
        return cls(tuple(columns), poses, errors)

    def distance(self, silo: str, column: str) -> float | None:
        """PC average distance, mm."""
        found = self.errors[silo][column]
        return None if found is None else found.distance

    def table(self, name: str, title: str, published: Mapping[str, Adjustment], note: str) -> Table:
        """All of it beside the paper's numbers; silos that the paper has under another sign have none."""
        head = ("silo", "error", "unit", "paper", *(column.heading for column in self.columns))
        rows = [self._row(silo, measure, published.get(silo)) for silo in self.errors for measure in MEASURES]
        return Table(name, title, head, tuple(rows), note)

    def _row(self, silo: str, measure: str, paper: Adjustment | None) -> tuple[Cell, ...]:
        ours = [_entry(found, measure) for found in self.errors[silo].values()]
        return (silo, NAMES[measure], UNITS[measure], _entry(paper, measure), *ours)


def _entry(found: Adjustment | None, measure: str) -> float | None:
    return None if found is None else float(asdict(found)[measure])
