"""Calibration files: JSON of the schema ``siloscope.calibration/1``, read strictly."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, PlainValidator, model_validator

from siloscope.errors import InputError
from siloscope.parameters import PARAMETERS, POSE, SIZE
from siloscope.reasons import CALIBRATION_REMARKS, FRAME_STATUSES, INPUT_REMARKS
from siloscope.schema import CALIBRATION, files
from siloscope.schema.fields import (
    Array,
    Index,
    NotNegative,
    Number,
    at_least,
    finite,
    symmetric,
    vector,
)
from siloscope.schema.floor import FloorDocument
from siloscope.schema.frame_factor import Numbered, Summed
from siloscope.schema.sensor_profile import SensorRecord
from siloscope.schema.validation import Document, validated, wrong

LARGEST_FILE = 50_000_000
"""Bytes; 100 frames of factors take about 2 MB."""

REMEDY = "take the file as `siloscope calibrate` wrote it, or calibrate again"

INTRINSICS = ("exact", "calibrated", "nominal")
"""Names of how exactly intrinsics are known."""

NAMES = f"must be {', '.join(PARAMETERS)}, as this version of siloscope has them"

Nullable = Annotated[Array, vector(SIZE, nullable=True)]


def _code(value: Any) -> str:
    """A remark's code, by itself as in files of version 0.1, or with its message and severity."""
    value = value.get("code") if isinstance(value, dict) else value
    if value not in CALIBRATION_REMARKS and value not in INPUT_REMARKS:
        raise wrong(f"is the unknown code {value!r}")
    return str(value)


def _status(value: str) -> str:
    if value not in FRAME_STATUSES:
        raise wrong(f"is {value!r}; known are {', '.join(FRAME_STATUSES)}")
    return value


def _diameter(value: float) -> float:
    if not 0.01 <= value <= 200.0:
        raise wrong("must be between 0.01 and 200 m")
    return value


def _intrinsics(value: Any) -> str | tuple[float, float, float] | None:
    if value is None or (isinstance(value, str) and value in INTRINSICS):
        return value
    if isinstance(value, dict) and set(value) == {"f", "c", "k1"}:
        return finite(value["f"]), finite(value["c"]), finite(value["k1"])
    raise wrong(f"must be one of {', '.join(INTRINSICS)}, or f, c and k1")


def _reach(value: Any) -> tuple[float, float] | None:
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != 2:
        raise wrong("must be 2 numbers")
    return finite(value[0]), finite(value[1])


class Pose(Document):
    """Of a record or the whole; all four or none."""

    r_x: Number | None = None
    r_y: Number | None = None
    t_x: Number | None = None
    t_y: Number | None = None

    @property
    def pose(self) -> tuple[float, ...] | None:
        """The four, or None."""
        known = tuple(value for value in (self.r_x, self.r_y, self.t_x, self.t_y) if value is not None)
        return known if len(known) == len(POSE) else None

    def require_pose(self) -> None:
        """Raises where one of the four is missing."""
        lacking = next((name for name in POSE if getattr(self, name) is None), None)
        if lacking is not None:
            raise wrong("must be a finite number, not 'None'", lacking)


class Lengths(Document):
    """The silo's; null where not seen."""

    radius: Number | None = None
    cylinder_bottom: Number | None = None
    apex: Number | None = None


class Deviations(Document):
    """Standard deviations of the silo's lengths."""

    radius: NotNegative | None = None
    cylinder_bottom: NotNegative | None = None
    apex: NotNegative | None = None


class Silo(Lengths):
    """``silo``."""

    std: Deviations

    @model_validator(mode="after")
    def _possible(self) -> Silo:
        if self.radius is not None and self.radius <= 0.0:
            raise wrong(f"must be above 0, not {self.radius:g}", "radius")
        if self.cylinder_bottom is not None and self.apex is not None and self.apex < self.cylinder_bottom:
            raise wrong(f"must lie below the cylinder's bottom, not at {self.apex:g}", "apex")
        return self


class Parameters(Document):
    """``parameters``."""

    names: Any = None
    values: Nullable
    covariance: Annotated[Array, symmetric(SIZE)]

    @model_validator(mode="before")
    @classmethod
    def _named(cls, content: Any) -> Any:
        return _with_names(content)


