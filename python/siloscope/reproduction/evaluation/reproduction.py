"""Runs what is wanted and writes the page, the tables and the pictures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from siloscope.reproduction.evaluation.chapter import Chapter
from siloscope.reproduction.evaluation.page import page
from siloscope.reproduction.evaluation.plan import Plan
from siloscope.reproduction.evaluation.tables import Table
from siloscope.reproduction.evaluation.targets import Wanted, wanted
from siloscope.reproduction.jobs import Job, program
from siloscope.reproduction.running import Progress, Results, run
from siloscope.reproduction.store import Store

FOLDER = "results"
"""Tables and pictures are in this folder beside the page."""

STORE = "finished.jsonl"
"""Finished jobs."""


@dataclass(frozen=True)
class Reproduction:
    """The chapters that were asked for."""

    plan: Plan
    chapters: tuple[Chapter, ...]

    @classmethod
    def of(
        cls, names: Sequence[str], plan: Plan, out: Path, *, workers: int = 2, progress: Progress | None = None
    ) -> Reproduction:
        """Runs every job behind the names whose result is not in `out` yet.

        Raises
        ------
        UsageError
            For an unknown name.
        """
        parts = wanted(names)
        jobs: list[Job] = [job for part in parts for job in part.module.jobs(plan)]
        results = run(jobs, Store(out / FOLDER / STORE), workers=workers, progress=progress)
        return cls(plan, tuple(_chapter(part, plan, results) for part in parts))

    def write(self, out: Path, command: str, told: Callable[[str], None] = lambda _: None) -> list[Path]:
        """Writes ``results.md``, and CSV and PNG files into the folder beside it; `told` hears what is drawn."""
        folder = out / FOLDER
        folder.mkdir(parents=True, exist_ok=True)
        written = [_written(folder / f"{table.name}.csv", table.csv()) for table in self.tables]
        for picture in (picture for chapter in self.chapters for picture in chapter.pictures):
            told(f"drawing {picture.name}")
            written.append(_drawn(folder / f"{picture.name}.png", picture.draw(), picture.dpi))
        return [_written(out / "results.md", page(self.chapters, self.plan, command, FOLDER)), *written]

    @property
    def tables(self) -> list[Table]:
        """All tables."""
        return [table for chapter in self.chapters for table in chapter.tables]

    def to_dict(self) -> dict[str, Any]:
        """The document of ``siloscope reproduce --json`` (schema ``siloscope.reproduction/1``)."""
        verdicts = [verdict.to_dict() for chapter in self.chapters for verdict in chapter.verdicts]
        return {
            "schema": "siloscope.reproduction/1",
            "program": program(),
            "steps": self.plan.steps,
            "tables": {table.name: table.to_dict() for table in self.tables},
            "verdicts": verdicts,
        }


def _chapter(part: Wanted, plan: Plan, results: Results) -> Chapter:
    """A chapter with only what is wanted of it."""
    chapter: Chapter = part.module.chapter(plan, results)
    kept = tuple(block for block in chapter.blocks if isinstance(block, str) or block.name in part.items)
    return replace(chapter, blocks=kept)


def _written(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def _drawn(path: Path, figure: Any, dpi: int) -> Path:
    """A picture in few colours, which keeps it small."""
    from siloscope.reporting.plots.style import png

    path.write_bytes(_reduced(png(figure, dpi)))
    return path


def _reduced(data: bytes) -> bytes:
    """A PNG with a palette of 128 colours."""
    import io

    from PIL import Image

    buffer = io.BytesIO()
    with Image.open(io.BytesIO(data)) as picture:
        picture.convert("RGB").quantize(128, dither=Image.Dither.NONE).save(buffer, format="PNG", optimize=True)
    return buffer.getvalue()
