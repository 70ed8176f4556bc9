"""Results as JSON documents: arrays as lists, what is no number as null."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """A value as JSON has it: arrays as lists, NaN and infinities as null, what is unknown as text."""
    match value:
        case dict():
            return {str(key): plain(entry) for key, entry in value.items()}
        case list() | tuple():
            return [plain(entry) for entry in value]
        case np.ndarray() | np.generic():
            return plain(value.tolist())
        case float():
            return value if np.isfinite(value) else None
        case None | bool() | int() | str():
            return value
        case _:
            return str(value)


def text(document: Any, indent: int | None = None) -> str:
    """The text of a document, strictly JSON; without an indent in one line."""
    return json.dumps(plain(document), indent=indent, allow_nan=False)


def write(path: Path, document: Any) -> Path:
    """Writes a document, indented for people; raises `OSError` where that is not possible."""
    path.write_text(text(document, 2) + "\n", "utf-8")
    return path
