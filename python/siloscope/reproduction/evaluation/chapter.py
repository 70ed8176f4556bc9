"""A part of the results page: sentences, tables and pictures, and what agrees with the paper."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING

from siloscope.reproduction.evaluation.tables import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Picture:
    """A figure that is drawn when it is written."""

    name: str
    """Stem of its PNG file."""
    caption: str
    draw: Callable[[], Figure]
    dpi: int = 80


@dataclass(frozen=True)
class Verdict:
    """A claim of the paper beside what came out here."""

    claim: str
    paper: str
    here: str
    outcome: str
    """One of "better", "agrees", "worse", "differs", "no answer"."""
    why: str
    """Why it is so, or what it means."""

    def to_dict(self) -> dict[str, str]:
        """Plain data."""
        return asdict(self)


@dataclass(frozen=True)
class Chapter:
    """Blocks in reading order."""

    title: str
    blocks: tuple[str | Table | Picture, ...]
    verdicts: tuple[Verdict, ...] = field(default=())

    @property
    def tables(self) -> list[Table]:
        """Its tables."""
        return [block for block in self.blocks if isinstance(block, Table)]

    @property
    def pictures(self) -> list[Picture]:
        """Its pictures."""
        return [block for block in self.blocks if isinstance(block, Picture)]
