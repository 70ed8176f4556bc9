"""The shards of a store, as a plan has them: one row each, found in the manifest's column of objects alone."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError
from siloscope.fleet.extras import arrow
from siloscope.fleet.manifest import open_manifest
from siloscope.fleet.naming import Series
from siloscope.fleet.store import Store
from siloscope.fleet.tables import file_bytes, read

_OBJECT = re.compile(r"silo=([^/]+)/camera=([^/]+)/depth/c\.(\d+)\.0\.0")

COLUMNS = ("object", "length", "calibration")


@dataclass(frozen=True, eq=False)
class ShardTable:
    """Shards in the order of their series and numbers, as columns: a million of them take some 20 MB."""

    series: tuple[Series, ...]
    of_series: NDArray[np.int32]
    """(n,) index into `series`."""
    numbers: NDArray[np.int32]
    """(n,) number of the shard in its series."""
    frames: NDArray[np.int32]
    """(n,) frames in it."""
    sizes: NDArray[np.int64]
    """(n,) bytes of these frames as they are stored."""
    packed: dict[Series, str] = field(default_factory=dict)
    """The calibration's object that was packed with the frames; known only where the table was scanned."""

    def __len__(self) -> int:
        return len(self.numbers)

    def name(self, row: int) -> str:
        """The shard's name."""
        return str(self.series[self.of_series[row]].shard(int(self.numbers[row])))

    @cached_property
    def rows_by_series(self) -> list[NDArray[np.int64]]:
        """Rows of every series; they follow each other."""
        starts = np.searchsorted(self.of_series, np.arange(len(self.series) + 1))
        return [np.arange(a, b) for a, b in pairwise(starts)]

    def to_bytes(self) -> bytes:
        """As a Parquet table."""
        pa = arrow()
        names = pa.array([series.silo for series in self.series]), pa.array([s.camera for s in self.series])
        index = pa.array(self.of_series)
        columns = {
            "silo": pa.DictionaryArray.from_arrays(index, names[0]),
            "camera": pa.DictionaryArray.from_arrays(index, names[1]),
            "shard": self.numbers,
            "frames": self.frames,
            "bytes": self.sizes,
        }
        return file_bytes(pa.table(columns))

    @classmethod
    def from_bytes(cls, data: bytes) -> ShardTable:
        """What `to_bytes` gave."""
        table = read(data)
        silo, camera = (_encoded(table.column(name)) for name in ("silo", "camera"))
        keys = silo[0].astype(np.int64) * (len(camera[1]) + 1) + camera[0]
        first = np.flatnonzero(np.diff(keys, prepend=-1))
        series = tuple(Series(silo[1][silo[0][k]], camera[1][camera[0][k]]) for k in first)
        of_series = np.repeat(np.arange(len(first), dtype=np.int32), np.diff(np.append(first, len(keys))))
        numbers, frames, size = (table.column(name).to_numpy() for name in ("shard", "frames", "bytes"))
        return cls(series, of_series, numbers, frames, size)


def scan(store: Store) -> ShardTable:
    """The shards of a store's manifest, a row group at a time; raises `InputError` where there is none."""
    manifest = open_manifest(store)
    if manifest is None:
        raise InputError(f"{store.place}: no store of sealed frames; make one with `siloscope pack FRAMES -o STORE`")
    names: list[str] = []
    frames: list[NDArray[np.int64]] = []
    sizes: list[NDArray[np.int64]] = []
    calibrations: dict[str, str] = {}
    for group in range(manifest.num_row_groups):
        rows = manifest.read_row_group(group, columns=list(COLUMNS), use_threads=False)
        found = _runs(rows)
        names += found[0]
        frames.append(found[1])
        sizes.append(found[2])
        calibrations |= found[3]
    return _table(names, np.concatenate([*frames, []]), np.concatenate([*sizes, []]), calibrations)


def _runs(rows: Any) -> tuple[list[str], NDArray[np.int64], NDArray[np.int64], dict[str, str]]:
    """Objects of neighbouring rows, with their frames, bytes and calibration."""
    codes, words = _encoded(rows.column("object"))
    if not len(codes):
        return [], np.zeros(0, np.int64), np.zeros(0, np.int64), {}
    starts = np.flatnonzero(np.diff(codes, prepend=-1))
    counts = np.diff(np.append(starts, len(codes)))
    sizes = np.add.reduceat(rows.column("length").to_numpy(), starts)
    told, known = _encoded(rows.column("calibration"))
    names = [words[code] for code in codes[starts]]
    pairs = zip(names, told[starts], strict=True) if known else ()
    return names, counts, sizes, {name: known[code] for name, code in pairs if code >= 0}


def _encoded(column: Any) -> tuple[NDArray[Any], list[str]]:
    """A column of words as codes (-1 for null) and the words."""
    array = column.combine_chunks()
    array = array if array.type == arrow().dictionary(arrow().int32(), arrow().string()) else array.dictionary_encode()
    return array.indices.fill_null(-1).to_numpy(zero_copy_only=False), array.dictionary.to_pylist()


def _table(names: list[str], frames: Any, sizes: Any, calibrations: dict[str, str]) -> ShardTable:
    """The table of objects, the parts of one that lies across two row groups put together."""
    keys = [_parsed(name) for name in names]
    known = sorted({key[0] for key in keys})
    code = {series: number for number, series in enumerate(known)}
    of_series = np.array([code[series] for series, _ in keys], np.int64)
    numbers = np.array([number for _, number in keys], np.int64)
    order = np.lexsort((numbers, of_series))
    of_series, numbers = of_series[order], numbers[order]
    frames, sizes = np.asarray(frames, np.int64)[order], np.asarray(sizes, np.int64)[order]
    starts = np.flatnonzero((np.diff(of_series, prepend=-1) != 0) | (np.diff(numbers, prepend=-1) != 0))
    if len(starts):
        frames, sizes = np.add.reduceat(frames, starts), np.add.reduceat(sizes, starts)
    packed = {_parsed(name)[0]: told for name, told in calibrations.items()}
    rows = [values.astype(np.int32) for values in (of_series[starts], numbers[starts], frames)]
    return ShardTable(tuple(known), rows[0], rows[1], rows[2], sizes, packed)


def _parsed(name: str) -> tuple[Series, int]:
    found = _OBJECT.fullmatch(name)
    if found is None:
        raise InputError(f"manifest: '{name}' is no object that `siloscope pack` makes; pack the frames anew")
    return Series(found[1], found[2]), int(found[3])
