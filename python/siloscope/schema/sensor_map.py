"""``map`` of a sensor in a result's ``config``: what the device reads wrong over its image."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import PlainValidator, model_validator

from siloscope.schema.fields import Array, numbers, symmetric
from siloscope.schema.validation import Document, wrong

MOST_NODES = 200
"""Nodes of a map along each side."""

MOST_ERROR = 0.5
"""Errors beyond this are no sensor's."""


def _grid(value: Any) -> Array:
    if not isinstance(value, list) or not 2 <= len(value) <= MOST_NODES or not isinstance(value[0], list):
        raise wrong(f"must be 2 to {MOST_NODES} rows")
    columns = len(value[0])
    if not 2 <= columns <= MOST_NODES:
        raise wrong(f"must have 2 to {MOST_NODES} columns")
    return np.array([numbers(row, columns) for row in value])


class SensorMapDocument(Document):
    """Errors with their deviations."""

    power: Literal[1, 2]
    error: Annotated[Array, PlainValidator(_grid)]
    std: Annotated[Array, PlainValidator(_grid)]
    opens: Annotated[Array, symmetric(7)]

    @model_validator(mode="after")
    def _fits(self) -> SensorMapDocument:
        if self.error.shape != self.std.shape or (self.std < 0.0).any():
            raise wrong("must have a deviation of 0 or more for each error", "std")
        if (np.abs(self.error) > MOST_ERROR).any():
            raise wrong(f"must lie between -{MOST_ERROR:g} and {MOST_ERROR:g}", "error")
        return self
