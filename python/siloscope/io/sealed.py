"""Sealed archives as a source: a silo's frames in shards of many (`siloscope pack`), and a store of several of them.

The same Zarr v3 group as an archive (`siloscope.io.archive`), but an object of ``depth`` holds many frames, and the
array ``sha256`` the hash of every frame's chunk. Slots behind the last frame of a shard may be empty.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError
from siloscope.io.archive import ArchiveSource
from siloscope.io.archive_layout import without_checksum
from siloscope.io.shard_layout import EMPTY, index_length, places, slots_of
from siloscope.io.source import Format, FrameSource, Item, Options

STORE_SCHEMA = "siloscope.store/1"
_GROUP = "zarr.json"
_LARGEST = 1 << 20
_HASH = 32
"""Bytes of a frame's SHA-256."""


class SealedSource(ArchiveSource):
    """The frames of one camera in one silo; reading one takes its shard's index, once, and one range."""

    def __init__(self, path: Path, options: Options) -> None:
        self.rows = slots_of(_document(path / "depth" / _GROUP)) or self.rows
        self._index = lru_cache(maxsize=64)(self._read_index)
        self.lost: list[str] = []
        super().__init__(path, options)
        self.format = self.provenance["format"] = "sealed"
        self.missing = len(self._sealed() - set(self.numbers))
        self.problems = [self._loss()] if self.missing else []

    def _is_ours(self, array: dict[str, Any], codecs: list[Any]) -> bool:
        return slots_of(array) is not None

    def _numbers(self) -> list[int]:
        found: list[int] = []
        for shard in range(-(-self.declared // self.rows)):
            try:
                filled = np.flatnonzero(self._index(shard)[:, 0] != EMPTY)
            except InputError as error:
                self.lost.append(str(error))
                continue
            found += (filled + shard * self.rows).tolist()
        return [number for number in found if number < self.declared]

    def _loss(self) -> str:
        return "; ".join([super()._loss(), *self.lost])

    def _sealed(self) -> set[int]:
        """Numbers of the frames that were sealed, by their hashes."""
        numbers: set[int] = set()
        for shard in range(-(-self.declared // self.rows)):
            try:
                hashes = without_checksum((self.path / "sha256" / f"c.{shard}.0").read_bytes())
            except (OSError, InputError):
                continue
            if len(hashes) == self.rows * _HASH:
                filled = np.frombuffer(hashes, np.uint8).reshape(-1, _HASH).any(axis=1)
                numbers |= set((np.flatnonzero(filled) + shard * self.rows).tolist())
        return numbers

    def _object(self, shard: int) -> Path:
        return self.path / "depth" / f"c.{shard}.0.0"

    def _read_index(self, shard: int) -> NDArray[np.uint64]:
        path, length = self._object(shard), index_length(self.rows)
        try:
            with path.open("rb") as file:
                size = file.seek(0, os.SEEK_END)
                file.seek(max(size - length, 0))
                return places(file.read(), self.rows, str(path))
        except OSError as error:
            raise InputError(f"{path}: can't be read ({error.strerror}); seal the frames again") from None

    def _chunk(self, number: int) -> bytes:
        shard, slot = divmod(number, self.rows)
        offset, length = (int(value) for value in self._index(shard)[slot])
        path = self._object(shard)
        try:
            if offset + length > path.stat().st_size:
                raise InputError(f"frame {number}: it lies behind the end of {path}; the shard is damaged")
            with path.open("rb") as file:
                file.seek(offset)
                return file.read(length)
        except OSError as error:
            raise InputError(f"frame {number}: {path} can't be read ({error.strerror})") from None


def open_sealed(path: Path, options: Options) -> FrameSource:
    """A sealed archive, or the one in a store that ``stream`` names; where several fit, a source that lists them."""
    if (path / "depth" / _GROUP).is_file():
        return SealedSource(path, options)
    known = {group.relative_to(path).as_posix(): group for group in _groups(path)}
    fitting = {name: group for name, group in known.items() if (options.stream or "") in name}
    if len(fitting) == 1:
        ((_, group),) = fitting.items()
        return _Chosen(group, options)
    if not fitting:
        wanted = f"none named '{options.stream}'; it has {', '.join(known)}" if known else "none in it; seal some"
        raise InputError(f"{path}: a store of sealed frames, but {wanted}")
    return _Several(path, options, fitting)


class _Chosen(SealedSource):
    """One of a store's, called by the name it was chosen by."""

    def _streams(self) -> list[dict[str, Any]]:
        name = f"{self.path.parent.name}/{self.path.name}"
        return [{**stream, "name": name} for stream in super()._streams()]


class _Several(FrameSource):
    """What a store has, where it is not said which is meant."""

    def __init__(self, path: Path, options: Options, groups: dict[str, Path]) -> None:
        super().__init__(path, "sealed", options)
        self.groups = {name: SealedSource(group, options) for name, group in groups.items()}

    def _items(self) -> Iterator[Item]:
        names = ", ".join(self.groups)
        raise InputError(f"{self.name}: frames of {len(self.groups)} cameras; choose one with --stream: {names}")

    def _count(self) -> int:
        return sum(len(source) for source in self.groups.values())

    def _streams(self) -> list[dict[str, Any]]:
        listed = [(name, source._streams()[0]) for name, source in self.groups.items()]
        return [{**stream, "name": name, "chosen": False} for name, stream in listed]


def _groups(store: Path) -> list[Path]:
    """The sealed archives of a store."""
    return sorted(group.parent.parent for group in store.glob(f"silo=*/camera=*/depth/{_GROUP}"))


def _document(path: Path) -> dict[str, Any]:
    """A Zarr description; empty where it can't be read, which the source tells."""
    try:
        document = json.loads(path.read_bytes()) if path.stat().st_size <= _LARGEST else None
    except (OSError, ValueError, RecursionError):
        document = None
    return document if isinstance(document, dict) else {}


def _is_sealed(head: bytes, path: Path) -> bool:
    if not path.is_dir() or not (path / _GROUP).is_file():
        return False
    attributes = _document(path / _GROUP).get("attributes")
    if isinstance(attributes, dict) and attributes.get("schema") == STORE_SCHEMA:
        return True
    return slots_of(_document(path / "depth" / _GROUP)) is not None


FORMAT = Format("sealed", _is_sealed, open_sealed)
