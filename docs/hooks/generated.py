"""Fills the parts of pages that come from the program itself, so that they can't go out of date."""

from __future__ import annotations

import contextlib
import io
import os
import re
from collections.abc import Callable
from typing import Any

_PLACE = re.compile(r"<!-- generated: (\w+) -->")


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Called by mkdocs with each page's source; replaces ``<!-- generated: NAME -->``."""
    return _PLACE.sub(lambda found: _PARTS[found[1]](), markdown)


def on_page_content(html: str, **_: Any) -> str:
    """Called by mkdocs with each page's HTML: links that lead from the repository's root into docs/ stay in docs/."""
    return re.sub(r'href="docs/([^"]+?)\.md"', r'href="\1.html"', html)


def commands() -> str:
    """The help text of every command."""
    from siloscope.cli import COMMANDS

    return "\n\n".join(f"## {command.name}\n\n{command.help}\n\n{_help(command.name)}" for command in COMMANDS)


def _help(command: str) -> str:
    from siloscope.cli import main

    os.environ.update(NO_COLOR="1", COLUMNS="100", TERMINAL_WIDTH="100")
    shown = io.StringIO()
    with contextlib.redirect_stdout(shown):
        main([command, "--help"])
    lines = [line.rstrip() for line in shown.getvalue().strip("\n").splitlines()]
    return "```text\n" + "\n".join(lines) + "\n```"


def reasons() -> str:
    """Every reason for which a frame is refused."""
    from siloscope.surface import reasons as known

    rows = [f"| `{slug}` | {meaning} | {advice} |" for slug, (meaning, advice) in known().items()]
    return "\n".join(["| reason | what it means | what to try |", "|---|---|---|", *rows])


def sensors() -> str:
    """Every sensor profile that comes with siloscope."""
    from siloscope.sensors import load, names

    rows = [f"| `{name}` | {load(name).source} |" for name in names()]
    return "\n".join(["| name | where its figures come from |", "|---|---|", *rows])


_PARTS: dict[str, Callable[[], str]] = {"commands": commands, "reasons": reasons, "sensors": sensors}
