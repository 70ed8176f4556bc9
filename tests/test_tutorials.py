"""The tutorials are run as a reader would: commands and Python in the order in which they are printed."""

from __future__ import annotations

import contextlib
import re
import shlex
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from siloscope.cli import main

PAGES = sorted((Path(__file__).parents[1] / "docs" / "tutorials").glob("*.md"))
BLOCK = re.compile(r"^```(bash|python|toml)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
NAMED = re.compile(r"`([\w-]+\.toml)`:\s*$")
ADDRESS = "127.0.0.1:8480"
"""The service's, in the text; a free port takes its place."""


@pytest.fixture
def background() -> Iterator[list[subprocess.Popen[bytes]]]:
    """Commands that end in "&": stopped with the page."""
    running: list[subprocess.Popen[bytes]] = []
    yield running
    for process in running:
        process.terminate()
        process.wait(30)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_tutorial_works(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, background: list[subprocess.Popen[bytes]]
) -> None:
    monkeypatch.chdir(tmp_path)
    text = page.read_text("utf-8").replace(ADDRESS, free_address())
    blocks = list(BLOCK.finditer(text))
    assert {block[1] for block in blocks} >= {"bash", "python"}
    for block in blocks:
        run(block[1], block[2], text[: block.start()], background)


def free_address() -> str:
    """Of this machine, with a port that is free."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        return f"127.0.0.1:{taken.getsockname()[1]}"


def run(language: str, code: str, before: str, background: list[subprocess.Popen[bytes]]) -> None:
    """A TOML block is the file that the sentence before it names."""
    if language == "toml":
        (name,) = NAMED.findall(before.rstrip())
        Path(name).write_text(code, "utf-8")
    elif language == "python":
        exec(compile(code, "tutorial", "exec"), {})
    else:
        for line in code.splitlines():
            words = shlex.split(line, comments=True)
            assert words[0] == "siloscope"
            command(words[1:], line, background)


def command(words: list[str], line: str, background: list[subprocess.Popen[bytes]]) -> None:
    """Runs a command, in the background where it ends in "&", into a file where it says so."""
    if words[-1] == "&":
        background.append(subprocess.Popen([sys.executable, "-m", "siloscope", *words[:-1]]))
    elif len(words) > 2 and words[-2] == ">":
        with Path(words[-1]).open("w", encoding="utf-8") as file, contextlib.redirect_stdout(file):
            assert main(words[:-2]) == 0, line
    else:
        assert main(words) == 0, line
