"""What is asked of a run."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Plan:
    """Size of a run."""

    steps: int | None = None
    """Frames a discharge; None for the paper's numbers."""

    def few(self, count: int) -> int:
        """`count` repeats, or fewer in a short run."""
        return count if self.steps is None else min(count, self.steps)
