"""One service a folder: the system drops the lock with the process that holds it."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

from siloscope.errors import UsageError


class Lock:
    """Held from making to release; raises `UsageError` where another service has it."""

    def __init__(self, path: Path) -> None:
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o640)
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(self._file)
            raise UsageError(f"{path.parent}: another service runs on this folder; stop it first") from None

    def release(self) -> None:
        """Lets others have it."""
        os.close(self._file)
