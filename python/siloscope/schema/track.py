"""Track files: JSON of the schema ``siloscope.track/1``, of which the readings are read back."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from siloscope.errors import InputError
from siloscope.schema import TRACK, files
from siloscope.schema.fields import Index, Number
from siloscope.schema.validation import Document, validated

LARGEST_FILE = 500_000_000
"""Bytes; a reading takes some 800."""

REMEDY = "take the file as `siloscope track --out` or `--json` wrote it"


class ReadingDocument(Document):
    """A reading."""

    index: Index
    name: str
    time: Number | None = None
    status: Literal["ok", "refused", "unreadable"]
    reason: str | None = None
    volume: Number | None = Field(None, alias="volume_m3")
    volume_std: Number | None = Field(None, alias="volume_std_m3")
    fill_fraction: Number | None = None
    level: Number | None = Field(None, alias="level_m")
    mass: Number | None = Field(None, alias="mass_kg")
    mass_std: Number | None = Field(None, alias="mass_std_kg")
    coverage: Number | None = None
    quality: list[str] = Field(default_factory=list)
    ullage: Number | None = Field(None, alias="ullage_m3")
    ullage_std: Number | None = Field(None, alias="ullage_std_m3")
    own_std: Number | None = Field(None, alias="own_std_m3")
    density: Number | None = Field(None, alias="density_kg_m3")
    datum: Number | None = Field(None, alias="datum_m")
    digest: str | None = None


class TrackDocument(Document):
    """The part of a track that it is continued from."""

    readings: list[ReadingDocument]


def read(path: Path) -> list[dict[str, Any]]:
    """The readings of a track file; raises `InputError` that names the entry."""
    content = files.from_json(files.content(path, LARGEST_FILE, "a track", REMEDY), str(path), REMEDY)
    if not isinstance(content, dict) or content.get("schema") != TRACK:
        raise InputError(f"{path}: no track of the schema {TRACK}; {REMEDY}")
    found = validated(TrackDocument, content, str(path), REMEDY)
    return [{**reading.model_dump(), "quality": tuple(reading.quality)} for reading in found.readings]
