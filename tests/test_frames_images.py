"""PNG and TIFF: pixels as others encode them; pictures, bombs and damage refused."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from numpy.typing import NDArray
from PIL import Image

import frame_files as made
import siloscope
from frame_files import put, read
from siloscope import InputError, _core


@given(arrays(np.uint16, array_shapes(min_dims=2, max_dims=2, max_side=40)))
def test_png_decodes_as_pillow_encodes(raw: NDArray[np.uint16]) -> None:
    file = io.BytesIO()
    Image.fromarray(raw).save(file, "PNG")
    assert np.array_equal(_core.decode_png16(file.getvalue()).reshape(raw.shape), raw)
    assert np.array_equal(_core.decode_png16(made.interlaced_png(raw)).reshape(raw.shape), raw)


@given(arrays(np.uint16, array_shapes(min_dims=2, max_dims=2, max_side=12)), st.data())
def test_every_filter_of_png(raw: NDArray[np.uint16], data: st.DataObject) -> None:
    filters = data.draw(st.lists(st.integers(0, 4), min_size=len(raw), max_size=len(raw)))
    file = made.png(raw.shape[1], len(raw), made.filtered(raw, filters))
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(file))), raw)
    assert np.array_equal(_core.decode_png16(file).reshape(raw.shape), raw)


PNG = made.MAKERS["depth.png"]()


@given(st.integers(0, len(PNG) - 1), st.integers(1, 255))
def test_a_damaged_byte_of_a_png_never_changes_a_pixel(at: int, change: int) -> None:
    damaged = bytearray(PNG)
    damaged[at] ^= change
    try:
        pixels = _core.decode_png16(bytes(damaged))
    except ValueError:
        return
    assert np.array_equal(pixels, made.RAW.ravel())


HEAD = made.chunk(b"IHDR", struct.pack(">IIBBBBB", 64, 48, 16, 0, 0, 0, 0))
DATA = zlib.compress(made.unfiltered(made.RAW))
WHOLE, END = made.chunk(b"IDAT", DATA), made.chunk(b"IEND", b"")
GOOD_CHUNKS = {
    "in parts": [HEAD, *(made.chunk(b"IDAT", part) for part in (DATA[:99], b"", DATA[99:])), END],
    "remarks": [HEAD, made.chunk(b"tEXt", b"who\0me"), WHOLE, made.chunk(b"tIME", bytes(7)), END],
    "little known": [HEAD, made.chunk(b"sBIT", b"\x0c"), WHOLE, END],
    "more behind": [HEAD, WHOLE, END, b"more"],
}
BAD_CHUNKS = {
    "no end": [HEAD, WHOLE],
    "no data": [HEAD, END],
    "no header": [WHOLE, END],
    "unknown and needed": [HEAD, made.chunk(b"ABCD", b""), WHOLE, END],
    "sum of the chunk": [HEAD, WHOLE[:-1] + bytes([WHOLE[-1] ^ 1]), END],
    "sum of the data": [HEAD, made.chunk(b"IDAT", DATA[:-1] + bytes([DATA[-1] ^ 1])), END],
    "unknown filter": [HEAD, made.chunk(b"IDAT", zlib.compress(b"\5" + made.unfiltered(made.RAW)[1:])), END],
}


@pytest.mark.parametrize("chunks", GOOD_CHUNKS.values(), ids=GOOD_CHUNKS.keys())
def test_chunks_of_a_png(chunks: list[bytes]) -> None:
    assert np.array_equal(_core.decode_png16(made.png_of(*chunks)), made.RAW.ravel())


@pytest.mark.parametrize("chunks", BAD_CHUNKS.values(), ids=BAD_CHUNKS.keys())
def test_chunks_that_do_not_make_a_png(chunks: list[bytes]) -> None:
    with pytest.raises(ValueError, match=r"\w"):
        _core.decode_png16(made.png_of(*chunks))


BAD_PNG = {
    "8-bit": (made.png(8, 8, b"\0" * 72, bits=8), "8-bit grey PNG is a picture"),
    "colour": (made.png(8, 8, b"\0" * 8 * 49, bits=16, colour=2), "16-bit colour PNG is a picture"),
    "palette": (made.png(8, 8, b"\0" * 72, bits=8, colour=3), "palette"),
    "header only": (PNG[:20], "breaks off in its header"),
    "cut": (PNG[:-300], "damaged PNG"),
    "bit flip": (PNG[:200] + bytes([PNG[200] ^ 16]) + PNG[201:], "damaged PNG"),
    "too few rows": (made.png(64, 48, made.unfiltered(made.RAW[:20])), "damaged PNG"),
    "no pixels": (made.png(0, 48, b""), "0 x 48"),
    "too wide": (made.png(30_000, 2, b""), "30000 x 2"),
    "bomb": (made.png(10_000, 10_000, b"\0" * 100), "10000 x 10000 pixels"),
}  # fmt: skip


@pytest.mark.parametrize(("content", "cause"), BAD_PNG.values(), ids=BAD_PNG.keys())
def test_bad_png_is_refused(tmp_path: Path, content: bytes, cause: str) -> None:
    with pytest.raises(InputError, match=rf"bad\.png: .*{cause}.*;|bad\.png: .*{cause}.*export"):
        read(put(tmp_path, content, "bad.png"), depth_unit=0.001)


@pytest.mark.parametrize("compression", [None, "tiff_lzw", "tiff_deflate", "tiff_adobe_deflate", "packbits"])
@pytest.mark.parametrize("dtype", [np.uint16, np.float32, np.int32])
def test_tiff_of_every_compression(tmp_path: Path, compression: str | None, dtype: type) -> None:
    values = made.METRES if dtype is np.float32 else made.RAW.astype(dtype)
    path = put(tmp_path, made.tiff(values, compression, pages=2))
    with siloscope.open(path, depth_unit=None if dtype is np.float32 else 0.001) as source:
        frames = list(source)
    assert len(frames) == 2
    assert all(np.array_equal(frame.depth, values) for frame in frames)


def big_endian_tiff(width: int, height: int, body: bytes) -> bytes:
    entries = [(256, 3, width << 16), (257, 3, height << 16), (258, 3, 16 << 16), (259, 3, 1 << 16), (262, 3, 1 << 16)]
    entries += [(273, 4, 8 + 2 + 8 * 12 + 4), (278, 3, height << 16), (279, 4, len(body))]
    table = b"".join(struct.pack(">HHII", tag, kind, 1, value) for tag, kind, value in entries)
    return b"MM\0*\0\0\0\x08" + struct.pack(">H", len(entries)) + table + b"\0\0\0\0" + body


def test_big_endian_tiff(tmp_path: Path) -> None:
    path = put(tmp_path, big_endian_tiff(64, 48, made.RAW.astype(">u2").tobytes()))
    assert np.array_equal(read(path, depth_unit=0.001).depth, made.RAW)


def colour_tiff() -> bytes:
    file = io.BytesIO()
    Image.fromarray(np.zeros((8, 8, 3), np.uint8)).save(file, "TIFF")
    return file.getvalue()


BAD_TIFF = {
    "colour": (colour_tiff(), "is a picture, not depth"),
    "header only": (b"II*\0", "damaged TIFF"),
    "cut": (made.tiff(made.RAW)[:2000], "damaged|TIFF"),
    "bomb": (big_endian_tiff(19_000, 5_000, b"\0" * 64), "can't hold the declared 190000000"),
    "JPEG": (made.tiff(made.LABELS, "jpeg"), "picture|JPEG|Jpeg"),
}


@pytest.mark.parametrize(("content", "cause"), BAD_TIFF.values(), ids=BAD_TIFF.keys())
def test_bad_tiff_is_refused(tmp_path: Path, content: bytes, cause: str) -> None:
    with pytest.raises(InputError, match=rf"bad\.tif: .*({cause})"):
        list(siloscope.open(put(tmp_path, content, "bad.tif"), depth_unit=0.001))
