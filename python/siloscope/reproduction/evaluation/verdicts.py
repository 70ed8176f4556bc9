"""Rules that say whether a number agrees with the paper's."""

from __future__ import annotations

from siloscope.reproduction.evaluation.tables import number

FACTOR = 2.0
"""Within this factor two numbers agree: the paper's scenes are only known in part, its frames not at all."""


def judged(here: float | None, paper: float) -> str:
    """ "better", "agrees" or "worse": an error of ours beside the paper's."""
    if here is None:
        return "no answer"
    if here > FACTOR * paper:
        return "worse"
    return "better" if here < paper / FACTOR else "agrees"


def holds(claim: bool) -> str:
    """ "agrees" or "differs": a statement of the paper, tried here."""
    return "agrees" if claim else "differs"


def listed(parts: list[str]) -> str:
    """ "a, b and c"."""
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}" if parts else "none"


def millimetres(value: float | None) -> str:
    """ "1.23 mm", or "no answer"."""
    return "no answer" if value is None else f"{number(value)} mm"
