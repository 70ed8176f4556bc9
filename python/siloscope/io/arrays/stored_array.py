"""NumPy's array layout, read piece by piece; what a header declares is checked against the bytes there are."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError

MAGIC = b"\x93NUMPY"
_LONGEST_HEADER = 10_000
_DTYPE = re.compile(r"'descr'\s*:\s*'([<>|=]?)([a-zA-Z])(\d+)'")
_ORDER = re.compile(r"'fortran_order'\s*:\s*(True|False)")
_SHAPE = re.compile(r"'shape'\s*:\s*\(((?: *\d{1,20} *(?:,|(?=\)))){0,8} *)\)", re.ASCII)
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
    header, offset = _header(file, name, size)
    order, shape = _ORDER.search(header), _SHAPE.search(header)
    if order is None or shape is None:
        raise _damaged(name)
    sides = tuple(int(side) for side in shape[1].split(",") if side.strip(" "))
    dtype = _dtype(name, header, text)
    return StoredArray(file, name, sides, dtype, order[1] == "True", offset, size - offset)


def _header(file: IO[bytes], name: str, size: int) -> tuple[str, int]:
    """The header's text and where the values start."""
    try:
        start = file.read(_LONGEST_HEADER)
    except Exception as error:  # as above
        raise InputError(f"{name}: can't be decompressed ({error}); save it again") from None
    first = 10 if start[6:7] == b"\x01" else 12
    offset = first + int.from_bytes(start[8:first], "little")
    if not start.startswith(MAGIC) or len(start) < first or offset > min(size, _LONGEST_HEADER):
        raise _damaged(name)
    return start[first:offset].decode("latin-1"), offset


def _damaged(name: str) -> InputError:
    return InputError(f"{name}: the array's header is damaged; save it again with numpy.save")


def _dtype(name: str, header: str, text: bool) -> np.dtype[Any]:
    found = _DTYPE.search(header)
    if found and text and found[2] == "U":
        return np.dtype(f"{found[1]}U{found[3]}")
    if found is None or found[2] == "O":
        raise InputError(
            f"{name}: holds Python objects or structures, which are not read (they can run code); "
            "save a plain array of numbers: numpy.save(file, depth.astype('float32'))"
        )
    if int(found[3]) not in _NUMBERS.get(found[2], ()):
        raise InputError(
            f"{name}: values of type '{found[2]}{found[3]}' are no depths; save uint16 raw units or float32 metres"
        )
    return np.dtype("".join(found.groups()))
