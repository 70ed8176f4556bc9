"""Results as values: compared by what they hold, pickled without what they cache, shown on one screen."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, is_dataclass
from importlib import import_module
from typing import Any

import numpy as np

LINE = 140
"""Most characters of a value in a `repr`, sentences aside."""

SHOWN = 12
"""Most numbers of an array in a `repr`."""


@dataclass(frozen=True, eq=False, repr=False)
class ByValue:
    """Base of frozen dataclasses that hold arrays; give them ``eq=False, repr=False``."""

    def __eq__(self, other: object) -> bool:
        """Whether all fields that take part are the same; arrays by type, shape and entries, NaN being equal to NaN."""
        if type(other) is not type(self):
            return NotImplemented
        compared = (field.name for field in fields(self) if field.compare)
        return all(same(getattr(self, name), getattr(other, name)) for name in compared)

    def __hash__(self) -> int:
        values = (getattr(self, field.name) for field in fields(self) if field.compare)
        return hash((type(self).__name__, *(value for value in values if isinstance(value, str))))

    def __getstate__(self) -> dict[str, Any]:
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def __repr__(self) -> str:
        lines = [f"    {name}={value}," for name, value in _told(self)]
        return "\n".join([f"{type(self).__name__}(", *lines, ")"])

    def _repr_html_(self) -> str:
        """What a notebook shows: the `repr`, and a picture of what has one."""
        html: str = import_module("siloscope.reporting.notebook").html(self)
        return html


def same(a: Any, b: Any) -> bool:
    """Whether two values are the same, arrays and containers of them included; NaN is the same as NaN."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return _same_arrays(a, b)
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return type(a) is type(b) and len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, float) and isinstance(b, float) and math.isnan(a):
        return math.isnan(b)
    return bool(a == b)


def _same_arrays(a: Any, b: Any) -> bool:
    if not isinstance(a, np.ndarray) or not isinstance(b, np.ndarray) or a.dtype != b.dtype:
        return False
    return np.array_equal(a, b, equal_nan=a.dtype.kind == "f")


def _told(value: Any) -> list[tuple[str, str]]:
    """The fields of a dataclass that hold something, each on one line; a covariance with its deviations."""
    told = [(field.name, getattr(value, field.name)) for field in fields(value) if field.repr]
    return [(name, _shown(held) + _deviations(name, held)) for name, held in told if not _is_empty(held)]


def _is_empty(value: Any) -> bool:
    return value is None or (isinstance(value, str | tuple | list | dict) and not value)


def _deviations(name: str, value: Any) -> str:
    if not name.endswith("covariance"):
        return ""
    return f" of std [{', '.join(format(v, '.2g') for v in np.sqrt(np.diag(value)))}]"


def _shown(value: Any) -> str:
    """A value on one line: long arrays, tuples and dictionaries by what they are."""
    if isinstance(value, np.ndarray):
        return _shown_array(value)
    if isinstance(value, ByValue):
        return f"{type(value).__name__}(…)"
    if is_dataclass(value):
        return _cut(f"{type(value).__name__}({', '.join(f'{name}={held}' for name, held in _told(value))})")
    if isinstance(value, dict):
        return _cut(f"{{{', '.join(f'{key}: {_shown(entry)}' for key, entry in value.items())}}}")
    if isinstance(value, tuple | list):
        whole = ", ".join(_shown(entry) for entry in value[:SHOWN])
        return (
            f"({whole})" if len(value) <= SHOWN and len(whole) < LINE else f"{len(value)} x {type(value[0]).__name__}"
        )
    if isinstance(value, float):
        return f"{value:.6g}"
    return _cut(" ".join(repr(value).split()))


def _shown_array(array: np.ndarray[Any, Any]) -> str:
    if array.size <= SHOWN and array.ndim == 1:
        return f"[{', '.join(format(v, '.6g') for v in array.tolist())}]"
    return f"{array.dtype} {array.shape}"


def _cut(text: str) -> str:
    return text if len(text) <= LINE else f"{text[: LINE - 1]}…"
