"""Sensor profiles: TOML files that people write, and what a result's ``config`` says about its sensor."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, ValidationError, model_validator

from siloscope.parameters import BIAS, NOISE, noise_std
from siloscope.schema import files
from siloscope.schema.fields import NotNegative, Number, finite, named
from siloscope.schema.sensor_map import SensorMapDocument
from siloscope.schema.validation import Document, StrictDocument, validated, wrong

LARGEST_FILE = 100_000
"""Bytes; a profile is a page of text."""

REMEDY = "docs/your-frame.md has an example"

STEEPEST = 10.0
"""Largest power of a noise law; sensors have 1 to 3."""


def _table(name: str) -> BeforeValidator:
    def check(value: Any) -> Any:
        if not isinstance(value, dict):
            raise wrong(f"must be a table, written as [{name}]")
        return value

    return BeforeValidator(check)


def _tables(value: Any) -> Any:
    if not isinstance(value, list) or not all(isinstance(entry, dict) for entry in value):
        raise wrong("must be a list of tables, written as [[intrinsics]]")
    return value


def _range(value: Any) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise wrong(f"must be [nearest, farthest] in metres, got {value!r}")
    near, far = (finite(depth) for depth in value)
    if not 0.0 <= near < far:
        raise wrong(f"must be [nearest, farthest] in metres, got [{near}, {far}]")
    return near, far


class BiasTable(StrictDocument):
    """``[bias]``: the depth bias and what is not known about it."""

    offset: Number = 0.0
    scale: Number = 0.0
    quadratic: Number = 0.0
    offset_std: NotNegative = 0.0
    scale_std: NotNegative = 0.0
    quadratic_std: NotNegative = 0.0


class IntrinsicsStdTable(StrictDocument):
    """``[intrinsics_std]``: how far specimens scatter about the nominal intrinsics, one standard deviation."""

    f: NotNegative
    """Of the focal lengths, as a fraction of them."""
    c: NotNegative
    """Of the principal point, as a fraction of the image's width."""
    k1: NotNegative
    """Of the first radial distortion coefficient."""


class NoiseTable(StrictDocument):
    """``[noise]``: the law of the noise."""

    floor: Number = 0.0
    constant: Number = 0.0
    linear: Number = 0.0
    quadratic: Number = 0.0
    power_factor: Number = 0.0
    power: Number = 2.0

    @property
    def law(self) -> tuple[float, float, float, float, float, float]:
        """In the order of `NOISE`."""
        return self.floor, self.constant, self.linear, self.quadratic, self.power_factor, self.power


class SensorProfileFile(StrictDocument):
    """A sensor profile as TOML."""

    name: str | None = None
    source: str = ""
    range: Annotated[tuple[float, float], BeforeValidator(_range)] = (0.0, 1e6)
    depth_unit: Annotated[float, BeforeValidator(finite), Field(ge=1e-9)] | None = None
    bias: Annotated[BiasTable, _table("bias")] = BiasTable()
    noise: Annotated[NoiseTable, _table("noise")] | None = None
    intrinsics_std: Annotated[IntrinsicsStdTable, _table("intrinsics_std")] | None = None
    intrinsics: Annotated[list[dict[str, Any]], BeforeValidator(_tables)] = Field(default_factory=list)

    @model_validator(mode="after")
    def _possible(self) -> SensorProfileFile:
        """Noise must be positive and measured depth must grow with true depth over the sensor's range."""
        if self.noise is not None and abs(self.noise.power) > STEEPEST:
            raise wrong(f"must be between -{STEEPEST:g} and {STEEPEST:g}", "noise.power")
        near, far = self.range
        for depth in (max(near, 0.05), min(far, 50.0)):
            sigma = None if self.noise is None else noise_std(self.noise.law, depth)
            if sigma is not None and not sigma > 0.0:
                raise wrong(f"the noise at {depth:g} m is {sigma:g} m; it must be positive over the range")
            if not 1.0 + self.bias.scale + 2.0 * self.bias.quadratic * depth > 0.1:
                raise wrong(f"with this bias, measured depth does not grow with true depth at {depth:g} m")
        return self


def read(path: Path) -> bytes:
    """The content of a profile's file; raises `InputError`."""
    return files.content(path, LARGEST_FILE, "a sensor profile", REMEDY)


def parse(content: bytes, source: str) -> SensorProfileFile:
    """The content of a profile, checked; raises `InputError` naming the entry. An empty ``[noise]`` is none."""
    table = files.from_toml(content, source, "sensor profile", REMEDY)
    told = {key: value for key, value in table.items() if (key, value) != ("noise", {})}
    return validated(SensorProfileFile, told, source, REMEDY)


class SensorRecord(Document):
    """A sensor in a result's ``config``, as `SensorProfile.to_dict` writes it."""

    name: str
    bias: Annotated[tuple[float, float, float], named(BIAS)]
    bias_std: Annotated[tuple[float, float, float], named(BIAS)]
    noise: Annotated[tuple[float, float, float, float, float, float], named(NOISE)] | None
    map: SensorMapDocument | None = None


def record(table: Any) -> SensorRecord | None:
    """The sensor of a result's ``config``; None where it has none, or one that is not whole."""
    try:
        return SensorRecord.model_validate(table)
    except ValidationError:
        return None
