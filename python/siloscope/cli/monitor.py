"""``siloscope monitor``: tokens, users, backups and checks of a service's data."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from siloscope.cli import options
from siloscope.cli.outcome import print_json
from siloscope.cli.progress import say
from siloscope.cli.serve import Database, need_monitor
from siloscope.errors import UsageError

ACTIONS = ("token", "user", "backup", "restore", "check", "copy")


def monitor(
    action: Annotated[str, typer.Argument(metavar="|".join(ACTIONS), help="What to do.")],
    name: Annotated[
        str | None, typer.Argument(metavar="NAME|FILE", help="A user's name, or the backup's file.")
    ] = None,
    data: Annotated[Path | None, typer.Option("--data", metavar="DIR", help="The service's folder.")] = None,
    database: Database = None,
    role: Annotated[
        str | None,
        typer.Option(help="token: camera, read, metrics, edge, admin. user: percent, viewer, operator, admin."),
    ] = None,
    camera: Annotated[str | None, typer.Option(metavar="ID", help="token: the camera that it is for.")] = None,
    place: Annotated[
        str | None, typer.Option(metavar="ID", help="user: where the role holds; everywhere else.")
    ] = None,
    ask: Annotated[
        bool, typer.Option("--password-stdin", help="user: take the password from standard input, without a link.")
    ] = False,
    to: Annotated[str | None, typer.Option(metavar="URL", help="copy: the other database.")] = None,
    as_json: options.AsJson = False,
) -> int:
    """Look after a service's data: tokens and users, backup, restore, check, copy.

    [bold]Example:[/bold] siloscope monitor token --data farm --role camera --camera cam7

    token prints a new token once, on stdout. user makes a user and prints the link where the password is set, once.
    backup writes a file that restore takes back; check says whether everything is whole; copy moves a site to another
    database. backup, check and copy may run beside the service.
    """
    need_monitor("the service")
    from siloscope.monitor import administration as admin

    if action not in ACTIONS:
        raise UsageError(f"unknown action '{action}'; known are {', '.join(ACTIONS)}")
    if data is None:
        raise UsageError("say where the service's data lie with --data DIR")
    work: dict[str, Callable[[], dict[str, Any]]] = {
        "token": lambda: admin.token(data, database, _given(role, "--role"), camera, name),
        "user": lambda: admin.user(data, database, _given(name, "NAME"), role or "viewer", place, _password(ask)),
        "backup": lambda: admin.backup(data, database, Path(_given(name, "FILE"))),
        "restore": lambda: admin.restore(data, database, Path(_given(name, "FILE"))),
        "check": lambda: admin.check(data, database),
        "copy": lambda: admin.copy(data, database, _given(to, "--to")),
    }
    found = work[action]()
    if as_json:
        print_json(found)
    else:
        print(found["printed"])
        for line in found.get("told", ()):
            say(line)
    return int(found.get("exit_code", 0))


def _given(value: str | None, what: str) -> str:
    if value is None:
        raise UsageError(f"give {what}; see 'siloscope monitor --help'")
    return value


def _password(ask: bool) -> str | None:
    return sys.stdin.readline().rstrip("\n") if ask else None
