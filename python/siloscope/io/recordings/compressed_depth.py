"""Compressed images of recordings whose compression loses nothing: PNG, TIFF, and ROS's compressedDepth (PNG, RVL)."""

from __future__ import annotations

import math
import struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.errors import InputError
from siloscope.io.images import png, tiff
from siloscope.io.recordings.wire import Header, Wire
from siloscope.io.source import check_image_size

_LOSSY = {b"\xff\xd8\xff": "JPEG", b"RIFF": "WebP", b"\x00\x00\x00\x1c": "AVIF", b"\x00\x00\x00\x20": "AVIF"}
_REMEDY = "the raw or the compressedDepth topic"
_CONFIG = 12
"""Bytes of compressedDepth's header: its format, then A and B of the quantisation."""


class CompressedImage(NamedTuple):
    """``sensor_msgs/CompressedImage``, and what is like it."""

    header: Header
    format: str
    data: memoryview


def read_compressed_image(wire: Wire) -> CompressedImage:
    """``sensor_msgs/CompressedImage``."""
    return CompressedImage(wire.header(), wire.string(), wire.blob())


def is_transported(image: CompressedImage) -> bool:
    """Whether the image comes by the transport compressedDepth."""
    return "compresseddepth" in image.format.lower()


def shape_of(image: CompressedImage, transported: bool) -> tuple[tuple[int, int], str]:
    """Width and height, and the pixels' type, from the head; raises `InputError`, saying why, where it is no depth."""
    floats = image.format.strip().startswith("32FC1")
    data = image.data
    if transported and _is_rvl(image):
        width, height = _rvl_size(data)
        return (width, height), "float32" if floats else "uint16"
    start = _png_start(data)[0] if transported else 0
    head = bytes(data[start : start + 33])
    if head.startswith(png.MAGIC):
        return png.read_size("image", head), "float32" if floats else "uint16"
    if head.startswith(tiff.MAGICS):
        page = tiff.read_pages_of("image", bytes(data))[0]
        return (page.width, page.height), page.sample_type
    lossy = next((name for magic, name in _LOSSY.items() if head.startswith(magic)), None)
    if lossy:
        raise InputError(
            f"compressed as {lossy}, which loses the distances; record the raw or the compressedDepth topic"
        )
    raise InputError(f"compressed as '{image.format}', which is not read; record the raw or the compressedDepth topic")


def decompress(image: CompressedImage, transported: bool) -> NDArray[Any]:
    """Depth (H, W): uint16 in raw units or float32 in metres.

    compressedDepth is a 12-byte header, then a PNG or RVL. 16UC1 is the image itself. 32FC1 is inverse depth q
    quantised into it: with the header's A and B the depth is ``A / (q - B)``, and 0 is "no measurement"; NaN where
    there is none.
    """
    if not transported:
        shape_of(image, False)
        data = bytes(image.data)
        if data.startswith(png.MAGIC):
            return np.asarray(png.decode("compressed image", data))
        return tiff.decode_page("compressed image", data, 0, tiff.read_pages_of("compressed image", data)[0])
    quantised: tuple[float, float] | None
    if _is_rvl(image):
        raw, quantised = _from_rvl(image.data)
    else:
        start, quantised = _png_start(image.data)
        raw = np.asarray(png.decode("compressed depth", bytes(image.data[start:])), dtype=np.uint16)
    if not image.format.strip().startswith("32FC1"):
        return raw
    if quantised is None:
        raise InputError("32FC1 depth without its quantisation header")
    return _from_inverse_depth(raw, *quantised)


def _is_rvl(image: CompressedImage) -> bool:
    return "rvl" in image.format.lower()


def _rvl_size(data: memoryview) -> tuple[int, int]:
    if len(data) < _CONFIG + 8:
        raise InputError("compressed depth breaks off in its header")
    width, height = struct.unpack_from("<II", data, _CONFIG)
    check_image_size("compressed depth", width, height)
    return width, height


def _from_rvl(data: memoryview) -> tuple[NDArray[np.uint16], tuple[float, float]]:
    width, height = _rvl_size(data)
    _, a, b = struct.unpack_from("<iff", data)
    try:
        raw = _core.decompress_rvl(bytes(data[_CONFIG + 8 :]), width * height)
    except ValueError as error:
        raise InputError(f"damaged RVL ({error})") from None
    return raw.reshape(height, width), (a, b)


def _png_start(data: memoryview) -> tuple[int, tuple[float, float] | None]:
    if bytes(data[:8]) == png.MAGIC:
        return 0, None
    if bytes(data[_CONFIG : _CONFIG + 8]) != png.MAGIC:
        raise InputError("compressed depth without a PNG")
    _, a, b = struct.unpack("<iff", data[:_CONFIG])
    return _CONFIG, (a, b)


def _from_inverse_depth(raw: NDArray[np.uint16], a: float, b: float) -> NDArray[np.float32]:
    if not (math.isfinite(a) and math.isfinite(b) and a > 0):
        raise InputError(f"32FC1 depth has no usable quantisation (A = {a}, B = {b})")
    with np.errstate(divide="ignore", over="ignore"):
        depth = (np.float64(a) / (raw.astype(np.float64) - b)).astype(np.float32)
    return np.where((raw > 0) & np.isfinite(depth), depth, np.float32(np.nan))
