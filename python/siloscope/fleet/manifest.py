"""``manifest.parquet`` of a store: a row a frame, for people who query and for the plan.

It repeats what the sealed arrays say, so that one file tells everything: it is made from them, and what an interrupted
packing has left out is put in by the next one.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from siloscope.errors import InputError
from siloscope.fleet.extras import arrow, parquet
from siloscope.fleet.naming import MANIFEST, Series
from siloscope.fleet.sealing import sealed_rows
from siloscope.fleet.store import RangeFile, Store
from siloscope.fleet.tables import ROW_GROUP, WRITER, schema_of
from siloscope.io.shard_layout import EMPTY, index_length, places
from siloscope.types.track import ABSOLUTE

SCHEMA = "siloscope.manifest/1"

COLUMNS = (
    ("silo", "string"),
    ("camera", "string"),
    ("captured", "time"),
    ("seconds", "float64"),
    ("sha256", "string"),
    ("object", "string"),
    ("offset", "int64"),
    ("length", "int64"),
    ("calibration", "string"),
)
"""``captured`` is null where times only count from a recording's start; ``seconds`` has them as they are. ``sha256`` is
of the ``length`` bytes at ``offset`` of ``object``: the frame's Blosc chunk and its CRC-32C."""

ATTEMPTS = 20
"""Times that the manifest is written anew because another packing was quicker."""


def open_manifest(store: Store) -> Any | None:
    """The manifest as a Parquet file of which only wanted columns are fetched; None where there is none yet."""
    size = store.size(MANIFEST)
    if size is None:
        return None
    return parquet().ParquetFile(arrow().PythonFile(RangeFile(store, MANIFEST, size), mode="r"), pre_buffer=False)


def add(store: Store, made: Iterable[tuple[Series, int, int, str | None]]) -> int:
    """Adds the rows that lack of (series, number of shards, slots, calibration) each; how many rows."""
    groups = list(made)
    for _ in range(ATTEMPTS):
        version = store.version(MANIFEST)
        present = None if version is None else open_manifest(store)
        known = set() if present is None else _objects(present)
        new = [
            rows_of_shard(store, series, number, slots, calibration)
            for series, shards, slots, calibration in groups
            for number in range(shards)
            if series.shard_object(number) not in known
        ]
        if present is not None and not new:
            return 0
        if store.exchange(MANIFEST, version, _extended(present, new)):
            return sum(table.num_rows for table in new)
    raise InputError(f"{store.place}/{MANIFEST}: other packings keep writing it; run this one again, nothing is lost")


def _extended(present: Any, new: list[Any]) -> bytes:
    """The manifest's bytes with new rows behind the old; whole row groups pass through one at a time."""
    pa, sink = arrow(), arrow().BufferOutputStream()
    last: list[Any] = []
    with parquet().ParquetWriter(sink, _schema(), **WRITER) as writer:
        for group in range(0 if present is None else present.num_row_groups):
            rows = present.read_row_group(group, use_threads=False).cast(_schema())
            if rows.num_rows == ROW_GROUP:
                writer.write_table(rows)
            else:
                last.append(rows)
        writer.write_table(pa.concat_tables([*last, *new, _schema().empty_table()]), row_group_size=ROW_GROUP)
    return bytes(sink.getvalue())


def rows_of_shard(store: Store, series: Series, number: int, slots: int, calibration: str | None) -> Any:
    """The rows of a sealed shard."""
    pa = arrow()
    name = series.shard_object(number)
    index = places(store.get_tail(name, index_length(slots)), slots, name)
    index = index[index[:, 0] != EMPTY]
    times, hashes = sealed_rows(store, series, number, slots)
    if len(index) != len(hashes):
        raise InputError(f"{store.place}/{name}: {len(index)} frames, but {len(hashes)} hashes beside; seal it again")
    count = len(index)
    dated = np.isfinite(times) & (times > ABSOLUTE) & (times < 2.5e11)
    micros = np.where(dated, np.round(np.where(dated, times, 0.0) * 1e6), 0).astype("<i8")
    columns = {
        "silo": [series.silo] * count,
        "camera": [series.camera] * count,
        "captured": pa.array(micros, pa.timestamp("us", tz="UTC"), mask=~dated),
        "seconds": pa.array(times, pa.float64(), mask=~np.isfinite(times)),
        "sha256": [digest.tobytes().hex() for digest in hashes],
        "object": [name] * count,
        "offset": index[:, 0].astype(np.int64),
        "length": index[:, 1].astype(np.int64),
        "calibration": [calibration] * count,
    }
    return pa.table(columns, schema=_schema())


def _objects(manifest: Any) -> set[str]:
    """The objects that have rows."""
    found: set[str] = set()
    for group in range(manifest.num_row_groups):
        column = manifest.read_row_group(group, columns=["object"], use_threads=False).column(0)
        found |= set(column.unique().to_pylist())
    return found


def _schema() -> Any:
    return schema_of(COLUMNS, {"siloscope.schema": SCHEMA})
