"""Text of JSON and TOML files as plain data, within bounds; what can't be read is told with its remedy."""

from __future__ import annotations

import json
import os
import tomllib
from pathlib import Path
from typing import Any

from siloscope.errors import InputError


def content(path: Path, largest: int, what: str, remedy: str) -> bytes:
    """The bytes of a file of at most `largest`; `what` it should be and the `remedy` are for the message."""
    try:
        if path.stat().st_size > largest:
            raise InputError(f"{path}: too large for {what}; {remedy}")
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: can't be read ({error.strerror}); check the path and its permissions") from None


def from_json(data: bytes, source: str, remedy: str) -> Any:
    """The document of a JSON file."""
    try:
        return json.loads(data)
    except (ValueError, RecursionError):
        raise InputError(f"{source}: no JSON document, or a damaged one; {remedy}") from None


def from_toml(data: bytes, source: str, what: str, remedy: str) -> dict[str, Any]:
    """The table of a TOML file."""
    try:
        return tomllib.loads(data.decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(f"{source}: no TOML {what} ({error}); {remedy}") from None


def write_json(path: Path, document: Any) -> None:
    """Writes a document without blanks; a file that is already there stays whole until the new one is complete."""
    text = json.dumps(document, allow_nan=False, separators=(",", ":")) + "\n"
    beside = path.with_name(f".{path.name}.part")
    try:
        beside.write_text(text, encoding="utf-8")
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)
