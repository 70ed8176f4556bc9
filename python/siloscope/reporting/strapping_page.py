"""A strapping table as one printable page."""

from __future__ import annotations

from pathlib import Path

from siloscope.content.strapping_table import COVERAGE_FACTOR, Row, Table
from siloscope.reporting.report import Report, table, text

PRINTED = 60
"""Rows on the page; the CSV file has all."""


def write_page(path: Path, made: Table, name: str) -> Path:
    """Geometry, datum, uncertainty budget, what was assumed, and the table."""
    last = made.rows[-1]
    expanded = COVERAGE_FACTOR * last.std
    page = Report(
        f"Strapping table: {name}",
        f"Volume under a level plane by height over the {made.datum}. Uncertainties are expanded with k = 2 (GUM).",
        "A real wall is off a cylinder by millimetres: 0.1 to 0.4 % of the volume is what an installation can reach.",
    )
    page.cards([(f"{last.volume:.3f} m³", "capacity"), (f"± {expanded:.3f} m³", "expanded uncertainty, k = 2")])
    lengths = [[key.replace("_", " "), _shown(value)] for key, value in made.silo.items()]
    page.section("Geometry", table(("length", "m; z down from the camera"), lengths))
    budget = [
        [cause, f"{own:.5f}", f"{share:.5f}", f"{COVERAGE_FACTOR * share:.5f}"] for cause, own, share in made.budget
    ]
    head = ("contribution", "standard deviation (m)", "of the capacity (m³)", "k = 2 (m³)")
    page.section("Uncertainty budget", table(head, budget))
    page.section("Assumed", text(*(made.assumed or ("Nothing beside the calibration.",))))
    rows = [[f"{r.height:.3f}", f"{r.volume:.4f}", f"{COVERAGE_FACTOR * r.std:.4f}"] for r in _some(made)]
    page.section("Table", table(("height (m)", "volume (m³)", "± (m³, k = 2)"), rows))
    return page.write(path)


def _some(made: Table) -> list[Row]:
    """Rows evenly spread, and the last one."""
    stride = max(1, -(-len(made.rows) // PRINTED))
    return [*made.rows[:-1:stride], made.rows[-1]]


def _shown(value: object) -> str:
    return f"{value:.4f}" if isinstance(value, float) else str(value)
