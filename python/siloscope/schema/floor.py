"""``floor`` of a calibration: what is known of the bottom."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BeforeValidator, PlainValidator, model_validator

from siloscope.reasons import BOTTOM_EVIDENCE, BOTTOM_KINDS
from siloscope.schema.fields import Array, NotNegative, at_least, finite, numbers, vector
from siloscope.schema.validation import Document, wrong

MOST_CELLS = 512
"""Rows of a floor's map."""


def _kind(value: str) -> str:
    if value not in BOTTOM_KINDS:
        raise wrong(f"is {value!r}; known are {', '.join(BOTTOM_KINDS)}")
    return value


def _evidence(value: str) -> str:
    if value not in BOTTOM_EVIDENCE:
        raise wrong(f"is {value!r}; known are {', '.join(BOTTOM_EVIDENCE)}")
    return value


class SeenConeDocument(Document):
    """The conical surface that was seen."""

    angle_rad: NotNegative
    std_rad: NotNegative


def _square(value: Any) -> Array:
    if not isinstance(value, list) or not 2 <= len(value) <= MOST_CELLS:
        raise wrong(f"must be 2 to {MOST_CELLS} rows")
    return np.array([numbers(row, len(value)) for row in value])


class FloorMapDocument(Document):
    """Heights of a floor on a square grid."""

    reach: Annotated[float, BeforeValidator(finite), AfterValidator(at_least(0.001))]
    z: Annotated[Array, PlainValidator(_square)]
    std: Annotated[Array, PlainValidator(_square)]
    derivatives: Annotated[Array, vector(10)] | None = None
    seen: NotNegative
    completed: str | None = None

    @model_validator(mode="after")
    def _fits(self) -> FloorMapDocument:
        if self.z.shape != self.std.shape or (self.std < 0.0).any():
            raise wrong("must have a deviation of 0 or more for each height", "std")
        return self


class FloorDocument(Document):
    """What is known of the bottom; a known one says how."""

    kind: Annotated[str, AfterValidator(_kind)]
    evidence: Annotated[str, AfterValidator(_evidence)] | None = None
    seen_cone: SeenConeDocument | None = None
    map: FloorMapDocument | None = None

    @model_validator(mode="after")
    def _known_how(self) -> FloorDocument:
        if self.kind != "unknown" and self.evidence is None:
            raise wrong("must say how the bottom is known", "evidence")
        return self
