"""Every complaint about others in `docs/monitor/complaints.md` has its tests, and they exist."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

ROWS = [
    [cell.strip() for cell in line.strip("|").split(" | ")]
    for line in (ROOT / "docs" / "monitor" / "complaints.md").read_text("utf-8").splitlines()
    if line.startswith("|")
][2:]


@cache
def names_in(path: Path) -> frozenset[str]:
    """The names of a file's tests."""
    pattern = r'^test\("(.+)", ' if path.suffix == ".ts" else r"^def (test_\w+)\("
    return frozenset(re.findall(pattern, path.read_text("utf-8"), re.MULTILINE))


def place_of(file: str) -> Path:
    """Where a file of tests lies, as the table names it."""
    if file.startswith("web/"):
        return ROOT / file
    return ROOT / "tests" / (file if "/" in file else f"monitor/{file}")


def test_there_is_a_row_for_each_complaint() -> None:
    assert len(ROWS) == 13
    assert all(len(row) == 4 and all(row) for row in ROWS)


@pytest.mark.parametrize("row", ROWS, ids=[row[1].partition(",")[0] for row in ROWS])
def test_the_tests_of_a_complaint_exist(row: list[str]) -> None:
    named = re.findall(r"`([^`]+)`", row[3])
    assert named
    for one in named:
        file, _, name = one.partition(": ") if one.startswith("web/") else one.partition("::")
        assert name in names_in(place_of(file)), one
