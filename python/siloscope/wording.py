"""Numbers and names as people read them."""

from __future__ import annotations

import math


def with_std(value: float | None, std: float | None, factor: float, unit: str) -> str:
    """``12.3 ± 0.4 mm`` with as many digits as the deviation deserves."""
    if value is None:
        return "not seen"
    if std is None or not math.isfinite(std):
        return f"{value * factor:.4g}{unit}"
    digits = 0 if std <= 0.0 else min(9, max(0, 1 - math.floor(math.log10(std * factor))))
    return f"{value * factor:.{digits}f} ± {std * factor:.{digits}f}{unit}"


def printable(name: str) -> str:
    """A file's name as text that can be encoded: bytes in it that are no UTF-8, as in old archives, become "?"."""
    return name.encode("utf-8", "replace").decode("utf-8")


def counted(number: int, noun: str) -> str:
    """``1 file``, ``3 files``."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
