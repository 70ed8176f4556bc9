"""The command line as a whole: help, exit codes, errors, JSON."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from siloscope import InputError, UsageError, __version__
from siloscope.cli import COMMANDS, Command, main, outcome


def run(*arguments: str, **options: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "siloscope", *arguments], capture_output=True, text=True, **options)


def test_version_is_the_packages(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"siloscope {__version__}\n"


def test_help_lists_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    assert "Example" in text
    for command in COMMANDS:
        assert command.name in text


def test_help_loads_no_command() -> None:
    script = (
        "import sys; from siloscope.cli import main; main(['--help']); print([m for m in sys.modules if m in (%s)])"
    )
    heavy = "'matplotlib', 'PIL', 'siloscope.cli.locate', 'siloscope.reporting.plots'"
    done = subprocess.run([sys.executable, "-c", script % heavy], capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.name)
def test_every_command_has_help_with_an_example(command: Command, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command.name, "--help"]) == 0
    text = capsys.readouterr().out
    assert "Example" in text
    assert f"siloscope {command.name}" in text
    assert "--json" in text


def test_wrong_usage_is_exit_2_and_points_to_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["locat"]) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.startswith("error: ")
    assert "--help" in shown.err
    assert main(["--no-such-option"]) == 2


@pytest.mark.parametrize(
    ("error", "code", "kind"),
    [
        (InputError("frame.png: cut off"), 3, "input"),
        (UsageError("unknown method 'x'"), 2, "usage"),
        (FileNotFoundError(2, "No such file or directory", "frame.png"), 3, "input"),
        (MemoryError(), 3, "input"),
        (KeyboardInterrupt(), 130, "interrupted"),
        (IndexError("7"), 1, "unexpected"),
    ],
)
def test_every_error_is_one_sentence_and_a_document(
    error: BaseException, code: int, kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail() -> None:
        raise error

    assert outcome.guarded(fail, ["--json"]) == code
    shown = capsys.readouterr()
    assert shown.err.startswith("error: ")
    assert len(shown.err.splitlines()) == 1
    document = json.loads(shown.out)
    assert document["schema"] == "siloscope.error/1"
    assert (document["error"], document["exit_code"]) == (kind, code)
    assert document["message"] in shown.err
    assert outcome.guarded(fail, []) == code
    assert capsys.readouterr().out == ""


def test_a_fault_shows_its_traceback_on_request(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail() -> None:
        raise IndexError("7")

    monkeypatch.setenv("SILOSCOPE_TRACEBACK", "1")
    assert outcome.guarded(fail, []) == 1
    assert "Traceback" in capsys.readouterr().err


def test_json_has_no_nan(capsys: pytest.CaptureFixture[str]) -> None:
    import numpy as np

    outcome.print_json({"a": float("nan"), "b": np.array([1.0, np.inf]), "c": (np.float32(2.0), np.int64(3))})
    assert json.loads(capsys.readouterr().out) == {"a": None, "b": [1.0, None], "c": [2.0, 3]}


def test_module_runs_like_the_command() -> None:
    done = run("--version")
    assert (done.returncode, done.stdout) == (0, f"siloscope {__version__}\n")


def test_closed_pipe_is_quiet(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def write_to_nobody() -> None:
        raise BrokenPipeError(32, "Broken pipe")

    monkeypatch.setattr(sys, "stdout", io.StringIO())
    assert outcome.guarded(write_to_nobody, ["--json"]) == outcome.BROKEN_PIPE
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("--help | true", outcome.BROKEN_PIPE),
        ("locate missing.png --json 2> /dev/null | true", 3),
        ("locate missing.png --json 2> /dev/null > /dev/full", 3),
        ("locate missing.png 2> /dev/full", 3),
        ("--version >&-", 0),
        ("locate missing.png --json 2>&-", 3),
    ],
)
def test_streams_that_nobody_reads_cost_no_traceback(line: str, code: int) -> None:
    script = f"set -o pipefail; {sys.executable} -m siloscope {line}"
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (code, "")
    assert not done.stdout or json.loads(done.stdout)["exit_code"] == code


@pytest.fixture
def interruptible() -> Iterator[None]:
    """Where the tests run in the background, interruptions are ignored, here and in every process started from here."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interruptible")
def test_an_interruption_is_told_like_every_error(tmp_path: Path) -> None:
    arguments = ["simulate", "--steps", "100000", "--out", str(tmp_path / "frames"), "--json"]
    words = [sys.executable, "-m", "siloscope", *arguments]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as running:
        while running.poll() is None and not any(tmp_path.iterdir()):
            time.sleep(0.01)
        running.send_signal(signal.SIGINT)
        try:
            out, err = running.communicate(timeout=60)
        finally:
            running.kill()
    assert (running.returncode, err) == (outcome.INTERRUPTED, "error: interrupted\n")
    assert json.loads(out)["error"] == "interrupted"
    assert not any(tmp_path.iterdir())


def test_an_interruption_while_a_module_is_imported_ends_with_the_same_code(tmp_path: Path) -> None:
    (tmp_path / "interrupted.py").write_text(
        "import sys\n"
        "from siloscope.cli import outcome\n"
        "sys.exit(outcome.guarded(lambda: exec('raise KeyboardInterrupt'), []))\n"
    )
    words = [sys.executable, "-m", "interrupted"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (outcome.INTERRUPTED, "error: interrupted\n")


def test_no_command_is_listed_twice() -> None:
    assert len({command.name for command in COMMANDS}) == len(COMMANDS)


def test_output_survives_a_terminal_without_its_letters() -> None:
    done = run("locate", "--help", env={**os.environ, "PYTHONIOENCODING": "ascii", "NO_COLOR": "1"})
    assert (done.returncode, done.stderr) == (0, "")


def test_warnings_are_one_line_without_source(capsys: pytest.CaptureFixture[str]) -> None:
    assert outcome.guarded(lambda: warnings.warn("the frame is dark", stacklevel=1), []) == 0
    assert capsys.readouterr().err == "warning: the frame is dark\n"
