"""The command line. Only this package prints and exits; everything it does is a call of the public API.

A command is one module here with a function whose parameters are its arguments and options, which returns the exit
code (None for 0), and one line in `COMMANDS`. A command with commands of its own has a `typer.Typer` of such functions.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any, NamedTuple

import typer

from siloscope.cli.outcome import guarded

__all__ = ["COMMANDS", "Command", "main"]


class Command(NamedTuple):
    """One row of the command table."""

    name: str
    target: str
    """``module:function`` below ``siloscope.cli``."""
    help: str
    """The line in ``siloscope --help``."""


COMMANDS: tuple[Command, ...] = (
    Command("calibrate", "calibrate:calibrate", "Fuse many frames to the silo's calibration: pose and geometry."),
    Command("demo", "demo:demo", "Simulate a discharge, find the axis in every frame, write a report: the first run."),
    Command("track", "track:track", "Follow the content over many frames: refills, withdrawals, empty-by date."),
    Command("locate", "locate:locate", "Find the silo's axis and the camera's pose in one frame."),
    Command("info", "info:info", "Show what is inside a recording, image, array, cloud or folder."),
    Command("convert", "convert:convert", "Extract frames with their camera, times, gravity and provenance."),
    Command("live", "live:live", "Locate continuously from a camera being mounted, with a hint which way to turn it."),
    Command("measure", "measure:measure", "Measure what is in the silo: level, volume, fill, mass."),
    Command("strap", "strap:strap", "Write a strapping table: volume by height, with its uncertainty."),
    Command("check-volume", "check_volume:check", "Check volumes by conservation: measured beside moved."),
    Command("reconcile", "reconcile:reconcile", "Match weighbridge tickets with a track: the lot's density."),
    Command("plan", "plan:plan_command", "Plan where to hang a camera: the deviations to expect by place."),
    Command(
        "validate", "validate:validate_command", "Check on your own frames whether a calibration's deviations hold."
    ),
    Command("reproduce", "reproduce:reproduce", "Repeat the paper's tables and figures, ours beside theirs."),
    Command("pack", "pack:pack", "Seal frames in Zarr shards beside a manifest, for many machines."),
    Command("fleet", "fleet:fleet", "Measure many sealed frames on many machines: plan, run, compare, publish."),
    Command("serve", "serve:serve", "Serve a site: frames in, readings, alerts, the page out."),
    Command("send", "send:send", "Send frames to a service, each until it is on its disk."),
    Command("monitor", "monitor:monitor", "Look after a service's data: tokens, users, backup, restore, check."),
    Command("simulate", "simulate:simulate", "Write depth frames of a simulated silo, with their exact truth."),
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    arguments = (sys.argv[1:] if argv is None else list(argv)) or ["--help"]
    return guarded(lambda: _app(arguments)(args=arguments, prog_name="siloscope", standalone_mode=False), arguments)


def _app(arguments: Sequence[str]) -> typer.Typer:
    """The application with only the wanted command's module loaded, which keeps ``--help`` quick."""
    app = typer.Typer(rich_markup_mode="rich", context_settings={"help_option_names": ["-h", "--help"]})
    app.callback()(_siloscope)
    completing = "_SILOSCOPE_COMPLETE" in os.environ
    for command in COMMANDS:
        function = _load(command) if completing or command.name in arguments[:1] else _not_loaded
        if isinstance(function, typer.Typer):
            app.add_typer(function, name=command.name, short_help=command.help)
            continue
        text = None if function is not _not_loaded else command.help
        app.command(command.name, help=text, short_help=command.help, no_args_is_help=False)(function)
    return app


def _load(command: Command) -> Callable[..., Any]:
    module, name = command.target.split(":")
    function: Callable[..., Any] = getattr(import_module(f"siloscope.cli.{module}"), name)
    return function


def _not_loaded() -> None:
    """Stands in the list of commands for one that was not asked for."""


def _print_version(wanted: bool) -> None:
    if wanted:
        from siloscope import __version__

        typer.echo(f"siloscope {__version__}")
        raise typer.Exit


def _siloscope(
    version: bool = typer.Option(False, "--version", callback=_print_version, is_eager=True, help="Print the version."),
) -> None:
    """Find a silo's axis, geometry and content from one depth camera.

    [bold]Example:[/bold] siloscope locate frame.png --camera camera.json --depth-unit 0.001

    [bold]Exit codes:[/bold]
    0 answered
    2 wrong usage
    3 input that can't be used
    4 the frame does not show enough wall
    5 some frames of several failed
    """
