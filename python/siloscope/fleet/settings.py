"""What a run measures with, as plain data that travels with the plan: files are in it by their text."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from siloscope.errors import InputError
from siloscope.schema import fleet as schema

LOCATED_FRAMES = 64
"""Frames of a shard, evenly spread, that are located for a calibration. The camera stands still, so more of them tell
the pose hardly better: most of what is uncertain of it is common to all its frames."""

_FILES = ("sensor", "vessel", "strapping", "product")
"""Settings that may name a file."""

Table = dict[str, Any]


@dataclass(frozen=True)
class Settings:
    """Settings of all silos, and those of single ones that win over them."""

    measure: Table = field(default_factory=dict)
    silos: dict[str, Table] = field(default_factory=dict)
    located_frames: int = LOCATED_FRAMES

    def of(self, silo: str) -> Table:
        """What a silo is measured with; files as ``{"name": …, "text": …}``."""
        return {**self.measure, **self.silos.get(silo, {})}

    def over(self, packed: dict[str, Table]) -> Settings:
        """The same, over what was packed with the frames of some silos."""
        silos = {silo: {**table, **self.measure, **self.silos.get(silo, {})} for silo, table in packed.items()}
        return replace(self, silos={**self.silos, **silos})

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {"measure": self.measure, "silos": self.silos, "located_frames": self.located_frames}

    @classmethod
    def from_dict(cls, told: dict[str, Any]) -> Settings:
        """What `to_dict` gave."""
        return cls(told["measure"], told["silos"], told["located_frames"])


def settings(path: Path | None, **given: Any) -> Settings:
    """The settings of a file (None: there is none), with single ones over those of all silos."""
    read = schema.FleetFile() if path is None else schema.read(path)
    base = Path() if path is None else path.parent
    common = {**_table(read.measure, base), **{k: v for k, v in with_texts(given, Path()).items() if v is not None}}
    silos = {silo: _table(table, base) for silo, table in sorted(read.silo.items())}
    return Settings(common, silos, read.locate.frames or LOCATED_FRAMES)


def _table(told: schema.Measuring, base: Path) -> Table:
    known = {name: value for name, value in told.model_dump().items() if value is not None}
    if "moisture" in known:
        known["moisture"] /= 100.0
    return with_texts(known, base)


def with_texts(table: Table, base: Path) -> Table:
    """Settings with the text of every file that they name."""
    return {name: _text_of(value, base) if name in _FILES else value for name, value in table.items()}


def _text_of(value: str | None, base: Path) -> Any:
    """A file's name and text where the value names one, else the value: the name of a profile or product."""
    path = None if value is None else base / value
    if path is None or not path.is_file():
        return value
    try:
        return {"name": path.name, "text": path.read_text("utf-8")}
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: can't be read as text ({error}); check the file") from None


@contextmanager
def with_files(table: Table) -> Iterator[Table]:
    """The settings with every text as a file for as long as the context lasts."""
    with tempfile.TemporaryDirectory(prefix="siloscope-") as folder:
        made = dict(table)
        for name, value in table.items():
            if isinstance(value, dict):
                path = Path(folder) / hashlib.sha256(value["text"].encode()).hexdigest()[:8] / value["name"]
                path.parent.mkdir(exist_ok=True)
                path.write_text(value["text"], "utf-8")
                made[name] = str(path)
        yield made
