"""NumPy's array layout, read piece by piece; what a header declares is checked against the bytes there are."""

from __future__ import annotations

import io
import math
import warnings
from dataclasses import dataclass
from functools import lru_cache
from typing import IO, Any

import numpy as np
from numpy.lib import format as layout
from numpy.typing import NDArray

from siloscope.errors import InputError

MAGIC = layout.MAGIC_PREFIX
_LONGEST_HEADER = 10_000
_MOST_SIDES = 8
_NUMBERS = {"f": (2, 4, 8), "i": (1, 2, 4, 8), "u": (1, 2, 4, 8)}


@dataclass(frozen=True)
class StoredArray:
    """An array in an open file, not read yet."""

    file: IO[bytes]
    name: str
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    fortran: bool
    offset: int
    """Where the values start."""
    size: int
    """Bytes of values that are really there."""

    @property
    def nbytes(self) -> int:
        """Bytes of values that the header declares."""
        return math.prod(self.shape) * self.dtype.itemsize

    def whole(self) -> NDArray[Any]:
        """All values, in native byte order; raises `InputError` where the file breaks off."""
        if self.nbytes > self.size:
            raise InputError(
                f"{self.name}: the array is declared {self.shape} {self.dtype} ({self.nbytes} bytes) but the file has "
                f"{max(self.size, 0)}; it was cut off, save it again"
            )
        flat = self._values(0, math.prod(self.shape))
        return flat.reshape(self.shape, order="F" if self.fortran else "C")

    def part(self, index: int) -> NDArray[Any]:
        """``array[index]`` of a C-ordered array, alone."""
        count = math.prod(self.shape[1:])
        return self._values(index * count, count).reshape(self.shape[1:])

    def parts_there(self) -> int:
        """How many of the ``shape[0]`` parts are whole in the file; all or none in Fortran's order."""
        if self.fortran:
            return self.shape[0] if self.nbytes <= self.size else 0
        each = math.prod(self.shape[1:]) * self.dtype.itemsize
        return min(self.shape[0], max(self.size, 0) // each) if each else 0

    def _values(self, first: int, count: int) -> NDArray[Any]:
        try:
            self.file.seek(self.offset + first * self.dtype.itemsize)
            data = self.file.read(count * self.dtype.itemsize)
        except (
            Exception
        ) as error:  # a damaged zip member fails in zipfile, zlib or the file system, each in its own way
            raise InputError(f"{self.name}: can't be decompressed ({error}); save it again") from None
        if len(data) != count * self.dtype.itemsize:
            raise InputError(f"{self.name}: breaks off in the values; save it again")
        return np.frombuffer(data, self.dtype).astype(self.dtype.newbyteorder("="), copy=False)


def stored_array(file: IO[bytes], name: str, size: int, *, text: bool = False) -> StoredArray:
    """Reads the header of an array file of `size` bytes.

    Raises `InputError` for objects (which would run code when read), structures and other dtypes that are no
    numbers; `text` also allows strings.
    """
    shape, fortran, dtype, offset = _header(file, name)
    if offset > size or len(shape) > _MOST_SIDES or any(side < 0 for side in shape):
        raise _damaged(name)
    _check_type(name, dtype, text)
    return StoredArray(file, name, shape, dtype, fortran, offset, size - offset)


def _header(file: IO[bytes], name: str) -> tuple[tuple[int, ...], bool, np.dtype[Any], int]:
    """Shape, whether in Fortran's order, type, and where the values start."""
    try:
        start = file.read(_LONGEST_HEADER)
    except Exception as error:  # as above
        raise InputError(f"{name}: can't be decompressed ({error}); save it again") from None
    first = 10 if start[6:7] == b"\x01" else 12
    offset = first + int.from_bytes(start[8:first], "little")
    try:
        return *_parsed(start[:offset]), offset
    except Exception:  # the header is a Python literal: damage fails in the tokenizer, the parser or the type's name
        raise _damaged(name) from None


@lru_cache(maxsize=64)
def _parsed(header: bytes) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """What NumPy reads in a header; the frames of a folder have the same one."""
    file = io.BytesIO(header)
    old = layout.read_magic(file) == (1, 0)
    read = layout.read_array_header_1_0 if old else layout.read_array_header_2_0
    with warnings.catch_warnings(action="ignore"):
        shape, fortran, dtype = read(file, max_header_size=_LONGEST_HEADER)
    return shape, fortran, dtype


def _damaged(name: str) -> InputError:
    return InputError(f"{name}: the array's header is damaged; save it again with numpy.save")


def _check_type(name: str, dtype: np.dtype[Any], text: bool) -> None:
    if dtype.hasobject or dtype.kind == "V":
        raise InputError(
            f"{name}: holds Python objects or structures, which are not read (they can run code); "
            "save a plain array of numbers: numpy.save(file, depth.astype('float32'))"
        )
    if text and dtype.kind == "U" and dtype.itemsize:
        return
    if dtype.itemsize not in _NUMBERS.get(dtype.kind, ()):
        kind = dtype.str.lstrip("<>|=")
        raise InputError(f"{name}: values of type '{kind}' are no depths; save uint16 raw units or float32 metres")
