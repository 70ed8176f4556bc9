"""A folder into which another program writes files: which of them are complete."""

from __future__ import annotations

import time
from pathlib import Path

QUIET_S = 2.0
"""A file that was written so recently may still be growing, s."""


def files_in(folder: Path) -> list[Path]:
    """Files of a folder, the oldest first; names with a dot before them are not finished."""
    found = [(path.stat().st_mtime, path) for path in folder.iterdir() if path.name[0] != "." and path.is_file()]
    return [path for _, path in sorted(found)]


class WatchedFolder:
    """Gives each complete file once, and again when it was written anew."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._given: dict[Path, int] = {}

    def complete(self) -> list[Path]:
        """Files that are complete and were not given yet, the oldest first; raises `OSError` without the folder."""
        there = files_in(self.folder)
        written = {path: path.stat().st_mtime_ns for path in there}
        self._given = {path: stamp for path, stamp in self._given.items() if path in written}
        quiet = time.time() - QUIET_S
        return [path for path in there if self._given.get(path) != written[path] and written[path] / 1e9 < quiet]

    def give(self, path: Path) -> None:
        """Notes that a file was dealt with."""
        self._given[path] = path.stat().st_mtime_ns
