"""TIFF depth images: integers are raw units, floating point is metres; several pages are several frames."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from siloscope.errors import InputError
from siloscope.frame import Frame
from siloscope.frames.beside import take_camera_beside
from siloscope.frames.source import Format, FrameSource, Item, Options, check_image_size

if TYPE_CHECKING:
    from PIL import Image

MAGICS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_MODES = {"I;16": "uint16", "I;16B": "uint16", "I;16L": "uint16", "I": "int32", "F": "float32"}
_COMPRESSIONS = {"raw": 1, "tiff_lzw": 3000, "tiff_adobe_deflate": 1032, "tiff_deflate": 1032, "packbits": 128}
"""Compressions that are read, and how much smaller each can make a file."""

_MOST_PAGES = 100_000


class TiffSource(FrameSource):
    """One TIFF with its pages."""

    def __init__(self, path: Path, options: Options) -> None:
        super().__init__(path, "tiff", options)
        with _opened(path) as image:
            self._pages = _pages(self.name, image)
            self._size, self._mode = image.size, _MODES[image.mode]
        take_camera_beside(self, self._size)

    def _items(self) -> Iterator[Item]:
        for page in range(self._pages):
            label = self.path.name if self._pages == 1 else f"frame {page}"
            yield Item(label, partial(read_page, self.path, page))

    def _count(self) -> int:
        return self._pages

    def _streams(self) -> list[dict[str, Any]]:
        stream = {"name": "depth", "kind": "depth", "size": list(self._size), "dtype": self._mode}
        return [{**stream, "frames": self._pages, "chosen": True}]


def read_page(path: Path, page: int) -> Frame:
    """The depth image of one page, in raw units or metres."""
    with _opened(path) as image:
        try:
            image.seek(page)
            _check(str(path), path, image)
            depth = np.array(image)
        except InputError:
            raise
        except Exception as error:  # a damaged TIFF fails in Pillow and libtiff in many ways
            raise InputError(f"{path}: page {page} is damaged ({_cause(error)}); export the frame again") from None
    if depth.ndim != 2:
        raise InputError(f"{path}: page {page} is no single-channel image; export the depth alone")
    return Frame(depth=depth.astype(depth.dtype.newbyteorder("="), copy=False), source=str(path))


def read(path: Path) -> Frame:
    """The depth image of a file with one page."""
    return read_page(path, 0)


def _opened(path: Path) -> Image.Image:
    from PIL import TiffImagePlugin

    try:
        image = TiffImagePlugin.TiffImageFile(path)
    except Exception as error:  # as in read_page
        raise InputError(f"{path}: damaged TIFF ({_cause(error)}); export the frame again") from None
    try:
        _check(str(path), path, image)
    except InputError:
        image.close()
        raise
    return image


def _check(name: str, path: Path, image: Any) -> None:
    """Refuses what is no depth, and sizes that the file can't hold, before anything is decoded."""
    if image.mode not in _MODES:
        raise InputError(
            f"{name}: a TIFF of mode {image.mode} is a picture, not depth; export 16-bit or 32-bit floating-point grey"
        )
    compression = image.info.get("compression", "raw")
    if compression not in _COMPRESSIONS:
        raise InputError(f"{name}: TIFF compression '{compression}' is not read; export it as LZW, deflate or raw")
    width, height = image.size
    check_image_size(name, width, height)
    declared = width * height * np.dtype(_MODES[image.mode]).itemsize
    there = path.stat().st_size
    if declared > there * _COMPRESSIONS[compression]:
        raise InputError(
            f"{name}: {there} bytes can't hold {width} x {height} pixels; the file is damaged, export it again"
        )


def _pages(name: str, image: Any) -> int:
    try:
        pages = int(image.n_frames)
    except Exception as error:  # as in read_page
        raise InputError(f"{name}: the list of pages is damaged ({_cause(error)}); export it again") from None
    if not 1 <= pages <= _MOST_PAGES:
        raise InputError(f"{name}: {pages} pages; the file is damaged, export it again")
    return pages


def _cause(error: Exception) -> str:
    return " ".join(str(error).split())[:120] or type(error).__name__


FORMAT = Format("tiff", lambda head, path: head.startswith(MAGICS), TiffSource, read_one=read)
