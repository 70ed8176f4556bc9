"""The package's exceptions; every one carries the exit code that the command line gives for it."""

from __future__ import annotations


class SiloscopeError(Exception):
    """Base of all errors raised by siloscope."""

    exit_code = 1


class UsageError(SiloscopeError, ValueError):
    """A call or command line that can't be right: an unknown name, a setting outside its bounds (exit code 2)."""

    exit_code = 2


class InputError(SiloscopeError, ValueError):
    """Input that can't be used (exit code 3).

    The message names the file or argument, the frame where there are several, the cause and the remedy.
    """

    exit_code = 3
