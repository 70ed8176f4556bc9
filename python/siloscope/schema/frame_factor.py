"""What frames say, as it stands in files: vectors as base64 of little-endian doubles."""

from __future__ import annotations

import base64
import binascii
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, PlainValidator, model_validator

from siloscope.schema.fields import Array, Index, NotNegative, Number, numbers
from siloscope.schema.validation import Document, wrong

STATE = 71
"""Parameters of the joint fit."""

COLUMNS = {"cylinder": 49, "cone": 34, "whole": 12}
"""Kinds of shares with the number of their columns."""

MOST_RAYS = 1000
"""No frame keeps as many."""

Model = Literal["cylinder", "coaxial-cone", "oblique-cone", "free-cone", "cone-alone", "oblique-cone-alone"]


def packed(values: Array) -> str:
    """Numbers as text."""
    return base64.b64encode(np.ascontiguousarray(values, "<f8").tobytes()).decode("ascii")


def _unpacked(value: Any) -> Array:
    try:
        told = base64.b64decode(value, validate=True) if isinstance(value, str) else b"?"
    except (binascii.Error, ValueError):
        told = b"?"
    if len(told) % 8:
        raise wrong("must be base64 of 8 bytes a number")
    values = np.frombuffer(told, "<f8").astype(np.float64)
    if not np.isfinite(values).all():
        raise wrong("must be finite numbers")
    return values


Packed = Annotated[Array, PlainValidator(_unpacked)]


def _tuple(length: int, stds: slice, *, optional: bool = False) -> PlainValidator:
    """A list of numbers, to be a tuple; those of `stds` are not below zero."""

    def check(value: Any) -> tuple[float, ...] | None:
        if value is None and optional:
            return None
        told = tuple(numbers(value, length).tolist())
        if any(std < 0.0 for std in told[stds]):
            raise wrong("must not be below 0")
        return told

    return PlainValidator(check)


class Share(Document):
    """What some tiles say."""

    kind: Literal["cylinder", "cone", "whole"]
    information: Packed
    gradient: Packed
    sensor_fraction: Annotated[Number, Field(ge=0.0, le=1.0)]
    seen: NotNegative

    @model_validator(mode="after")
    def _whole(self) -> Share:
        n = COLUMNS[self.kind]
        for name, values, size in (
            ("information", self.information, n * (n + 1) // 2),
            ("gradient", self.gradient, n),
        ):
            if len(values) != size:
                raise wrong(f"must have {size} numbers, not {len(values)}", name)
        if not _is_information(self.information, n):
            raise wrong("is no information: a variance in it is negative", "information")
        return self


def _is_information(upper: Array, n: int) -> bool:
    """Whether a packed triangle has no negative eigenvalue, in units of its own diagonal."""
    full = np.zeros((n, n))
    full[np.triu_indices(n)] = upper
    full = full + np.triu(full, 1).T
    diagonal = np.diag(full)
    if (diagonal < 0.0).any():
        return False
    scale = np.where(diagonal > 0.0, 1.0 / np.sqrt(np.maximum(diagonal, 1e-300)), 0.0)
    return bool(np.linalg.eigvalsh(full * scale * scale[:, None]).min() > -1e-6)


class Factor(Document):
    """What one frame says about all parameters."""

    state: Packed
    has_cylinder: bool
    has_cone: bool
    reference: Annotated[Number, Field(gt=0.0)]
    model: Model
    hopper: bool
    shares: list[Share]
    bias: Annotated[tuple[float, float, float], _tuple(3, slice(0))]
    bias_std: Annotated[tuple[float, float, float], _tuple(3, slice(3))]
    radius: Annotated[tuple[float, float] | None, _tuple(2, slice(1, 2), optional=True)] = None
    gravity: Annotated[tuple[float, float, float] | None, _tuple(3, slice(2, 3), optional=True)] = None
    camera_std: Annotated[tuple[float, float, float, float, float], _tuple(5, slice(5))]
    scale_std: NotNegative
    rays: Packed

    @model_validator(mode="after")
    def _whole(self) -> Factor:
        if len(self.state) != STATE:
            raise wrong(f"must have {STATE} numbers, not {len(self.state)}", "state")
        if len(self.rays) % 3 or len(self.rays) > 3 * MOST_RAYS:
            raise wrong(f"must be at most {MOST_RAYS} times 3 numbers", "rays")
        if (self.rays[2::3] < 0.0).any():
            raise wrong("has information below zero", "rays")
        return self


class Numbered(Factor):
    """The factor of a frame of a sequence."""

    index: Index


class Summed(Document):
    """Factors of earlier frames added up."""

    factor: Factor
    heights: Annotated[tuple[float, float], _tuple(2, slice(2))]
    counted: list[NotNegative]
    frames: Index

    @model_validator(mode="after")
    def _whole(self) -> Summed:
        if len(self.counted) != len(self.factor.shares):
            raise wrong("must have a number for every share", "counted")
        return self
