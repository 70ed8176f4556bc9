"""Points as text in the ways people write them."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from frame_files import put, read
from siloscope import InputError

TABLES = {
    "header": ("id,z,x,y\n7,3.5,1.5,2.5\n8,6,4,5\n", [[1.5, 2.5, 3.5], [4, 5, 6]]),
    "comment header": ("//X Y Z R G B\n3\n1.5 2 3 9 9 9\n4 5 6 9 9 9\n", [[1.5, 2, 3], [4, 5, 6]]),
    "units in names": ("x [mm];y [mm];z [mm]\n1500;2500;3500\n", [[1.5, 2.5, 3.5]]),
    "points with intensity": ("1.5 2.5 3.5 200\n4.5 5.5 6.5 100\n", [[1.5, 2.5, 3.5], [4.5, 5.5, 6.5]]),
    "PTS": ("2\n1.5 2.5 3.5 -200 1 2 3\n4.5 5.5 6.5 100 1 2 3\n", [[1.5, 2.5, 3.5], [4.5, 5.5, 6.5]]),
    "decimal comma": ("1,5;2,5;3,5\n4;5;6\n", [[1.5, 2.5, 3.5], [4, 5, 6]]),
    "decimal comma and spaces": ("1,5 2,5 3,5\n4,0 5,0 6,0\n", [[1.5, 2.5, 3.5], [4, 5, 6]]),
    "Fortran": ("0.15D+01 2.5d0 3.5D0\n4.D0 5.0 6.0\n", [[1.5, 2.5, 3.5], [4, 5, 6]]),
    "far away": ("4500000.125,5400000.25,310.5\n", [[4500000.125, 5400000.25, 310.5]]),
    "Windows lines and quotes": ('"x","y","z"\r\n"1.5","2.5","3.5"\r\n', [[1.5, 2.5, 3.5]]),
    "byte order mark": ("\ufeff1.5,2.5,3.5\n", [[1.5, 2.5, 3.5]]),
    "tabs and blank lines": ("1.5\t2.5\t3.5\n\n4\t5\t6\n", [[1.5, 2.5, 3.5], [4, 5, 6]]),
    "trailing comma and names": ("wall1,1.5,2.5,3.5,\nwall2,4,5,6,\n", [[1.5, 2.5, 3.5], [4, 5, 6]]),
    "no measurement": ("1.5 2.5 3.5\nnan nan nan\n", [[1.5, 2.5, 3.5], [np.nan] * 3]),
}  # fmt: skip


@pytest.mark.parametrize(("text", "points"), TABLES.values(), ids=TABLES.keys())
def test_tables_in_the_ways_people_write_them(tmp_path: Path, text: str, points: list[list[float]]) -> None:
    found = read(put(tmp_path, text.encode())).points
    assert np.array_equal(found, points, equal_nan=True)


def test_labels_that_are_numbers_are_kept(tmp_path: Path) -> None:
    frame = read(put(tmp_path, b"st1,1.5,2.5,3.5,\n12,4,5,6,\n"))
    assert frame.labels is not None
    assert frame.labels.tolist() == [-1, 12]


def test_a_long_word_among_the_labels_takes_no_memory_for_every_row(tmp_path: Path) -> None:
    text = "7,1.5,2.5,3.5\n" * 2000 + "w" * 1_000_000 + ",4.5,5.5,6.5\n"
    tracemalloc.start()
    frame = read(put(tmp_path, text.encode()))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert frame.labels is not None
    assert frame.labels.tolist() == [7] * 2000 + [-1]
    assert peak < 100_000_000


BAD_TABLES = {
    "which columns": ("1 1.5 2.5 3.5\n2 4.5 5.5 6.5\n", "can't tell which of the 4 columns"),
    "words and more": ("a 1.5 2.5 3.5 4.5\n", "can't tell which"),
    "other names": ("range,azimuth,height\n1.5,2.5,3.5\n", "no columns x, y and z among range"),
    "whole numbers": ("1500 2500 3500\n4000 5000 6000\n", "depth_unit"),
    "short line": ("1.5,2.5,3.5\n4.5,5.5\n", "below line 1"),
    "row without its label": ("1.5 2.5 3.5 wall\n" * 3 + "4.5 5.5 6.5\n", "column"),
    "word": ("1.5,2.5,3.5\n" * 1500 + "4.5,x,6.5\n" + "1.5,2.5,3.5\n" * 1500, "'x'"),
    "bytes": ("1.5,2.5,3.5\n" * 1000 + "\0\0\n", "no text"),
    "all invalid": ("nan nan nan\nnan nan nan\n", "invalid"),
}


@pytest.mark.parametrize(("text", "cause"), BAD_TABLES.values(), ids=BAD_TABLES.keys())
def test_tables_that_cannot_be_told_are_refused(tmp_path: Path, text: str, cause: str) -> None:
    with pytest.raises(InputError, match=rf"bad\.csv: .*{cause}"):
        read(put(tmp_path, text.encode(), "bad.csv"))
