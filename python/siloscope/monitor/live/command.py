"""A command that takes a frame each time it runs: its standard output, or the file that it writes."""

from __future__ import annotations

import contextlib
import os
import shlex
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from siloscope.errors import InputError, UsageError
from siloscope.monitor.live.captures import Capture

LONGEST_S = 60.0
"""A command that takes longer is ended."""

LOOK_S = 0.05
"""How often a running command is looked at."""

FILE = "{file}"
"""In the command's words: the path of the file to write, to which an ending such as ``.png`` may be added."""

TOLD = 300
"""Characters of what a failed command said that are repeated."""


class CommandSource:
    """Runs a command, without a shell, in a group of processes of its own.

    Parameters
    ----------
    line : str
        The command as a shell would split it into words.
    folder : Path
        Where it runs.
    largest : int
        Bytes of the largest frame.
    """

    poll_s: float | None = None

    def __init__(self, line: str, folder: Path, largest: int) -> None:
        try:
            self._words = shlex.split(line)
        except ValueError as error:
            raise UsageError(f"command '{line}': {error}; close its quotation marks") from None
        if not self._words:
            raise UsageError("command: says no command; give one such as command:curl -sf http://camera/depth.png")
        self._folder, self._largest = folder, largest

    def captures(self, _wanted_s: float, stopped: Callable[[], bool]) -> Iterator[Capture]:
        """One frame."""
        with TemporaryDirectory(prefix="siloscope-live-") as name:
            room = Path(name)
            (room / "out").mkdir()
            if self._ran(room, stopped):
                yield Capture(self._body(room), name=f"what {self._words[0]} wrote")

    def _ran(self, room: Path, stopped: Callable[[], bool]) -> bool:
        """Whether it ran to its end; raises `InputError` where it failed."""
        words = [word.replace(FILE, str(room / "out" / "frame")) for word in self._words]
        with (room / "stdout").open("wb") as out, (room / "stderr").open("wb") as err:
            try:
                process = subprocess.Popen(
                    words, stdin=subprocess.DEVNULL, stdout=out, stderr=err, cwd=self._folder, start_new_session=True
                )
            except OSError as error:
                raise InputError(f"{words[0]}: {error.strerror}; check the command and its path") from None
            try:
                return self._waited(process, room, stopped)
            finally:
                _end(process)

    def _waited(self, process: subprocess.Popen[bytes], room: Path, stopped: Callable[[], bool]) -> bool:
        end = time.monotonic() + LONGEST_S
        while process.poll() is None:
            if stopped():
                return False
            if time.monotonic() > end:
                raise InputError(f"{self._words[0]}: took longer than {LONGEST_S:g} s and was ended")
            if max((room / "stdout").stat().st_size, (room / "stderr").stat().st_size) > self._largest:
                raise InputError(f"{self._words[0]}: wrote more than {self._largest} bytes and was ended")
            time.sleep(LOOK_S)
        if process.returncode:
            raise InputError(f"{self._words[0]}: {_how(process.returncode)}{_said(room / 'stderr')}")
        return True

    def _body(self, room: Path) -> bytes:
        written = [*(room / "out").iterdir(), room / "stdout"][0]
        with written.open("rb") as file:
            body = file.read(self._largest + 1)
        if not body:
            raise InputError(f"{self._words[0]}: wrote no frame; it has to write one to its output, or to {FILE}")
        return body

    def close(self) -> None:
        """Holds nothing."""


def _end(process: subprocess.Popen[bytes]) -> None:
    """Ends a command and what it has started."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _how(code: int) -> str:
    return f"was ended by signal {-code}" if code < 0 else f"ended with exit code {code}"


def _said(path: Path) -> str:
    with path.open("rb") as file:
        lines = file.read(1 << 16).decode(errors="replace").split("\n")
    last = next((line.strip() for line in reversed(lines) if line.strip()), "")
    return f" ({last[:TOLD]})" if last else ""
