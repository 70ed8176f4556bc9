"""Where sealed frames and results lie: a folder, or an object store by its URL."""

from __future__ import annotations

import io
from collections.abc import Hashable, Iterator
from typing import Any, Protocol

from siloscope.errors import InputError


class Missing(InputError):
    """There is no object of this name."""


class Store(Hashable, Protocol):
    """Named objects of bytes; names are relative paths with ``/``.

    Every write is whole or nothing. Methods raise `Missing` for an object that is not there and `InputError` where the
    store can't be reached or written.
    """

    place: str
    """The folder or URL, as the user gave it."""

    def get(self, name: str) -> bytes:
        """The whole object."""

    def get_range(self, name: str, start: int, length: int) -> bytes:
        """`length` bytes of the object from `start`; fewer where it ends before."""

    def get_tail(self, name: str, length: int) -> bytes:
        """The last `length` bytes of the object, or all of a shorter one."""

    def create(self, name: str, data: bytes) -> bool:
        """Writes the object if there is none of this name; whether it did. Of many that race, one wins."""

    def put(self, name: str, data: bytes) -> None:
        """Writes the object, in the place of one that may be there."""

    def exchange(self, name: str, known: str | None, data: bytes) -> bool:
        """Writes the object if its version still is `known` (None: if there is none); whether it did."""

    def version(self, name: str) -> str | None:
        """What changes with every write of the object; None where there is none."""

    def size(self, name: str) -> int | None:
        """Bytes of the object; None where there is none."""

    def names(self, prefix: str) -> Iterator[str]:
        """The names of all objects below a prefix that ends at a ``/``, in no particular order."""

    def below(self, prefix: str) -> list[str]:
        """The names, without the prefix, of what lies directly below it."""


class RangeFile(io.RawIOBase):
    """An object as a file to be read at any place, so that a Parquet reader fetches only the columns it wants."""

    def __init__(self, store: Store, name: str, size: int) -> None:
        super().__init__()
        self._store, self._name, self._size, self._at = store, name, size, 0

    def readable(self) -> bool:
        """True."""
        return True

    def seekable(self) -> bool:
        """True."""
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Moves the place where the next `read` begins."""
        base = {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._size}[whence]
        self._at = base + offset
        return self._at

    def tell(self) -> int:
        """Where the next `read` begins."""
        return self._at

    def readinto(self, buffer: Any) -> int:
        """Fills the buffer as far as the object reaches."""
        view = memoryview(buffer).cast("B")
        data = self.read(len(view))
        view[: len(data)] = data
        return len(data)

    def read(self, size: int = -1) -> bytes:
        """The next `size` bytes."""
        size = max(min(self._size - self._at, size if size >= 0 else self._size), 0)
        data = self._store.get_range(self._name, self._at, size) if size else b""
        self._at += len(data)
        return data
