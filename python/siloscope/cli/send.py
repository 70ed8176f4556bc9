"""``siloscope send``: frames of files or a watched folder to a service, each until it is acknowledged."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

from siloscope.cli import options
from siloscope.cli.outcome import PARTIAL, print_json
from siloscope.cli.progress import say
from siloscope.client import Client, ServiceError
from siloscope.errors import InputError, UsageError
from siloscope.io.watched import WatchedFolder, files_in
from siloscope.tracking.clock import time_in_name
from siloscope.wording import counted

FIRST_WAIT_S, LAST_WAIT_S = 1.0, 60.0
"""Waits between tries double from the first to the last."""


def send(
    paths: Annotated[list[Path], typer.Argument(metavar="FRAMES…|FOLDER", help="Files, or one folder to watch.")],
    to: Annotated[str, typer.Option("--to", metavar="URL", help="The service, such as http://127.0.0.1:8480.")],
    camera: Annotated[str, typer.Option("--camera", metavar="ID", help="The camera that took them.")],
    token_file: Annotated[
        Path | None, typer.Option("--token-file", help="File with the camera's token; else SILOSCOPE_TOKEN.")
    ] = None,
    watch: Annotated[bool, typer.Option("--watch", help="Go on for ever with what comes into the folder.")] = False,
    delete: Annotated[
        bool, typer.Option("--delete", help="Delete a file once the service has it on its disk.")
    ] = False,
    tries: Annotated[int, typer.Option(min=1, max=1000, help="How often a file is tried without --watch.")] = 5,
    as_json: options.AsJson = False,
) -> int:
    """Send frames to a service: each again until the service has it on its disk.

    [bold]Example:[/bold] siloscope send frames/ --to http://127.0.0.1:8480 --camera cam7 --watch --delete

    A frame's time is that in its file's name, else the file's own. Exit code 5: some were refused.
    """
    client = Client(to, _token(token_file))
    if watch and (len(paths) != 1 or not paths[0].is_dir()):
        raise UsageError("--watch needs one folder")
    counts = {"sent": 0, "known": 0, "refused": 0}
    for path in _watched(paths[0]) if watch else _files(paths):
        outcome = _sent(client, camera, path, None if watch else tries)
        counts[outcome] += 1
        if delete and outcome != "refused":
            path.unlink()
    if as_json:
        print_json({"schema": "siloscope.send/1", **counts})
    else:
        print(f"{counted(counts['sent'], 'frame')} sent, {counts['known']} known before, {counts['refused']} refused")
    return PARTIAL if counts["refused"] else 0


def _token(file: Path | None) -> str | None:
    try:
        return os.environ.get("SILOSCOPE_TOKEN") if file is None else file.read_text("utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{file}: can't be read ({error}); give the file with the camera's token") from None


def _files(paths: list[Path]) -> Iterator[Path]:
    for path in paths:
        if path.is_dir():
            yield from files_in(path)
        elif path.is_file():
            yield path
        else:
            raise InputError(f"{path}: no such file; check the path")


def _watched(folder: Path) -> Iterator[Path]:
    """Files as they come and are complete, each once."""
    watched = WatchedFolder(folder)
    while True:
        for path in watched.complete():
            watched.give(path)
            yield path
        time.sleep(1.0)


def _sent(client: Client, camera: str, path: Path, tries: int | None) -> str:
    """Sends one file, again where that may help; without `tries` until it is answered."""
    named = time_in_name(path.name)
    captured: Any = path.stat().st_mtime if named is None else named
    wait, tried = FIRST_WAIT_S, 0
    while True:
        tried += 1
        try:
            return "sent" if client.send(camera, path, captured=captured).new else "known"
        except ServiceError as error:
            if not error.passing or (tries is not None and tried >= tries):
                say(f"{path}: {error}")
                return "refused"
            time.sleep(error.retry_after or wait)
            wait = min(2.0 * wait, LAST_WAIT_S)
