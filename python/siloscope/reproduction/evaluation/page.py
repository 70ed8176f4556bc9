"""The results as one Markdown page."""

from __future__ import annotations

import platform
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from siloscope.reproduction.evaluation.chapter import Chapter, Picture, Verdict
from siloscope.reproduction.evaluation.plan import Plan
from siloscope.reproduction.evaluation.published import STEPS
from siloscope.reproduction.evaluation.tables import Table
from siloscope.reproduction.evaluation.verdicts import listed
from siloscope.reproduction.jobs import program
from siloscope.reproduction.trials import STRIDE

INTRODUCTION = """
This page is written by `siloscope reproduce`; no number on it is typed by hand. It repeats the evaluation of O. Vila,
I. Boada, N. Coll, M. Fort, E. Farres: *Automatic silo axis detection from RGB-D sensor data for content
monitoring*, and puts our numbers beside the paper's.

Columns: **paper**, what it prints; **shape-tensor**, its six steps as this program has them; **surface**, cylinder and
cone fitted to the wall, which is told nothing but the frame, or the silo's **diameter** as well, or the sensor's
**profile** as well. A dash means that there is no such number: the paper has none, or the frame was refused.
"""

MEANINGS = """
"agrees" means that our error is within a factor of two of the paper's, or that its statement holds here; "better" and
"worse" are beyond that factor, "differs" is a statement that does not hold here.
"""


def page(chapters: Sequence[Chapter], plan: Plan, command: str, folder: str) -> str:
    """Markdown of everything; pictures are in `folder` beside the page."""
    parts = [
        "# Results",
        _folded(INTRODUCTION),
        _made(plan, command),
        *_summary(chapters),
        *(_chapter(chapter, folder) for chapter in chapters),
    ]
    return "\n\n".join(parts) + "\n"


def _made(plan: Plan, command: str) -> str:
    """How to make the page again."""
    lines = [
        f"- Made by `{command}`.",
        f"- Program: siloscope {program()} (version and hash of the code), Python {platform.python_version()}, "
        f"NumPy {np.__version__}.",
        f"- {_size(plan)}",
        "- Every scene has fixed seeds, so the same program gives the same numbers (times excepted).",
        f"- PC average distance (Eq. 11): every {STRIDE}th point of the adjusted cloud against the whole reference.",
    ]
    return "\n".join(lines)


def _size(plan: Plan) -> str:
    full = listed([f"{steps} ({name})" for name, steps in STEPS.items()])
    if plan.steps is None:
        return f"Steps of each discharge, as in the paper: {full}."
    return f"**Shortened run**: {plan.steps} steps a discharge instead of the paper's {full}, and fewer repeats."


def _summary(chapters: Sequence[Chapter]) -> Iterator[str]:
    verdicts = [verdict for chapter in chapters for verdict in chapter.verdicts]
    if not verdicts:
        return
    yield "## What agrees, what does not, and why"
    yield f"{_counted(verdicts)} {_folded(MEANINGS)}"
    yield _verdict_table(verdicts).markdown()


def _counted(verdicts: Sequence[Verdict]) -> str:
    outcomes = ("better", "agrees", "worse", "differs", "no answer")
    counts = {outcome: sum(verdict.outcome == outcome for verdict in verdicts) for outcome in outcomes}
    told = [f"{count} {outcome}" for outcome, count in counts.items() if count]
    return f"Of {len(verdicts)} comparisons: {listed(told)}."


def _verdict_table(verdicts: Iterable[Verdict]) -> Table:
    head = ("the paper's", "paper", "here", "", "why")
    rows = tuple((v.claim, v.paper, v.here, f"**{v.outcome}**", v.why) for v in verdicts)
    return Table("verdicts", "The paper's statements beside ours (shape-tensor unless said otherwise)", head, rows)


def _chapter(chapter: Chapter, folder: str) -> str:
    return "\n\n".join([f"## {chapter.title}", *(_block(block, folder) for block in chapter.blocks)])


def _block(block: str | Table | Picture, folder: str) -> str:
    if isinstance(block, Table):
        return block.markdown()
    if isinstance(block, Picture):
        return f"![{block.caption}]({folder}/{block.name}.png)\n\n*{block.caption}*"
    return _folded(block)


def _folded(text: str) -> str:
    """Paragraphs without the line breaks of the source."""
    paragraphs = text.strip().split("\n\n")
    return "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)
