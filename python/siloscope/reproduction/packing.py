"""Dataclasses of arrays and numbers as plain data, without losing a digit."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import fields
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Packed = TypeVar("Packed")


def packed(value: Any) -> dict[str, Any]:
    """A flat dataclass as plain data."""
    return {field.name: _plain(getattr(value, field.name)) for field in fields(value)}


def unpacked(kind: type[Packed], data: Mapping[str, Any]) -> Packed:
    """The dataclass of `packed` data."""
    return kind(**{name: _array(value) if isinstance(value, dict) else value for name, value in data.items()})


def _plain(value: Any) -> Any:
    if not isinstance(value, np.ndarray):
        return value
    data = base64.b64encode(np.ascontiguousarray(value).tobytes()).decode()
    return {"dtype": value.dtype.str, "shape": list(value.shape), "data": data}


def _array(stored: Mapping[str, Any]) -> NDArray[Any]:
    flat = np.frombuffer(base64.b64decode(stored["data"]), np.dtype(stored["dtype"]))
    return flat.reshape(stored["shape"]).copy()
