"""Kinds of entries: numbers within bounds, vectors, symmetric matrices; each says what it must be."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BeforeValidator, PlainValidator

from siloscope.schema.validation import wrong

LARGEST_NUMBER = 1e300
"""No number of a document is larger; whole numbers of JSON may be of any length."""

Array = NDArray[np.float64]


def is_finite(value: Any) -> bool:
    """Whether a value is a number, and neither text, truth value, NaN nor infinite."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < LARGEST_NUMBER


def not_finite(value: Any) -> str:
    """What is wrong with a value that is no such number."""
    return f"must be a finite number, not {str(value)[:40]!r}"


def finite(value: Any) -> float:
    """The number."""
    if not is_finite(value):
        raise wrong(not_finite(value))
    return float(value)


def at_least(least: float) -> Callable[[float], float]:
    """Check of a lower bound."""

    def check(value: float) -> float:
        if value < least:
            raise wrong(f"must be at least {least:g}, not {value:g}")
        return value

    return check


def _index(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise wrong(f"must be a whole number from 0, not {value!r}")
    return value


Number = Annotated[float, BeforeValidator(finite)]
NotNegative = Annotated[float, BeforeValidator(finite), AfterValidator(at_least(0.0))]
Index = Annotated[int, BeforeValidator(_index)]


def numbers(value: Any, length: int, nullable: bool = False) -> Array:
    """A list of `length` numbers as an array; null becomes NaN if `nullable`."""
    if not isinstance(value, list):
        raise wrong("must be a list")
    if len(value) != length:
        raise wrong(f"must have {length} numbers, not {len(value)}")
    return np.array([math.nan if nullable and v is None else finite(v) for v in value])


def vector(length: int, *, nullable: bool = False) -> PlainValidator:
    """A list of numbers, to be an array (length,)."""
    return PlainValidator(lambda value: numbers(value, length, nullable))


def named(names: tuple[str, ...]) -> PlainValidator:
    """An object of named numbers, to be a tuple in the order of `names`."""

    def check(value: Any) -> tuple[float, ...]:
        if not isinstance(value, dict):
            raise wrong("must be an object")
        for name in names:
            if name not in value:
                raise wrong("is missing", name)
            if not is_finite(value[name]):
                raise wrong(not_finite(value[name]), name)
        return tuple(float(value[name]) for name in names)

    return PlainValidator(check)


def triangle(size: int) -> PlainValidator:
    """The upper triangle of a symmetric matrix row by row, to be an array (size, size) without negative variance."""
    upper = np.triu_indices(size)

    def check(value: Any) -> Array:
        half = np.zeros((size, size))
        half[upper] = numbers(value, len(upper[0]))
        return _positive(half + half.T - np.diag(np.diag(half)))

    return PlainValidator(check)


def symmetric(size: int) -> PlainValidator:
    """Rows of a symmetric matrix, to be an array (size, size) without negative variance."""

    def check(value: Any) -> Array:
        rows = value if isinstance(value, list) else []
        if len(rows) != size or not all(isinstance(row, list) and len(row) == size for row in rows):
            raise wrong(f"must be {size} rows of {size} numbers")
        full = np.array([[finite(v) for v in row] for row in rows])
        if not np.allclose(full, full.T, rtol=1e-6, atol=1e-9 * float(np.abs(full).max(initial=0.0))):
            raise wrong("must be symmetric")
        return _positive(full)

    return PlainValidator(check)


def _positive(matrix: Array) -> Array:
    """The matrix, if it has no variance below zero; in units of its diagonal, so that metres don't hide radians."""
    diagonal = np.diag(matrix)
    scale = np.where(diagonal > 0.0, 1.0 / np.sqrt(np.maximum(diagonal, 1e-300)), 0.0)
    if (diagonal < 0.0).any() or np.linalg.eigvalsh(matrix * scale * scale[:, None]).min() < -1e-6:
        raise wrong("is no covariance or information: a variance in it is negative")
    return matrix
