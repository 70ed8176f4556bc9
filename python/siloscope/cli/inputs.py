"""Frames as they stand on a command line: files, folders, globs that the shell left alone, standard input."""

from __future__ import annotations

import glob
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

import siloscope
from siloscope.errors import InputError
from siloscope.io import FrameSource

STANDARD_INPUT = Path("-")
SHOWN = "standard-input"
"""What frames from standard input are called in messages."""

Frames = Annotated[
    list[Path],
    typer.Argument(metavar="FRAME…", help="Images, arrays, clouds, recordings, folders, globs; - for standard input."),
]


def expanded(files: Sequence[Path]) -> list[Path]:
    """The files, with patterns that name none as they stand replaced by what they match, in natural order.

    Raises `InputError` for a pattern that matches nothing.
    """
    found: list[Path] = []
    for file in files:
        if file == STANDARD_INPUT or not glob.has_magic(str(file)) or file.exists():
            found.append(file)
            continue
        matched = sorted(glob.glob(str(file), recursive=True))
        if not matched:
            raise InputError(f"{file}: matches no file; check the pattern")
        found += map(Path, matched)
    return found


@contextmanager
def opened(files: Sequence[Path], **terms: Any) -> Iterator[FrameSource]:
    """One source of all files; standard input is stored while it is read, for formats are told by their content."""
    with standard_input(expanded(files)) as paths, siloscope.open(paths, **terms) as source:
        if source.path.name == SHOWN:
            source.name = SHOWN
        yield source


@contextmanager
def standard_input(files: Sequence[Path]) -> Iterator[list[Path]]:
    """The files, with `-` replaced by a file that holds what comes on standard input."""
    if STANDARD_INPUT not in files:
        yield list(files)
        return
    with tempfile.TemporaryDirectory(prefix="siloscope-") as folder:
        stored = Path(folder) / SHOWN
        with stored.open("wb") as file:
            shutil.copyfileobj(sys.stdin.buffer, file)
        yield [stored if file == STANDARD_INPUT else file for file in files]


def is_many(files: Sequence[Path], source: FrameSource) -> bool:
    """Whether every frame is meant: of several files, and of a folder of single frames; not of one recording."""
    several = len(expanded(files)) > 1 or source.format == "folder"
    return several and source.frame_count != 1
