"""``floor`` of a calibration: what is known of the bottom."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, model_validator

from siloscope.reasons import BOTTOM_EVIDENCE, BOTTOM_KINDS
from siloscope.schema.fields import NotNegative
from siloscope.schema.validation import Document, wrong


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


class FloorDocument(Document):
    """What is known of the bottom; a known one says how."""

    kind: Annotated[str, AfterValidator(_kind)]
    evidence: Annotated[str, AfterValidator(_evidence)] | None = None
    seen_cone: SeenConeDocument | None = None

    @model_validator(mode="after")
    def _known_how(self) -> FloorDocument:
        if self.kind != "unknown" and self.evidence is None:
            raise wrong("must say how the bottom is known", "evidence")
        return self
