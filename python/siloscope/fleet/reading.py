"""The frames of a sealed shard: one range read for the index, then ranges of many frames each."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError
from siloscope.fleet.naming import Series
from siloscope.fleet.sealing import sealed_rows
from siloscope.fleet.store import Store
from siloscope.io.archive_layout import decompressed, without_checksum
from siloscope.io.shard_layout import EMPTY, index_length, places, slots_of
from siloscope.types.camera import Camera
from siloscope.types.frame import Frame

BLOCK = 8 << 20
"""Bytes that are read at once: enough that a request's latency doesn't count, little beside a worker's memory."""


@dataclass(frozen=True, eq=False)
class StoredFrame:
    """A frame of a shard, or why it can't be read."""

    sha256: str
    time: float | None
    source: str
    frame: Frame | None
    problem: str | None = None


class SealedShard:
    """One shard of a series; `bytes_read` counts what was fetched of its frames."""

    def __init__(self, store: Store, series: Series, number: int) -> None:
        self.store, self.series, self.number = store, series, number
        self.bytes_read = 0

    @cached_property
    def head(self) -> dict[str, Any]:
        """What all frames of the series have in common."""
        return dict(json.loads(self.store.get(f"{self.series.folder}/zarr.json"))["attributes"])

    @cached_property
    def slots(self) -> int:
        """Frames that fit."""
        slots = slots_of(json.loads(self.store.get(f"{self.series.folder}/depth/zarr.json")))
        if slots is None:
            raise InputError(f"{self.series.name}: not as siloscope seals it; pack the frames anew")
        return slots

    @cached_property
    def index(self) -> NDArray[np.uint64]:
        """Offset and length (n, 2) of its frames."""
        name = self.series.shard_object(self.number)
        tail = self.store.get_tail(name, index_length(self.slots))
        whole = places(tail, self.slots, f"{self.store.place}/{name}")
        return np.asarray(whole[whole[:, 0] != EMPTY])

    @cached_property
    def rows(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Times (n,) and hashes (n, 32)."""
        times, hashes = sealed_rows(self.store, self.series, self.number, self.slots)
        if len(times) != len(self.index):
            raise InputError(f"{self.series.shard(self.number)}: its index and its hashes differ; pack it anew")
        return times, hashes

    @cached_property
    def gravities(self) -> NDArray[Any]:
        """Gravity (n, 3) in the camera frame, NaN where it is not known."""
        data = self.store.get(f"{self.series.folder}/gravity/c.{self.number}.0")[:-4]
        return np.frombuffer(data, "<f8").reshape(-1, 3)

    def __len__(self) -> int:
        return len(self.index)

    def frames(self, chosen: NDArray[np.int64] | None = None) -> Iterator[StoredFrame]:
        """Its frames in their order, or those of some numbers (ascending)."""
        wanted = np.arange(len(self)) if chosen is None else chosen
        for some in self._blocks(wanted):
            start, end = int(self.index[some[0], 0]), int(self.index[some[-1]].sum())
            data = self.store.get_range(self.series.shard_object(self.number), start, end - start)
            self.bytes_read += len(data)
            for slot in some:
                offset, length = (int(value) for value in self.index[slot])
                yield self._frame(int(slot), data[offset - start : offset - start + length])

    def _blocks(self, wanted: NDArray[np.int64]) -> Iterator[list[int]]:
        """Frames that are fetched by one range each."""
        block: list[int] = []
        for slot in wanted.tolist():
            length = int(self.index[slot].sum()) - int(self.index[block[0], 0]) if block else 0
            if block and (slot != block[-1] + 1 or length > BLOCK):
                yield block
                block = []
            block.append(slot)
        if block:
            yield block

    def _frame(self, slot: int, chunk: bytes) -> StoredFrame:
        times, hashes = self.rows
        time = float(times[slot]) if math.isfinite(times[slot]) else None
        source = f"{self.series.shard(self.number)}, frame {slot}"
        digest = hashes[slot].tobytes().hex()
        try:
            return StoredFrame(digest, time, source, self._decoded(slot, chunk, time, source))
        except InputError as error:
            return StoredFrame(digest, time, source, None, f"{source}: {error}")

    def _decoded(self, slot: int, chunk: bytes, time: float | None, source: str) -> Frame:
        head, gravity = self.head, self.gravities[slot]
        return Frame(
            depth=decompressed(without_checksum(chunk), (head["height"], head["width"]), head["dtype"]),
            camera=self._camera,
            depth_unit=head["depth_unit"],
            timestamp=time,
            gravity=gravity if np.isfinite(gravity).all() else None,
            source=source,
        )

    @cached_property
    def _camera(self) -> Camera | None:
        fields = self.head["camera"]
        return None if fields is None else Camera(**fields)