class Move(Document):
    """A move of the camera."""

    index: Index
    turn: NotNegative
    shift: NotNegative
    significance: NotNegative


class Record(Pose):
    """What became of one frame."""

    index: Index
    name: str
    status: Annotated[str, AfterValidator(_status)]
    weight: NotNegative
    deviation: Number | None = None
    timestamp: Number | None = None
    reason: str | None = None
    cone_reach: Annotated[tuple[float, float] | None, PlainValidator(_reach)] = None
    digest: str | None = None

    @model_validator(mode="after")
    def _whole(self) -> Record:
        if self.r_x is not None:
            self.require_pose()
        return self


GROUPS = ("pose", "bias", "camera", "radius", "cylinder_form", "cone", "cone_form")
"""Groups of the parameters of the evidence, in their order."""


class Evidence(Document):
    """``evidence``: what the calibration rests on."""

    names: Any = None
    frames: list[Numbered]
    earlier: Summed | None = None

    @model_validator(mode="before")
    @classmethod
    def _known(cls, content: Any) -> Any:
        """Without what a version before wrote, from which a calibration can't be continued."""
        if not isinstance(content, dict) or not (content.get("frames") or content.get("earlier")):
            return content
        if content.get("names") == list(PARAMETERS):
            return {"names": content["names"], "frames": []}
        if content.get("names") != list(GROUPS):
            raise wrong(f"must be {', '.join(GROUPS)}, as this version of siloscope has them", "names")
        return content


class Model(Document):
    """A vessel model and its probability."""

    model: str
    probability: NotNegative


class Config(Document):
    """The settings that a calibration is continued with; the rest of ``config`` is kept as it is."""

    diameter: Annotated[float, BeforeValidator(finite), AfterValidator(_diameter)] | None = None
    intrinsics: Annotated[Any, PlainValidator(_intrinsics)] = None
    gravity: Annotated[Array, vector(3)] | None = None
    sensor: SensorRecord | None = None


class CalibrationDocument(Pose):
    """The whole file."""

    status: Literal["ok", "refused"]
    rule: str
    method: str
    covariance: Annotated[Array, symmetric(4)] | None = None
    covariance_relative: Annotated[Array, symmetric(4)] | None = None
    models: list[Model] = Field(default_factory=list)
    silo: Silo
    parameters: Parameters | None = None
    excess: Annotated[float, BeforeValidator(finite), AfterValidator(at_least(1.0))]
    scale_std: NotNegative
    moves: list[Move]
    frames: list[Record]
    quality: list[Annotated[str, PlainValidator(_code)]]
    reason: str | None = None
    message: str | None = None
    checked: Config = Field(alias="config")
    timing_ms: dict[str, Number]
    evidence: Evidence
    floor: FloorDocument | None = None

    @model_validator(mode="after")
    def _answered(self) -> CalibrationDocument:
        """An answer has a pose and its covariance; one frame averaged by the paper's rule has no covariance."""
        if self.status == "ok":
            self.require_pose()
            if self.covariance is None and self.rule != "mean-of-last-10":
                raise wrong("must be 4 rows of 4 numbers", "covariance")
        return self


def _with_names(content: Any) -> Any:
    if isinstance(content, dict) and content.get("names") != list(PARAMETERS):
        raise wrong(NAMES, "names")
    return content


def read(path: Path) -> tuple[CalibrationDocument, dict[str, Any]]:
    """The document of a calibration file, checked, and its ``config`` as it stands.

    Raises
    ------
    InputError
        Where the file can't be read, is no calibration, or an entry is missing or can't be right.
    """
    content = files.from_json(files.content(path, LARGEST_FILE, "a calibration", REMEDY), str(path), REMEDY)
    schema = content.get("schema") if isinstance(content, dict) else None
    if schema != CALIBRATION:
        found = f"its schema is {schema!r}" if schema else "it names no schema"
        raise InputError(f"{path}: no calibration of the schema {CALIBRATION} ({found}); {REMEDY}")
    return validated(CalibrationDocument, content, str(path), REMEDY), content["config"]
