"""A story's readings as tables: CSV, JSON lines, Parquet."""

from __future__ import annotations

import csv
from importlib import import_module
from pathlib import Path
from typing import Any

from siloscope.errors import UsageError
from siloscope.schema import documents
from siloscope.types.track import Track

COLUMNS = (
    *("index", "name", "time", "time_utc", "status", "reason", "volume_m3", "volume_std_m3", "ullage_m3"),
    *("ullage_std_m3", "fill_fraction", "level_m", "mass_kg", "mass_std_kg", "coverage", "flow_m3_h"),
    *("mass_flow_t_h", "quality"),
)
"""Columns of the tables, in their order."""


def write_csv(path: Path, found: Track) -> Path:
    """One line a reading; empty cells for what is not known, quality codes joined by blanks."""
    with path.open("w", newline="", encoding="utf-8", errors="replace") as file:
        writer = csv.DictWriter(file, COLUMNS, extrasaction="ignore")
        writer.writeheader()
        writer.writerows(_rows(found))
    return path


def write_jsonl(path: Path, found: Track) -> Path:
    """One JSON document a line and reading."""
    lines = (documents.text(reading.to_dict()) for reading in found.readings)
    path.write_text("".join(f"{line}\n" for line in lines), "utf-8")
    return path


def write_parquet(path: Path, found: Track) -> Path:
    """The readings as a Parquet table; needs pyarrow (``pip install 'siloscope[parquet]'``)."""
    try:
        pyarrow, writer = (import_module(name) for name in ("pyarrow", "pyarrow.parquet"))
    except ImportError:
        raise UsageError("Parquet needs pyarrow; pip install 'siloscope[parquet]'") from None
    whole, words = pyarrow.int64(), pyarrow.string()
    kinds = {"index": whole, "name": words, "time_utc": words, "status": words, "reason": words, "quality": words}
    schema = pyarrow.schema([(name, kinds.get(name, pyarrow.float64())) for name in COLUMNS])
    writer.write_table(pyarrow.Table.from_pylist(_rows(found), schema=schema), path)
    return path


def _rows(found: Track) -> list[dict[str, Any]]:
    return [{**reading.to_dict(), "quality": " ".join(reading.quality)} for reading in found.readings]
