"""How a command ends: its exit code, the one line on stderr, and the JSON document where one was asked for."""

from __future__ import annotations

import contextlib
import io
import os
import sys
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import typer

from siloscope.errors import SiloscopeError, UsageError, naming_options

REFUSED = 4
"""Read well, but the frame does not show enough wall."""
PARTIAL = 5
"""Some frames of several failed."""
INTERRUPTED = 130
BROKEN_PIPE = 141


def guarded(run: Callable[[], Any], arguments: Sequence[str]) -> int:
    """Exit code of a command; whatever it raises becomes one sentence on stderr, never a traceback."""
    _make_streams_safe()
    as_json = "--json" in arguments
    try:
        with _plain_warnings(), naming_options():
            code = run() or 0
            if code == INTERRUPTED:  # typer has caught the interruption and says no more than its code
                raise KeyboardInterrupt
            sys.stdout.flush()
            return int(code)
    except BrokenPipeError:
        _silence_stdout()
        return BROKEN_PIPE
    except SystemExit as ended:  # shell completion ends so, and rich, with code 1, where it finds the pipe closed
        return BROKEN_PIPE if ended.code == 1 else int(ended.code or 0)
    except (KeyboardInterrupt, typer.Abort):
        _forget_where_it_was()
        return _report("interrupted", "interrupted", INTERRUPTED, as_json)
    except SiloscopeError as error:
        with naming_options():
            return _report(_kind(error), str(error), error.exit_code, as_json)
    except typer.TyperException as error:
        return _report("usage", _usage_sentence(error), 2, as_json)
    except MemoryError:
        return _report("input", "not enough memory for this input; crop it or use a coarser --grid", 3, as_json)
    except OSError as error:
        return _report("input", _file_sentence(error), 3, as_json)
    except Exception as error:
        return _report("unexpected", _unexpected_sentence(error), 1, as_json)


def _forget_where_it_was() -> None:
    """Lets the process end with its own exit code.

    Where an interruption comes inside an ``exec``, as dataclasses need when a module is imported, ``python -m`` ends by
    the signal although it was caught. The next ``exec`` makes it forget that.
    """
    exec("")


def print_json(document: Any) -> None:
    """Print the one JSON document of a command; NaN and infinities become null."""
    from siloscope.schema import documents

    print(documents.text(document, 2))


def check_place(file: Path) -> None:
    """Refuses a place where no file can be written, before hours of work end there."""
    folder = file.parent
    cause = "it is a folder" if file.is_dir() else None if folder.is_dir() else f"there is no folder {folder}"
    if cause is None and not os.access(folder, os.W_OK):
        cause = f"{folder} is not writable"
    if cause is not None:
        raise UsageError(f"{file}: cannot be written ({cause}); name another place")


@contextlib.contextmanager
def writing(path: object) -> Iterator[None]:
    """Turns a failure to write below `path` into a usage error that names it."""
    try:
        yield
    except OSError as error:
        raise UsageError(f"{path}: cannot be written ({error.strerror or error}); name another place") from None


def _report(kind: str, message: str, code: int, as_json: bool) -> int:
    with contextlib.suppress(OSError):  # a full disk behind stderr does not change how the command ends
        print(f"error: {message}", file=sys.stderr, flush=True)
    try:
        if as_json:
            print_json({"schema": "siloscope.error/1", "error": kind, "message": message, "exit_code": code})
        sys.stdout.flush()
    except OSError:
        _silence_stdout()
    return code


def _make_streams_safe() -> None:
    """A terminal that can't show "±" gets "?" instead of a crash; a closed stream swallows what it is given."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, io.StringIO())
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")


def _kind(error: SiloscopeError) -> str:
    return {2: "usage", 3: "input", 4: "refused", 5: "partial"}.get(error.exit_code, "unexpected")


def _usage_sentence(error: typer.TyperException) -> str:
    context = getattr(error, "ctx", None)
    command = context.command_path if context else "siloscope"
    sentence = error.format_message().strip().rstrip(".")
    return f"{sentence[:1].lower()}{sentence[1:]}; see '{command} --help'"


def _file_sentence(error: OSError) -> str:
    name = f"{error.filename}: " if error.filename else ""
    return f"{name}{error.strerror or error}; check the path and its permissions"


def _unexpected_sentence(error: Exception) -> str:
    if os.environ.get("SILOSCOPE_TRACEBACK"):
        traceback.print_exc()
    text = " ".join(str(error).split())[:200]
    return (
        f"unexpected {type(error).__name__}: {text}; this is a fault of siloscope, "
        "set SILOSCOPE_TRACEBACK=1 to see where and please report it"
    )


@contextlib.contextmanager
def _plain_warnings() -> Iterator[None]:
    """Warnings as one line on stderr, without the source line Python adds."""
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_args, **_kwargs: print(f"warning: {message}", file=sys.stderr)
        yield


def _silence_stdout() -> None:
    """Keeps the interpreter from complaining about the closed pipe when it flushes at exit."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
