"""Names of silos, cameras and shards, and where their objects lie in a store and in a run."""

from __future__ import annotations

import re
from dataclasses import dataclass

from siloscope.errors import UsageError

_ID = re.compile(r"[A-Za-z0-9_-]{1,80}")

MANIFEST = "manifest.parquet"


@dataclass(frozen=True, order=True)
class Series:
    """The frames of one camera in one silo."""

    silo: str
    camera: str

    @property
    def name(self) -> str:
        """``silo7.cam7``; no id has a dot."""
        return f"{self.silo}.{self.camera}"

    @property
    def folder(self) -> str:
        """Where its Zarr group lies in the store."""
        return f"silo={self.silo}/camera={self.camera}"

    def shard_object(self, number: int) -> str:
        """The object of a shard's frames."""
        return f"{self.folder}/depth/c.{number}.0.0"

    def shard(self, number: int) -> str:
        """The name of a shard, which no other shard of the store has."""
        return f"{self.name}.{number:06d}"


def checked(text: str, option: str) -> str:
    """An id that may be part of a name; raises `UsageError`."""
    if not _ID.fullmatch(text):
        raise UsageError(f"{option} '{text}': an id has letters, digits, '-' and '_', 80 at most")
    return text


def as_id(text: str) -> str:
    """A file's name as an id."""
    return re.sub(r"[^A-Za-z0-9_-]+", "-", text).strip("-")[:80] or "silo"


@dataclass(frozen=True)
class RunPaths:
    """Where the objects of a run lie below its place."""

    run: str

    def plan(self) -> str:
        """What decides the answers."""
        return f"plans/{self.run}/plan.json"

    def shards(self) -> str:
        """The table of the plan's shards."""
        return f"plans/{self.run}/shards.parquet"

    def given_calibration(self, series: Series) -> str:
        """A calibration that the plan was given."""
        return f"plans/{self.run}/calibrations/{series.name}.json"

    def calibration(self, series: Series) -> str:
        """The calibration that its frames were measured with."""
        return f"calibrations/run={self.run}/{series.name}.json"

    def evidence(self, series: Series, number: int) -> str:
        """What a shard's frames say about pose and silo."""
        return f"evidence/run={self.run}/silo={series.silo}/{series.shard(number)}.json"

    def result(self, series: Series, number: int) -> str:
        """The readings of a shard."""
        return f"results/run={self.run}/silo={series.silo}/{series.shard(number)}.parquet"

    def events(self, series: Series, number: int) -> str:
        """Refills and withdrawals within a shard."""
        return f"events/run={self.run}/silo={series.silo}/{series.shard(number)}.parquet"

    def commits(self) -> str:
        """Where all commits are."""
        return f"commits/{self.run}/"

    def progress(self) -> str:
        """Where every process tells what it has done."""
        return f"progress/{self.run}/"
