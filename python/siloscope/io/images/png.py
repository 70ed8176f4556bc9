"""16-bit grey PNG: one depth image in raw units."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

from siloscope import _core
from siloscope.errors import InputError
from siloscope.io.beside import take_camera_beside
from siloscope.io.images.one_image import ImageSource
from siloscope.io.source import Format, Options, check_image_size, read_bytes
from siloscope.types.frame import Frame

MAGIC = b"\x89PNG\r\n\x1a\n"
_COLOUR_TYPES = {0: "grey", 2: "colour", 3: "palette", 4: "grey with alpha", 6: "colour with alpha"}


def read_size(name: str, head: bytes) -> tuple[int, int]:
    """Width and height from the first 33 bytes of a 16-bit grey PNG; refuses every other kind."""
    if len(head) < 33 or head[:8] != MAGIC or head[12:16] != b"IHDR":
        raise InputError(f"{name}: the PNG breaks off in its header; export the frame again")
    width, height, bits, colour = struct.unpack(">IIBB", head[16:26])
    if bits != 16 or colour != 0:
        kind = _COLOUR_TYPES.get(colour, f"colour type {colour}")
        raise InputError(
            f"{name}: a {bits}-bit {kind} PNG is a picture, not depth; export depth as 16-bit grey PNG "
            "(colour maps and 8-bit previews have lost the distances)"
        )
    check_image_size(name, width, height)
    return width, height


def decode(name: str, data: bytes) -> Any:
    """Depth (H, W) uint16 in raw units; raises `InputError` naming the damage."""
    width, height = read_size(name, data)
    try:
        return _core.decode_png16(data).reshape(height, width)
    except ValueError as error:
        raise InputError(f"{name}: damaged PNG ({error}); export the frame again") from None


def read(path: Path) -> Frame:
    """The depth image of one file, in raw units, without a camera."""
    return Frame(depth=decode(str(path), read_bytes(path)), source=str(path))


class PngSource(ImageSource):
    """One PNG."""

    def __init__(self, path: Path, options: Options) -> None:
        with path.open("rb") as file:
            size = read_size(str(path), file.read(33))
        super().__init__(path, "png", options, size, "uint16", read)
        take_camera_beside(self, size)


FORMAT = Format("png", lambda head, path: head.startswith(MAGIC), PngSource, read_one=read)
