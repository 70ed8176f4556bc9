"""TIFF depth images: integers are raw units, floating point is metres; several pages are several frames."""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.errors import InputError
from siloscope.io.beside import take_camera_beside
from siloscope.io.source import Format, FrameSource, Item, Options, check_image_size
from siloscope.types.frame import Frame

MAGICS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_TYPES = ("uint16", "int16", "uint32", "int32", "float16", "float32", "float64")

_BY_PILLOW = "ZSTD"
"""The compression that Pillow undoes: the Rust decoder would need a second copy of Zstandard."""
_BEST_RATIO = 1032
"""How many times smaller depth gets at most, as by deflate; more is a damaged or hostile file."""


class TiffSource(FrameSource):
    """One TIFF with its pages."""

    def __init__(self, path: Path, options: Options) -> None:
        super().__init__(path, "tiff", options)
        self._pages = read_pages(path)
        take_camera_beside(self, (self._pages[0].width, self._pages[0].height))

    def _items(self) -> Iterator[Item]:
        for index, page in enumerate(self._pages):
            label = self.path.name if len(self._pages) == 1 else f"frame {index}"
            yield Item(label, partial(read_page, self.path, index, page))

    def _count(self) -> int:
        return len(self._pages)

    def _streams(self) -> list[dict[str, Any]]:
        first = self._pages[0]
        stream = {"name": "depth", "kind": "depth", "size": [first.width, first.height], "dtype": first.sample_type}
        return [{**stream, "frames": len(self._pages), "chosen": True}]


def read_pages(path: Path) -> list[_core.TiffPage]:
    """Sizes and types of all pages; raises `InputError` where the first is no depth image."""
    return read_pages_of(str(path), path)


def read_pages_of(name: str, source: Path | bytes) -> list[_core.TiffPage]:
    """The same for a file or the bytes of one."""
    try:
        pages = _core.tiff_pages(source)
    except ValueError as error:
        raise InputError(f"{name}: damaged TIFF ({error}); export the frame again") from None
    _check(name, pages[0])
    return pages


def read_page(path: Path, index: int, page: _core.TiffPage) -> Frame:
    """The depth image of one page, in raw units or metres."""
    return Frame(depth=decode_page(str(path), path, index, page), source=str(path))


def decode_page(name: str, source: Path | bytes, index: int, page: _core.TiffPage) -> NDArray[Any]:
    """Depth (H, W) of one page of a file or the bytes of one."""
    _check(name, page)
    decode = _decode_by_pillow if page.compression == _BY_PILLOW else _core.decode_tiff
    try:
        depth: NDArray[Any] = decode(source, index).reshape(page.height, page.width)
    except ValueError as error:
        raise InputError(f"{name}: page {index} is damaged or not read ({error}); export the frame again") from None
    return depth


def _decode_by_pillow(source: Path | bytes, index: int) -> NDArray[Any]:
    from PIL import Image

    data = source if isinstance(source, bytes) else source.read_bytes()
    try:
        with Image.open(io.BytesIO(data), formats=["TIFF"]) as image:
            image.seek(index)
            if image.width * image.height * 4 > len(data) * _BEST_RATIO:
                raise ValueError(f"{len(data)} bytes can't hold {image.width} x {image.height} pixels")
            return np.array(image)
    except (OSError, SyntaxError, EOFError, KeyError, TypeError, OverflowError, struct.error) as error:
        raise ValueError(error) from None


def read(path: Path) -> Frame:
    """The depth image of a file with one page."""
    return read_page(path, 0, read_pages(path)[0])


def _check(name: str, page: _core.TiffPage) -> None:
    if page.sample_type not in _TYPES:
        raise InputError(
            f"{name}: a TIFF of {page.sample_type} is a picture, not depth; export 16-bit grey or floating-point metres"
        )
    check_image_size(name, page.width, page.height)


FORMAT = Format("tiff", lambda head, path: head.startswith(MAGICS), TiffSource, read_one=read)
