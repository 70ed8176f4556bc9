"""Zstandard: of Python itself from 3.14 on, of its backport before."""

from __future__ import annotations

import io
import sys
from collections.abc import Iterator
from pathlib import Path

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

__all__ = ["DamagedError", "content_size", "steps", "zstd"]

WINDOW_LOG = 27
"""Largest window that is unpacked, as a power of two: 128 MB, what the command line tool allows."""


class DamagedError(ValueError):
    """Data that is no Zstandard stream, or needs too large a window."""


def steps(packed: bytes | Path, size: int) -> Iterator[bytes]:
    """Parts of at most `size` bytes of what one or several frames unpack to, of a file or of bytes.

    Raises `DamagedError`, and `EOFError` where the end is missing.
    """
    source = packed if isinstance(packed, Path) else io.BytesIO(packed)
    options = {int(zstd.DecompressionParameter.window_log_max): WINDOW_LOG}
    try:
        with zstd.ZstdFile(source, options=options) as file:
            while part := file.read(size):
                yield part
    except zstd.ZstdError as error:
        raise DamagedError(str(error)) from None


def content_size(frame: bytes) -> int | None:
    """Bytes that a frame says it unpacks to; None where it does not tell. Raises `DamagedError`."""
    try:
        return zstd.get_frame_info(frame).decompressed_size
    except zstd.ZstdError as error:
        raise DamagedError(str(error)) from None
