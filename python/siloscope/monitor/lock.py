"""Who uses a data folder: with SQLite one service; with PostgreSQL several, of which the first one tidies up.

The system drops the lock with the process that holds it.
"""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

from siloscope.errors import UsageError


class Lock:
    """Held from making to release; raises `UsageError` where another service has it and it is not `shared`."""

    def __init__(self, path: Path, *, shared: bool = False) -> None:
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o640)
        self.alone = self._try(fcntl.LOCK_EX)
        """Whether no other service was on the folder when it was taken."""
        if not (self.alone or (shared and self._try(fcntl.LOCK_SH))):
            os.close(self._file)
            raise UsageError(f"{path.parent}: another service runs on this folder; stop it first") from None
        self._shared = shared

    def _try(self, kind: int) -> bool:
        try:
            fcntl.flock(self._file, kind | fcntl.LOCK_NB)
        except OSError:
            return False
        return True

    def share(self) -> None:
        """Lets others in, where they may be: what only one may do at the start is done."""
        if self._shared:
            fcntl.flock(self._file, fcntl.LOCK_SH)

    def release(self) -> None:
        """Lets others have it."""
        os.close(self._file)
