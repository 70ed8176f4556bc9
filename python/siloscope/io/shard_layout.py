"""How a sealed shard lies: frames one behind the other, then the index of Zarr v3's ``sharding_indexed``."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.errors import InputError
from siloscope.io.archive_layout import BYTES, CHECKSUM, array_document, blosc

EMPTY = 2**64 - 1
"""Offset and length of a slot without a frame."""

MOST_FRAMES = 1024
"""Slots of a shard unless it is sealed with fewer, and the most there may be."""


def depth_document(shape: list[int], slots: int, dtype: str, unit: float | None) -> dict[str, Any]:
    """The ``zarr.json`` of the depth: a chunk a frame, `slots` chunks an object."""
    height, width = shape[1:]
    inner = {
        "chunk_shape": [1, height, width],
        "codecs": [BYTES, blosc(np.dtype(dtype).itemsize), CHECKSUM],
        "index_codecs": [BYTES, CHECKSUM],
        "index_location": "end",
    }
    document = array_document([*shape], [slots, height, width], dtype, ["frame", "row", "column"])
    scaled = {"units": "m", "scale_factor": unit if unit is not None else 1.0}
    return {**document, "codecs": [{"name": "sharding_indexed", "configuration": inner}], "attributes": scaled}


def slots_of(array: dict[str, Any]) -> int | None:
    """Frames that an object of a depth array holds; None where it is not as `depth_document` has it."""
    try:
        slots, height, width = array["chunk_grid"]["configuration"]["chunk_shape"]
        (codec,) = array["codecs"]
        inner = codec["configuration"]
        names = [step["name"] for step in inner["codecs"]]
        fits = (
            codec["name"] == "sharding_indexed"
            and inner["chunk_shape"] == [1, height, width] == [1, *array["shape"][1:]]
            and names == ["bytes", "blosc", "crc32c"]
            and [step["name"] for step in inner["index_codecs"]] == ["bytes", "crc32c"]
            and inner.get("index_location", "end") == "end"
        )
    except (KeyError, TypeError, ValueError):
        return None
    return slots if fits and type(slots) is int and 1 <= slots <= MOST_FRAMES else None


def index_length(slots: int) -> int:
    """Bytes of a shard's index: offset and length of every slot, and the CRC-32C of them all."""
    return 16 * slots + 4


def sealed(chunks: Sequence[bytes], slots: int) -> bytes:
    """The object of a shard whose first slots hold these chunks."""
    index = np.full((slots, 2), EMPTY, "<u8")
    lengths = np.array([len(chunk) for chunk in chunks], "<u8")
    index[: len(chunks), 1] = lengths
    index[: len(chunks), 0] = np.cumsum(lengths) - lengths
    written = index.tobytes()
    return b"".join([*chunks, written, struct.pack("<I", _core.checksum(written))])


def places(tail: bytes, slots: int, source: str) -> NDArray[np.uint64]:
    """Offset and length (slots, 2) of the frames, from an object's last bytes; raises `InputError`."""
    if len(tail) != index_length(slots) or struct.unpack("<I", tail[-4:])[0] != _core.checksum(tail[:-4]):
        raise InputError(f"{source}: the index at its end fails the checksum; the shard is damaged, seal it again")
    return np.frombuffer(tail[:-4], "<u8").reshape(slots, 2)
