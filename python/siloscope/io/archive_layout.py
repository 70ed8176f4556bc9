"""How an archive lies on disk: the documents and chunks of a Zarr v3 folder."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.errors import InputError

CHECKSUM = {"name": "crc32c"}
BYTES = {"name": "bytes", "configuration": {"endian": "little"}}


# With the bytes of the pixels sorted by weight, LZ4 HC packs like Zstandard and unpacks twice as fast.
def blosc(itemsize: int) -> dict[str, Any]:
    """The codec of the depth's chunks."""
    setting = {"cname": "lz4hc", "clevel": 5, "shuffle": "shuffle", "typesize": itemsize, "blocksize": 0}
    return {"name": "blosc", "configuration": setting}


def array_document(shape: list[int], chunk: list[int], dtype: str, names: list[str], **more: Any) -> dict[str, Any]:
    """The ``zarr.json`` of an array; chunks lie flat in its folder as ``c.0.0.0``."""
    compressor = [blosc(np.dtype(dtype).itemsize)] if "attributes" in more else []
    return {
        "zarr_format": 3,
        "node_type": "array",
        "shape": shape,
        "data_type": dtype,
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": chunk}},
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "."}},
        "fill_value": 0 if dtype.startswith("uint") else "NaN",
        "codecs": [BYTES, *compressor, CHECKSUM],
        "dimension_names": names,
        "attributes": {},
        **more,
    }


def document_bytes(document: dict[str, Any]) -> bytes:
    """A ``zarr.json`` as bytes."""
    return json.dumps(document, indent=1, default=str).encode()


def with_checksum(data: bytes) -> bytes:
    """A chunk with its CRC-32C behind it."""
    return data + struct.pack("<I", _core.checksum(data))


def without_checksum(data: bytes) -> bytes:
    """A chunk, if it is the one that its CRC-32C is of; raises `InputError`."""
    chunk = data[:-4]
    if len(data) < 4 or struct.unpack("<I", data[-4:])[0] != _core.checksum(chunk):
        raise InputError("its chunk fails the checksum; the file is damaged")
    return chunk


def compressed(depth: NDArray[Any]) -> bytes:
    """A depth image as a chunk's bytes."""
    from numcodecs.blosc import Blosc

    packed: bytes = Blosc("lz4hc", 5, Blosc.SHUFFLE).encode(np.ascontiguousarray(depth))
    return packed


def decompressed(data: bytes, shape: tuple[int, int], dtype: str) -> NDArray[Any]:
    """The depth image of a chunk's bytes; raises `InputError`."""
    from numcodecs.blosc import Blosc

    size = shape[0] * shape[1] * np.dtype(dtype).itemsize
    told, _, stored = struct.unpack_from("<III", data, 4) if len(data) >= 16 else (0, 0, 0)
    if (told, stored) != (size, len(data)):
        raise InputError(f"its chunk is declared {told} bytes large, not {size}; the file is damaged")
    depth = np.empty(shape, dtype)
    try:
        Blosc().decode(data, depth)
    except (RuntimeError, ValueError) as error:
        raise InputError(f"its chunk is damaged ({error})") from None
    return depth
