"""Seals the frames of one camera in one silo, shard by shard, behind those that are sealed already."""

from __future__ import annotations

import hashlib
import json
import math
from collections import Counter
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError
from siloscope.fleet.naming import Series
from siloscope.fleet.store import Store
from siloscope.io.archive import head_of
from siloscope.io.archive_layout import array_document, compressed, document_bytes, with_checksum
from siloscope.io.shard_layout import depth_document, sealed, slots_of
from siloscope.types.frame import Frame
from siloscope.types.track import ABSOLUTE

_DTYPES = ("uint16", "float32", "float64")


@dataclass
class Waiting:
    """The frames of the shard that is being filled, packed already."""

    chunks: list[bytes] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    gravities: list[NDArray[np.float64]] = field(default_factory=list)
    hashes: list[bytes] = field(default_factory=list)
    month: str | None = None


class SeriesWriter:
    """Fills and seals shards; a sealed one never changes.

    The frames' object comes last of a shard's, and the arrays' lengths after it, so an interruption leaves either a
    whole shard or none; what is left of one that was cut off is written again by the next `seal`.

    Raises
    ------
    InputError
        For points, and for a frame of another camera, size or unit than those before.
    """

    def __init__(self, store: Store, series: Series, slots: int, calibration: str | None) -> None:
        self.store, self.series, self.slots = store, series, slots
        self.head: dict[str, Any] | None = None
        self.next_shard = 0
        self.known: Counter[bytes] = Counter()
        self.calibration = calibration
        self._waiting = Waiting()
        self._version: str | None = None
        self._go_on()

    def append(self, frame: Frame) -> bool:
        """Takes a frame in; False where the same one, by time and values, is sealed already."""
        depth = frame.depth
        if depth is None or depth.dtype.name not in _DTYPES:
            kind = "points" if depth is None else f"{depth.dtype} depth"
            raise InputError(f"{frame.source}: depth images (uint16 or floating point) are sealed, not {kind}")
        self._check_alike(frame, depth)
        chunk = with_checksum(compressed(depth))
        digest, time = hashlib.sha256(chunk).digest(), math.nan if frame.timestamp is None else frame.timestamp
        if self.known[key := _key(digest, time)]:
            self.known[key] -= 1
            return False
        month = _month(time)
        if len(self._waiting.chunks) == self.slots or (self._waiting.chunks and month != self._waiting.month):
            self.flush()
        waiting = self._waiting
        waiting.month = month
        waiting.chunks.append(chunk)
        waiting.times.append(time)
        waiting.hashes.append(digest)
        waiting.gravities.append(np.full(3, np.nan) if frame.gravity is None else np.asarray(frame.gravity))
        return True

    def flush(self) -> None:
        """Seals what waits, however little."""
        waiting, number, slots = self._waiting, self.next_shard, self.slots
        if not waiting.chunks or self.head is None:
            return
        count, folder = len(waiting.chunks), self.series.folder
        times = np.full(slots, np.nan, "<f8")
        gravities = np.full((slots, 3), np.nan, "<f8")
        hashes = np.zeros((slots, 32), np.uint8)
        times[:count], gravities[:count] = waiting.times, waiting.gravities
        hashes[:count] = [np.frombuffer(digest, np.uint8) for digest in waiting.hashes]
        put = self.store.put
        put(f"{folder}/timestamp/c.{number}", with_checksum(times.tobytes()))
        put(f"{folder}/gravity/c.{number}.0", with_checksum(gravities.tobytes()))
        put(f"{folder}/sha256/c.{number}.0", with_checksum(hashes.tobytes()))
        put(self.series.shard_object(number), sealed(waiting.chunks, slots))
        self._describe(number * slots + count)
        self.next_shard, self._waiting = number + 1, Waiting()

    def _go_on(self) -> None:
        """Takes up where the last packing has ended."""
        folder = self.series.folder
        self._version = self.store.version(f"{folder}/depth/zarr.json")
        if self._version is None:
            return
        array = json.loads(self.store.get(f"{folder}/depth/zarr.json"))
        slots = slots_of(array)
        if slots is None:
            raise InputError(f"{self.store.place}/{folder}: not as siloscope seals it; name another store")
        attributes = json.loads(self.store.get(f"{folder}/zarr.json"))["attributes"]
        own = ("provenance", "silo", "camera_id", "calibration")
        self.head = {key: value for key, value in attributes.items() if key not in own}
        self.calibration = self.calibration or attributes.get("calibration")
        self.slots, self.next_shard = slots, -(-array["shape"][0] // slots)
        for number in range(self.next_shard):
            times, hashes = sealed_rows(self.store, self.series, number, slots)
            self.known.update(_key(digest.tobytes(), float(time)) for time, digest in zip(times, hashes, strict=True))

    def _check_alike(self, frame: Frame, depth: NDArray[Any]) -> None:
        head = json.loads(json.dumps(head_of(frame, depth)))  # as it is read back
        if self.head is None:
            self.head = head
            self._provenance = {k: v for k, v in frame.provenance.items() if k != "frame"}
        for key, value in head.items():
            if self.head.get(key) != value:
                raise InputError(
                    f"{frame.source}: its {key.replace('_', ' ')} is {value}, that of {self.series.name} in "
                    f"{self.store.place} is {self.head.get(key)}; seal it under another --camera-id"
                )

    def _describe(self, length: int) -> None:
        """The arrays' descriptions; that of the depth last, for it says how many frames there are."""
        head, folder = self.head or {}, self.series.folder
        if self._version is None:
            ids = {"silo": self.series.silo, "camera_id": self.series.camera, "calibration": self.calibration}
            attributes = {**head, **ids, "provenance": self._provenance}
            group = {"zarr_format": 3, "node_type": "group", "attributes": attributes}
            self.store.put(f"{folder}/zarr.json", document_bytes(group))
            self.store.put(f"{folder.partition('/')[0]}/zarr.json", document_bytes({**group, "attributes": {}}))
        arrays = {
            "timestamp": array_document([length], [self.slots], "float64", ["frame"]),
            "gravity": array_document([length, 3], [self.slots, 3], "float64", ["frame", "axis"]),
            "sha256": {**array_document([length, 32], [self.slots, 32], "uint8", ["frame", "byte"]), "fill_value": 0},
        }
        for name, array in arrays.items():
            self.store.put(f"{folder}/{name}/zarr.json", document_bytes(array))
        shape = [length, head["height"], head["width"]]
        depth = document_bytes(depth_document(shape, self.slots, head["dtype"], head["depth_unit"]))
        if not self.store.exchange(f"{folder}/depth/zarr.json", self._version, depth):
            raise InputError(f"{self.store.place}/{folder}: another packing has gone on with it; run this one again")
        self._version = self.store.version(f"{folder}/depth/zarr.json")


def sealed_rows(store: Store, series: Series, shard: int, slots: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Times (n,) and SHA-256 (n, 32) of the frames of a sealed shard."""
    folder = series.folder
    times = np.frombuffer(store.get(f"{folder}/timestamp/c.{shard}")[:-4], "<f8")
    hashes = np.frombuffer(store.get(f"{folder}/sha256/c.{shard}.0")[:-4], np.uint8).reshape(slots, 32)
    filled = hashes.any(axis=1)
    return times[filled], hashes[filled]


def _key(digest: bytes, time: float) -> bytes:
    return digest + np.float64(time).tobytes()


def _month(time: float) -> str | None:
    """``2026-11``; None for times that only count from a recording's start."""
    return datetime.fromtimestamp(time, UTC).strftime("%Y-%m") if ABSOLUTE < time < 2.5e11 else None
