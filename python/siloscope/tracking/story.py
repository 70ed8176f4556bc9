"""The story of a silo's content: its readings, what happened between them, and when it will be empty."""

from __future__ import annotations

from dataclasses import dataclass

from siloscope.content import Content


@dataclass(frozen=True, eq=False)
class Moment:
    """One frame as measured, without its surface."""

    index: int
    time: float | None
    content: Content
    datum: float | None
    """z of the heights' zero."""
