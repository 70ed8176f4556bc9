"""Results as plain data that a renamed module or a reworded sentence does not change, and how two of them differ."""

from __future__ import annotations

import base64
import binascii
import hashlib
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

LEFT_OUT = ("timing_ms", "message", "assumed", "source")
"""Keys of times and of sentences for people."""

VALUES_ONLY = ("config", "evidence")
"""Keys below which names are internal: only the values count, in the order of their size."""

LONGEST = 64
"""Longer lists of numbers are kept as a digest."""

RELATIVE = 1e-12
"""Tolerance for a commit that changes the order of a summation and says so."""


def plain(result: Any) -> Any:
    """A result as JSON has it, with every float to the last bit."""
    if isinstance(result, np.ndarray):
        return digest(result.ravel().tolist())
    return _reduced(result.to_dict()) if hasattr(result, "to_dict") else _reduced(result)


def _reduced(value: Any) -> Any:
    if isinstance(value, dict):
        kept = {key: part for key, part in value.items() if key not in LEFT_OUT}
        return {key: _values(part) if key in VALUES_ONLY else _reduced(part) for key, part in kept.items()}
    if isinstance(value, list | tuple):
        parts = [_reduced(part) for part in value]
        numbers = list(_leaves(parts))
        long = len(numbers) > LONGEST and all(isinstance(number, float | int | None) for number in numbers)
        return digest(numbers) if long else parts
    return _number(value)


def _number(value: Any) -> Any:
    """A number of NumPy's as Python's own; not-a-number and infinity as text, which JSON lacks."""
    value = value.item() if isinstance(value, np.generic) else value
    return repr(value) if isinstance(value, float) and not math.isfinite(value) else value


def _values(value: Any) -> Any:
    """The leaves below a key that are not null: numbers by size, and how often every text stands there."""
    leaves = [number for leaf in _leaves(value) if leaf is not None for number in _unpacked(leaf)]
    numbers = sorted(leaf for leaf in leaves if isinstance(leaf, float | int) and not isinstance(leaf, bool))
    rest = sorted(str(leaf) for leaf in leaves if not isinstance(leaf, float | int) or isinstance(leaf, bool))
    texts = {text: rest.count(text) for text in dict.fromkeys(rest)}
    return {"numbers": digest(numbers) if len(numbers) > LONGEST else numbers, "texts": texts}


def _unpacked(leaf: Any) -> list[Any]:
    """The numbers of a packed vector; any other leaf as it is."""
    if not isinstance(leaf, str) or len(leaf) <= LONGEST:
        return [leaf]
    try:
        return np.frombuffer(base64.b64decode(leaf, validate=True), "<f8").tolist()
    except (binascii.Error, ValueError):
        return [leaf]


def _leaves(value: Any) -> Iterator[Any]:
    if isinstance(value, dict | list | tuple):
        for part in value.values() if isinstance(value, dict) else value:
            yield from _leaves(part)
    else:
        yield value


def digest(numbers: list[Any]) -> dict[str, Any]:
    """Number, sums and a hash of many numbers; the hash is compared only to the last bit."""
    values = [math.nan if number is None else float(number) for number in numbers]
    finite = [value for value in values if math.isfinite(value)]
    return {
        "count": len(values),
        "finite": len(finite),
        "sum": math.fsum(finite),
        "size": math.fsum(map(abs, finite)),
        "moment": math.fsum(i * value for i, value in enumerate(values) if math.isfinite(value)),
        "hash": hashlib.sha256(np.array(values, "<f8").tobytes()).hexdigest()[:16],
    }


def differences(old: Any, new: Any, tolerance: float, key: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Key, old and new value of everything that differs."""
    if isinstance(old, dict) and isinstance(new, dict):
        for name in [*old, *(name for name in new if name not in old)]:
            if name == "hash" and tolerance > 0.0:
                continue
            missing = "(missing)"
            yield from differences(
                old.get(name, missing), new.get(name, missing), tolerance, f"{key}.{name}".strip(".")
            )
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for number, pair in enumerate(zip(old, new, strict=True)):
            yield from differences(*pair, tolerance, f"{key}[{number}]")
    elif not _same(old, new, tolerance):
        yield key, old, new


def _same(old: Any, new: Any, tolerance: float) -> bool:
    if old == new and type(old) is type(new):
        return True
    if not isinstance(old, float) or not isinstance(new, float):
        return False
    return tolerance > 0.0 and distance(old, new) <= tolerance


def distance(old: Any, new: Any) -> float:
    """Relative distance of two numbers; infinite for anything else."""
    if not isinstance(old, float) or not isinstance(new, float):
        return math.inf
    return abs(old - new) / max(abs(old), abs(new), 1e-300)
