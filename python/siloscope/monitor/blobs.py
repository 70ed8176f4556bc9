"""Frames' bytes under their hash: written, flushed, renamed, and the folder flushed, before anybody relies on them."""

from __future__ import annotations

import contextlib
import hashlib
import os
import secrets
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

DIRECTORIES = 256


@dataclass
class Part:
    """A file that is being received."""

    path: Path
    file: int
    size: int = 0
    format: str = ""

    def __post_init__(self) -> None:
        self._hash = hashlib.sha256()

    def add(self, chunk: bytes) -> None:
        """Appends bytes."""
        view = memoryview(chunk)
        while view:
            view = view[os.write(self.file, view) :]
        self._hash.update(chunk)
        self.size += len(chunk)

    @property
    def sha256(self) -> str:
        """Of what has come so far."""
        return self._hash.hexdigest()


class Blobs:
    """A folder of files by hash: ``ab/ab12…``; the 256 folders are there from the beginning."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._incoming = folder / "incoming"
        self._incoming.mkdir(parents=True, exist_ok=True)
        for number in range(DIRECTORIES):
            (folder / f"{number:02x}").mkdir(exist_ok=True)
        flush(folder)
        flush(folder.parent)

    def path(self, sha256: str) -> Path:
        """Where the bytes of a hash lie."""
        return self.folder / sha256[:2] / sha256

    @contextlib.contextmanager
    def receiving(self) -> Iterator[Part]:
        """A new part, removed at the end unless it was kept."""
        path = self._incoming / secrets.token_hex(16)
        part = Part(path, os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o640))
        try:
            yield part
        finally:
            os.close(part.file)
            path.unlink(missing_ok=True)

    def keep(self, part: Part) -> Path:
        """Puts a received file in its place; it is on the disk when this returns.

        Bytes that are already there are flushed anew: whoever wrote them may not have come so far.
        """
        os.fsync(part.file)
        place = self.path(part.sha256)
        os.replace(part.path, place)
        flush(place.parent)
        return place

    def remove(self, sha256: str) -> None:
        """Deletes bytes; none is no error."""
        self.path(sha256).unlink(missing_ok=True)

    def intact(self, sha256: str) -> bool:
        """Whether the bytes are there and hash to their name."""
        try:
            with self.path(sha256).open("rb") as file:
                return hashlib.file_digest(file, "sha256").hexdigest() == sha256
        except OSError:
            return False

    def sweep(self) -> int:
        """Removes what an interrupted receipt has left; how many files."""
        stray = list(self._incoming.iterdir())
        for path in stray:
            path.unlink(missing_ok=True)
        return len(stray)

    def hashes(self) -> Iterator[str]:
        """All hashes that are there."""
        for number in range(DIRECTORIES):
            yield from (entry.name for entry in os.scandir(self.folder / f"{number:02x}"))

    def free(self) -> tuple[int, int]:
        """Free and total bytes of the disk, for one who is not root."""
        found = os.statvfs(self.folder)
        return found.f_bavail * found.f_frsize, found.f_blocks * found.f_frsize


def flush(folder: Path) -> None:
    """Makes a folder's entries survive a power cut."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def copy(source: Path, target: Path) -> None:
    """A copy that is on the disk when this returns."""
    shutil.copyfile(source, target)
    with target.open("rb") as file:
        os.fsync(file.fileno())
