"""What can be asked for, and which chapter has it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType

from siloscope.errors import UsageError
from siloscope.reproduction.evaluation import (
    axis_vectors,
    five_silos,
    four_sensors,
    limitations,
    perfect,
    perturbed,
    real,
    running_time,
)

CHAPTERS: dict[ModuleType, dict[str, tuple[str, ...]]] = {
    perfect: {"table3": ("table3",), "fig9": ("fig9", "fig10")},
    perturbed: {"table4": ("table4", "table4-coverage"), "fig11": ("fig11", "fig12")},
    real: {"table5": ("table5", "table5-coverage"), "fig13": ("fig13", "fig15")},
    four_sensors: {"table6": ("table6", "fig16"), "table7": ("table7",)},
    axis_vectors: {"fig14": ("fig14",)},
    five_silos: {"fig17": ("fig17",)},
    running_time: {"timing": ("timing",)},
    limitations: {"limitations": ("limitations-ratios", "limitations-feed", "limitations-size")},
}
"""Chapters in the page's order: the tables and figures behind each name."""

NAMES = tuple(name for targets in CHAPTERS.values() for name in targets)
"""Every name but "all"."""


@dataclass(frozen=True)
class Wanted:
    """A chapter, and which of its tables and figures are wanted."""

    module: ModuleType
    items: frozenset[str]


def wanted(names: Sequence[str]) -> list[Wanted]:
    """The chapters of some names; none or "all" means everything.

    Raises `UsageError` for an unknown name.
    """
    unknown = [name for name in names if name not in NAMES and name != "all"]
    if unknown:
        raise UsageError(f"unknown table '{unknown[0]}'; known are {', '.join(NAMES)} and all")
    chosen = set(NAMES) if not names or "all" in names else set(names)
    parts = {
        module: frozenset(item for name in targets if name in chosen for item in targets[name])
        for module, targets in CHAPTERS.items()
    }
    return [Wanted(module, items) for module, items in parts.items() if items]
