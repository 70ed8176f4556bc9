"""Tables of numbers as text: points (XYZ, CSV, PTS) or a depth image (CSV with a line for every row of pixels)."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError
from siloscope.io.beside import take_camera_beside
from siloscope.io.clouds.columns import by_pixel, cloud_frame
from siloscope.io.clouds.layout import Layout, is_number, layout
from siloscope.io.source import Format, FrameSource, Item, Options, check_image_size, read_bytes
from siloscope.io.terms import UnknownUnit
from siloscope.types.frame import Frame

_SAMPLE = 200
"""Lines looked at from the start, the middle and the end to tell the columns."""

_LABEL = np.dtype("U20")
"""Room for a label: more than a whole number needs, and bounded, since every row takes as much."""

_UTF_16 = (b"\xff\xfe", b"\xfe\xff")

_FORTRAN = re.compile(rb"(\d\.?)[dD]([+-]?\d)")


class TableSource(FrameSource):
    """One table."""

    def __init__(self, path: Path, options: Options) -> None:
        super().__init__(path, "xyz", options)
        self._text = _text(path)
        lines = _sample(self._text)
        self.layout = layout(self.name, lines)
        self._rows = _filled_lines(self._text) - sum(1 for line in lines[: self.layout.first] if line)
        self._columns = len(lines[self.layout.first].split(self.layout.delimiter))
        if self.layout.columns is None:
            check_image_size(self.name, self._columns, self._rows)
            take_camera_beside(self, (self._columns, self._rows))
        if self.layout.unit_from:
            self.provenance |= {"unit": self.layout.unit, "unit_from": self.layout.unit_from}

    def _items(self) -> Iterator[Item]:
        yield Item(self.path.name, self._image if self.layout.columns is None else self._points)

    def _count(self) -> int:
        return 1

    def _streams(self) -> list[dict[str, Any]]:
        depth = self.layout.columns is None
        kind, dtype = ("depth", "raw units" if self.layout.whole else "float64") if depth else ("points", "float64")
        size = [self._columns, self._rows] if depth else [self._rows]
        return [{"name": kind, "kind": kind, "size": size, "dtype": dtype, "frames": 1, "chosen": True}]

    def _image(self) -> Frame:
        depth = _numbers(self.name, self._text, self.layout, None)
        if self.layout.whole:
            depth = _raw(self.name, depth)
        return Frame(depth=depth, source=self.name)

    def _points(self) -> Frame:
        table = _numbers(self.name, self._text, self.layout, self.layout.columns)
        if self.layout.whole and self.layout.unit_from is None and self.options.depth_unit is None:
            raise UnknownUnit(
                f"{self.name}: the coordinates are whole numbers; give their unit with --depth-unit (0.001 for "
                "millimetres, 1 for metres)"
            )
        columns = {axis: table[:, i] * self.layout.unit for i, axis in enumerate("xyz")}
        frame = cloud_frame(self.name, columns, None)
        if self.layout.pixel is not None:
            return by_pixel(frame, _numbers(self.name, self._text, self.layout, self.layout.pixel))
        return replace(frame, labels=_labels(self.name, self._text, self.layout, len(table)))


def _text(path: Path) -> bytes:
    text = _utf_8(path, read_bytes(path)).removeprefix(b"\xef\xbb\xbf")
    if b"\0" in text:
        raise InputError(f"{path}: bytes that are no text among the numbers; the file is damaged, export it again")
    return text.replace(b"\r\n", b"\n").replace(b"\r", b"\n")


def _utf_8(path: Path, text: bytes) -> bytes:
    """The text as spreadsheets and Windows shells write it, in UTF-16, as UTF-8; other texts as they are."""
    if not text.startswith(_UTF_16):
        return text
    try:
        return text.decode("utf-16").encode("utf-8")
    except UnicodeError as error:
        raise InputError(f"{path}: damaged UTF-16 text ({error}); save it as UTF-8") from None


def _sample(text: bytes) -> list[str]:
    """All lines of a short text; of a long one some from its start, middle and end."""
    lines = text.split(b"\n", _SAMPLE)
    if len(lines) > _SAMPLE:
        rest = lines.pop()
        middle = rest[len(rest) // 2 :].split(b"\n", _SAMPLE)[1:_SAMPLE]
        lines += middle + rest.rsplit(b"\n", _SAMPLE)[-_SAMPLE:]
    return [line.decode("latin-1") for line in lines]


def _filled_lines(text: bytes) -> int:
    """How many lines are not empty."""
    ends = np.frombuffer(text, np.uint8) == ord("\n")
    filled = int(np.count_nonzero(ends[1:] & ~ends[:-1]))
    return filled + (not text.endswith(b"\n"))


def _numbers(name: str, text: bytes, known: Layout, columns: tuple[int, ...] | None) -> NDArray[np.float64]:
    """The wanted columns of all rows; raises `InputError` naming row and column of what is no number."""
    table: NDArray[np.float64] = _columns(name, _plain(text, known), known, np.float64, columns)
    return table


def _columns(name: str, text: bytes, known: Layout, dtype: Any, columns: tuple[int, ...] | None) -> NDArray[Any]:
    reading: dict[str, Any] = {"delimiter": known.delimiter, "skiprows": known.first, "comments": "#"}
    with warnings.catch_warnings(action="ignore"):
        try:
            return np.loadtxt(io.BytesIO(text), dtype, usecols=columns, ndmin=2, quotechar='"', **reading)
        except ValueError as error:
            raise InputError(f"{name}: below line {known.first + 1}, {error}; correct or export it again") from None


def _plain(text: bytes, known: Layout) -> bytes:
    """Numbers as C writes them, without empty columns at the ends of the lines."""
    if known.decimal_comma:
        text = text.replace(b",", b".")
    if known.columns is None and known.delimiter:
        text = re.sub(known.delimiter.encode() + rb"\s*$", b"", text, flags=re.MULTILINE)
    return _FORTRAN.sub(rb"\1e\2", text) if known.fortran else text


def _raw(name: str, depth: NDArray[np.float64]) -> NDArray[Any]:
    """Whole numbers as raw units."""
    if not np.all((depth >= 0) & (depth <= 65_535)):
        raise InputError(f"{name}: raw depths outside 0 to 65535; write metres with decimals, or 16-bit raw units")
    return depth.astype(np.uint16)


def _labels(name: str, text: bytes, known: Layout, count: int) -> NDArray[np.int64] | None:
    """Labels that are whole numbers, -1 for other words; None where there are no numbers."""
    if known.label is None:
        return None
    words = _columns(name, text, known, _LABEL, (known.label,))[:, 0]
    labels = np.array([_label(word) for word in words.tolist()], np.int64)
    return labels if len(labels) == count and np.any(labels >= 0) else None


def _label(word: str) -> int:
    return int(word) if word.isascii() and word.isdigit() and len(word) < 19 else -1


def _sniff(head: bytes, path: Path) -> bool:
    if head.startswith(_UTF_16):
        head = head[: len(head) // 2 * 2].decode("utf-16", "replace").encode("utf-8")
    if b"\0" in head:
        return False
    lines = head.decode("latin-1").splitlines()
    return any(_looks_like_values(line) for line in lines[:100])


def _looks_like_values(line: str) -> bool:
    words = line.replace(";", " ").replace(",", " ").split()
    return len(words) >= 3 and sum(map(is_number, words)) * 2 > len(words)


FORMAT = Format("xyz", _sniff, TableSource)
