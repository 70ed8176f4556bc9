"""A folder into which a camera's program, or the camera itself by FTP, writes files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from siloscope.errors import InputError
from siloscope.io.watched import WatchedFolder
from siloscope.monitor.clock import SECOND
from siloscope.monitor.live.captures import Capture
from siloscope.tracking.clock import time_in_name


class FolderSource:
    """Complete files, the oldest first. A file's time is that in its name, else its own.

    Parameters
    ----------
    folder : Path
    largest : int
        Bytes of the largest file that is read.
    removes : bool
        Whether a file is deleted once the service has it; else it stays, and is known again after a restart.
    """

    poll_s: float | None = 1.0

    def __init__(self, folder: Path, largest: int, *, removes: bool) -> None:
        self._watched, self._largest, self._removes = WatchedFolder(folder), largest, removes

    def captures(self, _wanted_s: float, stopped: Callable[[], bool]) -> Iterator[Capture]:
        """The files that are new."""
        try:
            paths = self._watched.complete()
        except OSError as error:
            raise InputError(f"{self._watched.folder}: {error.strerror}; give a folder that is there") from None
        for path in paths:
            if stopped():
                return
            yield self._capture(path)

    def _capture(self, path: Path) -> Capture:
        named = time_in_name(path.name)
        seconds = path.stat().st_mtime if named is None else named
        with path.open("rb") as file:
            body = file.read(self._largest + 1)
        given = partial(self._watched.give, path)
        return Capture(body, int(seconds * SECOND), path.name, path.unlink if self._removes else given, given)

    def close(self) -> None:
        """Holds nothing."""
