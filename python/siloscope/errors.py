"""The package's exceptions; every one carries the exit code that the command line gives for it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

_OTHERS = "compression-mode|export_depth_images"
"""Options of other programs that messages name; they stay as they are."""

_OPTION = re.compile(rf"--(?!{_OTHERS})([a-z][a-z-]*)(?: (?:FILE|NAME|DIR|FRAME|KIND|M)\b)?")


class _Speech:
    """Whether messages name the command line's options, or the arguments of functions."""

    options = False


@contextmanager
def naming_options() -> Iterator[None]:
    """Messages name options while a command runs: ``--depth-unit`` where Python has ``depth_unit``."""
    before, _Speech.options = _Speech.options, True
    try:
        yield
    finally:
        _Speech.options = before


class SiloscopeError(Exception):
    """Base of all errors raised by siloscope."""

    exit_code = 1

    def __str__(self) -> str:
        text = super().__str__()
        return text if _Speech.options else _OPTION.sub(lambda found: found[1].replace("-", "_"), text)


class UsageError(SiloscopeError, ValueError):
    """A call or command line that can't be right: an unknown name, a setting outside its bounds (exit code 2)."""

    exit_code = 2


class InputError(SiloscopeError, ValueError):
    """Input that can't be used (exit code 3).

    The message names the file or argument, the frame where there are several, the cause and the remedy.
    """

    exit_code = 3
