"""A remark on an answer: a stable code, how grave it is, and what was seen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from siloscope.reasons import NOTES, REMARKS


@dataclass(frozen=True)
class Remark:
    """A code of `siloscope.reasons.REMARKS` with what was seen."""

    code: str
    seen: str
    """The figures that led to it, in words."""
    refuses: bool = False
    """Whether it leaves the input without an answer."""

    @property
    def message(self) -> str:
        """What it means."""
        return REMARKS[self.code][0]

    @property
    def advice(self) -> str:
        """What to do."""
        return REMARKS[self.code][1]

    @property
    def severity(self) -> str:
        """ "note", "warning" or "refusal"."""
        return "refusal" if self.refuses else "note" if self.code in NOTES else "warning"

    @property
    def text(self) -> str:
        """What it means, with the figures."""
        return f"{self.message} ({self.seen})"

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {"code": self.code, "message": self.text, "severity": self.severity,
                "advice": self.advice, "seen": self.seen}  # fmt: skip
