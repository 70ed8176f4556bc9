"""A folder as a store: create-only by hard links, exchanges under a lock, every write on disk before it counts."""

from __future__ import annotations

import fcntl
import hashlib
import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from siloscope.errors import InputError
from siloscope.fleet.store import Missing

_LOCK = ".lock"


class FolderStore:
    """A store in a folder, for one machine or many over a shared file system; see `siloscope.fleet.store.Store`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.place = str(folder)

    def get(self, name: str) -> bytes:
        """The whole object."""
        with self._opened(name) as file:
            return _read_at(file, 0, os.fstat(file).st_size)

    def get_range(self, name: str, start: int, length: int) -> bytes:
        """`length` bytes from `start`."""
        with self._opened(name) as file:
            return _read_at(file, start, length)

    def get_tail(self, name: str, length: int) -> bytes:
        """The last `length` bytes."""
        with self._opened(name) as file:
            size = os.fstat(file).st_size
            return _read_at(file, max(size - length, 0), min(length, size))

    def create(self, name: str, data: bytes) -> bool:
        """Links the written file to its name, which fails where the name is taken."""
        path = self._path(name)
        with self._written(path, data) as beside:
            try:
                os.link(beside, path)
            except FileExistsError:
                return False
            _sync_folder(path.parent)
        return True

    def put(self, name: str, data: bytes) -> None:
        """Renames the written file to its name."""
        path = self._path(name)
        with self._written(path, data) as beside:
            os.replace(beside, path)
            _sync_folder(path.parent)

    def exchange(self, name: str, known: str | None, data: bytes) -> bool:
        """Compares and renames under a lock on the folder."""
        with self.locked(name):
            if self.version(name) != known:
                return False
            self.put(name, data)
        return True

    def version(self, name: str) -> str | None:
        """The hash of its bytes."""
        try:
            with self._opened(name) as file:
                digest = hashlib.sha256()
                while block := os.read(file, 1 << 20):
                    digest.update(block)
        except Missing:
            return None
        return digest.hexdigest()

    def size(self, name: str) -> int | None:
        """Bytes of the file."""
        try:
            return self._path(name).stat().st_size
        except FileNotFoundError:
            return None

    def names(self, prefix: str) -> Iterator[str]:
        """All files below a folder but the unfinished."""
        top = self.folder / prefix
        for folder, _, files in os.walk(top):
            inside = Path(folder).relative_to(self.folder).as_posix()
            start = "" if inside == "." else f"{inside}/"
            yield from (f"{start}{file}" for file in files if not file.startswith("."))

    def below(self, prefix: str) -> list[str]:
        """Names of files and folders directly below."""
        try:
            with os.scandir(self.folder / prefix) as entries:
                return [entry.name for entry in entries if not entry.name.startswith(".")]
        except (FileNotFoundError, NotADirectoryError):
            return []

    @contextmanager
    def locked(self, name: str) -> Iterator[None]:
        """Holds the lock of a name's folder; it falls with the process."""
        folder = self._path(name).parent
        _make(folder)
        lock = os.open(folder / _LOCK, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX)
            yield
        finally:
            os.close(lock)

    def _path(self, name: str) -> Path:
        return self.folder / name

    @contextmanager
    def _opened(self, name: str) -> Iterator[int]:
        path = self._path(name)
        try:
            file = os.open(path, os.O_RDONLY)
        except FileNotFoundError:
            raise Missing(f"{path}: no such file; check the place") from None
        except OSError as error:
            raise InputError(f"{path}: can't be read ({error.strerror}); check its permissions") from None
        try:
            yield file
        except OSError as error:
            raise InputError(f"{path}: can't be read ({error.strerror}); check the disk") from None
        finally:
            os.close(file)

    @contextmanager
    def _written(self, path: Path, data: bytes) -> Iterator[Path]:
        """A complete file beside the path, gone again at the end where nobody renamed it."""
        _make(path.parent)
        beside = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
        try:
            with beside.open("wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            yield beside
        except OSError as error:
            raise InputError(
                f"{path}: can't be written ({error.strerror}); free the disk or name another place"
            ) from None
        finally:
            beside.unlink(missing_ok=True)


_ONE_READ = 1 << 30
"""A single read gives at most 2 GiB on Linux."""


def _read_at(file: int, start: int, length: int) -> bytes:
    parts = []
    while length > 0 and (part := os.pread(file, min(length, _ONE_READ), start)):
        parts.append(part)
        start, length = start + len(part), length - len(part)
    return parts[0] if len(parts) == 1 else b"".join(parts)


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: can't be made ({error.strerror}); name another place") from None


def _sync_folder(folder: Path) -> None:
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
