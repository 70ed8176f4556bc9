"""TIFF depth images: integers are raw units, floating point is metres; several pages are several frames."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

from siloscope import _core
from siloscope.errors import InputError
from siloscope.io.beside import take_camera_beside
from siloscope.io.source import Format, FrameSource, Item, Options, check_image_size
from siloscope.types.frame import Frame

MAGICS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_TYPES = ("uint16", "int16", "uint32", "int32", "float32", "float64")

Page = tuple[int, int, str]
"""Width, height and sample type."""


class TiffSource(FrameSource):
    """One TIFF with its pages."""

    def __init__(self, path: Path, options: Options) -> None:
        super().__init__(path, "tiff", options)
        self._pages = read_pages(path)
        take_camera_beside(self, self._pages[0][:2])

    def _items(self) -> Iterator[Item]:
        for index, page in enumerate(self._pages):
            label = self.path.name if len(self._pages) == 1 else f"frame {index}"
            yield Item(label, partial(read_page, self.path, index, page))

    def _count(self) -> int:
        return len(self._pages)

    def _streams(self) -> list[dict[str, Any]]:
        width, height, kind = self._pages[0]
        stream = {"name": "depth", "kind": "depth", "size": [width, height], "dtype": kind}
        return [{**stream, "frames": len(self._pages), "chosen": True}]


def read_pages(path: Path) -> list[Page]:
    """Sizes and types of all pages; raises `InputError` where the first is no depth image."""
    try:
        pages = _core.tiff_pages(path)
    except ValueError as error:
        raise InputError(f"{path}: damaged TIFF ({error}); export the frame again") from None
    _check(path, pages[0])
    return pages


def read_page(path: Path, index: int, page: Page) -> Frame:
    """The depth image of one page, in raw units or metres."""
    _check(path, page)
    width, height, _ = page
    try:
        depth = _core.decode_tiff(path, index).reshape(height, width)
    except ValueError as error:
        raise InputError(f"{path}: page {index} is damaged or not read ({error}); export the frame again") from None
    return Frame(depth=depth, source=str(path))


def read(path: Path) -> Frame:
    """The depth image of a file with one page."""
    return read_page(path, 0, read_pages(path)[0])


def _check(path: Path, page: Page) -> None:
    width, height, kind = page
    if kind not in _TYPES:
        raise InputError(
            f"{path}: a TIFF of {kind} is a picture, not depth; export 16-bit grey or floating-point metres"
        )
    check_image_size(str(path), width, height)


FORMAT = Format("tiff", lambda head, path: head.startswith(MAGICS), TiffSource, read_one=read)
