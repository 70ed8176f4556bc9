"""Libraries that only some formats and sensors need, imported when they do."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from siloscope.errors import InputError


def need(module: str, extra: str, what: str) -> Any:
    """The module; raises `InputError` that says `what` needs the extra, and how it is installed."""
    try:
        return import_module(module)
    except ImportError as error:
        missing = "" if error.name == module else f" ({error})"
        raise InputError(f"{what} needs the extra '{extra}'{missing}: pip install 'siloscope[{extra}]'") from None
