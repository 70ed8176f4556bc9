"""What a run has written."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq


def files(run: str | Path, *folders: str) -> dict[str, str]:
    """Every object of some folders of a run with the hash of its bytes."""
    found = {}
    for folder in folders:
        for path in sorted((Path(run) / folder).rglob("*")):
            if path.is_file() and not path.name.startswith("."):
                found[str(path.relative_to(run))] = hashlib.sha256(path.read_bytes()).hexdigest()
    return found


def answers(run: str | Path) -> dict[str, str]:
    """Everything that has to be the same for every engine, by name and hash."""
    return files(run, "results", "events", "calibrations", "evidence", "commits")


def rows(run: str | Path) -> list[dict[str, Any]]:
    """All readings."""
    return pq.read_table(Path(run) / "results").to_pylist()
