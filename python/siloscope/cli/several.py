"""Answers for many frames: a JSON line or a table's row each, and the exit code of all of them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from siloscope.cli.outcome import PARTIAL, REFUSED
from siloscope.cli.progress import say, track
from siloscope.errors import InputError
from siloscope.io import FrameSource
from siloscope.schema import documents
from siloscope.types.frame import Frame

WIDTH = 160
"""Columns of text that goes into a file or a pipe."""


class Answer(Protocol):
    """An estimate or a content."""

    @property
    def ok(self) -> bool:
        """Whether there is an answer."""
        ...

    def to_dict(self) -> dict[str, Any]:
        """Its document."""
        ...


@dataclass
class Answers:
    """The answers so far, shown as they come."""

    columns: tuple[str, ...]
    as_json: bool
    rows: list[tuple[str, ...]] = field(default_factory=list)
    ok: int = 0
    other: int = 0

    def add(self, frame: Frame, answer: Answer, row: tuple[str, ...]) -> None:
        """Takes an answer; prints its line of JSON where that was asked for."""
        self.ok, self.other = self.ok + answer.ok, self.other + (not answer.ok)
        if self.as_json:
            print(documents.text({**answer.to_dict(), "frame": frame.source}), flush=True)
        else:
            self.rows.append((frame.source, *row))

    def finish(self, problems: list[str]) -> int:
        """Prints the table and what was not read; returns the exit code."""
        if not self.as_json:
            _print(self.columns, self.rows)
        for problem in problems:
            say(f"not read: {problem}")
        if not self.ok:
            return REFUSED
        return PARTIAL if self.other or problems else 0


T = TypeVar("T")


def each(source: FrameSource, one: Callable[[Frame], T], told: str) -> Iterator[tuple[Frame, T]]:
    """Every frame with what is made of it; one that can't be used counts as a problem of the source."""
    unusable: list[str] = []
    for frame in track(source, told):
        try:
            made = one(frame)
        except InputError as error:
            unusable.append(str(error))
            continue
        yield frame, made
    source.problems.extend(unusable)


def _print(columns: tuple[str, ...], rows: list[tuple[str, ...]]) -> None:
    table = Table(box=None, padding=(0, 2, 0, 0))
    table.add_column("frame", style="bold", overflow="fold")
    for name in columns:
        table.add_column(name, justify="right" if name else "left", no_wrap=bool(name))
    for row in rows:
        table.add_row(*map(escape, row))
    width = None if sys.stdout.isatty() else WIDTH
    Console(highlight=False, soft_wrap=True, width=width).print(table)
