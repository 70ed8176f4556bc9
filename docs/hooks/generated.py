"""Fills the parts of pages that come from the program itself, so that they can't go out of date."""

from __future__ import annotations

import contextlib
import io
import os
import re
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
_PLACE = re.compile(r"<!-- generated: (\w+) -->")
_VALUE = re.compile(r"\{\{ ([\w.]+) \}\}")


def _constant(module: str, name: str) -> str:
    """A setting's value as the program has it."""
    return str(getattr(import_module(f"siloscope.{module}"), name))


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Called by mkdocs with each page's source; fills ``<!-- generated: NAME -->`` and ``{{ module.CONSTANT }}``."""
    filled = _PLACE.sub(lambda found: _PARTS[found[1]](), markdown)
    return _VALUE.sub(lambda found: _constant(*found[1].rsplit(".", 1)), filled)


def commands() -> str:
    """The help text of every command."""
    from siloscope.cli import COMMANDS

    parts = []
    for command in COMMANDS:
        parts.append(f"## {command.name}\n\n{command.help}\n\n{_help(command.name)}")
        parts += [f"### {command.name} {name}\n\n{_help(command.name, name)}" for name in _below(command)]
    return "\n\n".join(parts)


def _below(command: Any) -> list[str]:
    """The names of the commands that a command has."""
    import typer

    module, name = command.target.split(":")
    found = getattr(import_module(f"siloscope.cli.{module}"), name)
    below = found.registered_commands if isinstance(found, typer.Typer) else ()
    return [str(each.name) for each in below]


def _help(*command: str) -> str:
    from siloscope.cli import main

    os.environ.update(NO_COLOR="1", COLUMNS="100", TERMINAL_WIDTH="100")
    shown = io.StringIO()
    with contextlib.redirect_stdout(shown):
        main([*command, "--help"])
    lines = [line.rstrip() for line in shown.getvalue().strip("\n").splitlines()]
    return "```text\n" + "\n".join(lines) + "\n```"


def reasons() -> str:
    """Every reason for which a frame is refused."""
    from siloscope.reasons import estimate_refusals as known

    return _advice(known())


def calibration_reasons() -> str:
    """Every reason for which there is no calibration."""
    return _advice(import_module("siloscope.reasons").CALIBRATION_REFUSALS)


def _advice(known: dict[str, tuple[str, str]]) -> str:
    rows = [f"| `{slug}` | {meaning} | {advice} |" for slug, (meaning, advice) in known.items()]
    return "\n".join(["| reason | what it means | what to try |", "|---|---|---|", *rows])


def quality() -> str:
    """Every remark on a calibration."""
    from siloscope.reasons import CALIBRATION_REMARKS

    return _meanings("code", CALIBRATION_REMARKS)


def frame_statuses() -> str:
    """What may become of a frame in a calibration."""
    from siloscope.reasons import FRAME_STATUSES

    return _meanings("status", FRAME_STATUSES)


def _meanings(head: str, known: dict[str, str]) -> str:
    rows = [f"| `{name}` | {meaning} |" for name, meaning in known.items()]
    return "\n".join([f"| {head} | meaning |", "|---|---|", *rows])


def sensors() -> str:
    """Every sensor profile that comes with siloscope."""
    from siloscope.sensors import load, names

    rows = [f"| `{name}` | {load(name).source} |" for name in names()]
    return "\n".join(["| name | where its figures come from |", "|---|---|", *rows])


def bottom_evidence() -> str:
    """How a bottom is known."""
    from siloscope.reasons import BOTTOM_EVIDENCE

    rows = [f"| `{name}` | {meaning} |" for name, meaning in BOTTOM_EVIDENCE.items()]
    return "\n".join(("| evidence | the bottom is known from |", "|---|---|", *rows))


def content_quality() -> str:
    """Every remark on a reading of the content."""
    from siloscope.reasons import CONTENT_REFUSALS, CONTENT_REMARKS

    rows = [
        f"| `{code}` | {meaning} | {advice} | {'may leave no answer' if code in CONTENT_REFUSALS else ''} |"
        for code, (meaning, advice) in CONTENT_REMARKS.items()
    ]
    return "\n".join(["| code | what it means | what to do | |", "|---|---|---|---|", *rows])


def input_quality() -> str:
    """Every remark on the inputs of a frame."""
    return _advice(import_module("siloscope.reasons").INPUT_REMARKS).replace("| reason |", "| code |", 1)


def products() -> str:
    """Every product that comes with siloscope."""
    from siloscope.content import products as known

    rows = [f"| `{name}` | {p.loose:g} ± {p.std:g} | {p.source} |" for name, p in known().items()]
    return "\n".join(["| product | kg/m³ | where the figures come from |", "|---|--:|---|", *rows])


def from_root(name: str) -> str:
    """A text at the repository's root; its links into docs/ lead on from there."""
    return (ROOT / name).read_text(encoding="utf-8").replace("](docs/", "](")


_PARTS: dict[str, Callable[[], str]] = {"commands": commands, "reasons": reasons, "sensors": sensors}
_PARTS |= {
    "bottom_evidence": bottom_evidence,
    "quality": quality,
    "calibration_reasons": calibration_reasons,
    "frame_statuses": frame_statuses,
}
_PARTS |= {"content_quality": content_quality, "input_quality": input_quality, "products": products}
_PARTS |= {"changes": partial(from_root, "CHANGELOG.md"), "design": partial(from_root, "DESIGN.md")}
