"""The tutorials are run as a reader would: commands and Python in the order in which they are printed."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from siloscope.cli import main

PAGES = sorted((Path(__file__).parents[1] / "docs" / "tutorials").glob("*.md"))
BLOCK = re.compile(r"^```(bash|python|toml)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
NAMED = re.compile(r"`([\w-]+\.toml)`:\s*$")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_tutorial_works(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = page.read_text("utf-8")
    blocks = list(BLOCK.finditer(text))
    assert {block[1] for block in blocks} >= {"bash", "python"}
    for block in blocks:
        run(block[1], block[2], text[: block.start()])


def run(language: str, code: str, before: str) -> None:
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
            assert main(words[1:]) == 0, line
