"""Netpbm's PGM with 16 bits, raw units, and PFM, metres: a header of words, then the pixels."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError
from siloscope.io.beside import take_camera_beside
from siloscope.io.images.one_image import ImageSource
from siloscope.io.source import Format, Options, check_image_size, read_bytes
from siloscope.types.frame import Frame

MAGICS = (b"P5", b"P2", b"Pf", b"PF")
_LONGEST_HEADER = 4096
_SKIPPED = rb"(?:\s|#[^\n]*\n)+"
_HEADER = re.compile(rb"(P5|P2|Pf|PF)" + 3 * (_SKIPPED + rb"([^\s#]+)") + rb"\s")


class Header(NamedTuple):
    """What stands before the pixels."""

    kind: str
    """``P2`` text, ``P5`` binary, ``Pf`` floating point."""
    width: int
    height: int
    dtype: str
    """Of the pixels, with their byte order."""
    size: int
    """Bytes of the header."""


def read_header(name: str, head: bytes) -> Header:
    """Reads the header; raises `InputError` for pictures and for what is damaged."""
    match = _HEADER.match(head[:_LONGEST_HEADER])
    if match is None:
        raise InputError(f"{name}: the header of the PGM or PFM breaks off or is damaged; export the frame again")
    kind = match[1].decode()
    if kind == "PF":
        raise InputError(f"{name}: a colour PFM is a picture, not depth; export depth as a grey PFM")
    width, height, scale = (_number(name, word) for word in match.groups()[1:])
    check_image_size(name, int(width), int(height))
    if kind == "Pf":
        return Header(kind, int(width), int(height), "<f4" if scale < 0 else ">f4", match.end())
    if not 255 < scale <= 65_535:
        raise InputError(f"{name}: a PGM of 8 bits is a picture, not depth; export depth with 16 bits (maxval 65535)")
    return Header(kind, int(width), int(height), ">u2", match.end())


def _number(name: str, word: bytes) -> float:
    try:
        number = float(word)
    except ValueError:
        number = math.nan
    if not -1e9 < number < 1e9:
        raise InputError(f"{name}: '{word[:20].decode('latin-1')}' in the header is no number; export the frame again")
    return number


def read(path: Path) -> Frame:
    """The depth image of one file: raw units, or metres of a PFM, whose rows go upwards."""
    name, data = str(path), read_bytes(path)
    header = read_header(name, data)
    pixels = _text(name, data, header) if header.kind == "P2" else _binary(name, data, header)
    if header.kind != "Pf":
        return Frame(depth=pixels.astype(np.uint16), source=name)
    return Frame(depth=np.ascontiguousarray(pixels[::-1], np.float32), source=name)


def _binary(name: str, data: bytes, header: Header) -> NDArray[Any]:
    count, kind = header.width * header.height, np.dtype(header.dtype)
    there = (len(data) - header.size) // kind.itemsize
    if there < count:
        raise InputError(
            f"{name}: the header declares {header.width} x {header.height} pixels but the file holds {there}; "
            "it was cut off, export the frame again"
        )
    return np.frombuffer(data, kind, count, header.size).reshape(header.height, header.width)


def _text(name: str, data: bytes, header: Header) -> NDArray[Any]:
    words = data[header.size :].split()
    count = header.width * header.height
    try:
        pixels = np.array(words[:count], np.int64)
    except (ValueError, OverflowError):
        pixels = np.empty(0, np.int64)
    if len(pixels) != count or (count and not 0 <= pixels.min() <= pixels.max() <= 65_535):
        raise InputError(f"{name}: the pixels are not {count} numbers of 16 bits; export the frame again")
    return pixels.reshape(header.height, header.width)


class NetpbmSource(ImageSource):
    """One PGM or PFM."""

    def __init__(self, path: Path, options: Options) -> None:
        with path.open("rb") as file:
            header = read_header(str(path), file.read(_LONGEST_HEADER))
        size = header.width, header.height
        super().__init__(path, "netpbm", options, size, "float32" if header.kind == "Pf" else "uint16", read)
        take_camera_beside(self, size)


def _sniff(head: bytes, path: Path) -> bool:
    return head.startswith(MAGICS) and head[2:3] in (b" ", b"\n", b"\r", b"\t", b"#")


FORMAT = Format("netpbm", _sniff, NetpbmSource, read_one=read)
