"""Where the genuine recordings by others lie; they are not part of the project."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

FOLDER = Path(os.environ.get("SILOSCOPE_REALDATA", Path(__file__).parents[1].parent / "shared" / "realdata"))


def path(*parts: str) -> Path:
    """A genuine file; skips the test where it is absent."""
    file = FOLDER.joinpath(*parts)
    if not file.exists():
        pytest.skip(f"no {'/'.join(parts)} in {FOLDER}; set SILOSCOPE_REALDATA to the folder of genuine recordings")
    return file
