"""Results that take the place of older ones in a folder."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path


def without_older(directory: Path, written: Sequence[Path], known: Iterable[str]) -> list[Path]:
    """The written files, after those of the known names that an earlier answer left beside them were deleted.

    Raises `OSError` where that is not possible.
    """
    for name in set(known) - {path.name for path in written}:
        (directory / name).unlink(missing_ok=True)
    return list(written)
