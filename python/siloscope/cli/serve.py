"""``siloscope serve``: frames in, readings, alerts and the page out, until it is stopped."""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from siloscope.cli import options
from siloscope.cli.outcome import print_json
from siloscope.cli.progress import say
from siloscope.errors import UsageError
from siloscope.io.extras import need

if TYPE_CHECKING:
    from siloscope.monitor.settings import Settings

Data = Annotated[
    Path | None, typer.Option("--data", metavar="DIR", help="Where database and frames lie; made where missing.")
]
Database = Annotated[
    str | None, typer.Option("--database", metavar="URL", help="PostgreSQL in place of SQLite in DIR.")
]


def serve(
    data: Data = None,
    site: Annotated[
        Path | None, typer.Option("--site", metavar="SITE.toml", help="Places, silos, cameras, products, rules.")
    ] = None,
    bind: Annotated[
        str, typer.Option("--bind", metavar="HOST:PORT", help="Where to listen; port 0 takes a free one.")
    ] = "127.0.0.1:8480",
    database: Database = None,
    workers: Annotated[
        int, typer.Option(min=0, max=64, help="Measuring processes; 0 leaves it to another service of the database.")
    ] = 1,
    live: Annotated[
        list[str] | None,
        typer.Option("--live", metavar="CAMERA=SOURCE", help="Drive a camera: realsense, folder:PATH, command:WORDS …"),
    ] = None,
    demo: Annotated[bool, typer.Option("--demo", help="A simulated farm, with two years of history.")] = False,
    as_json: options.AsJson = False,
) -> int:
    """Serve a site: take frames from cameras, measure them, show and tell what is in the silos.

    [bold]Example:[/bold] siloscope serve --demo

    Prints the address on stdout once it listens. Ends with Ctrl-C or SIGTERM. It listens on this machine alone until
    there is a user (siloscope monitor user).
    """
    need_monitor("the service")
    host, port = address(bind)
    if data is None and not demo:
        raise UsageError("say where the data lie with --data DIR, or look at a simulated farm with --demo")
    from siloscope.monitor.settings import Settings

    driven = tuple(_driven(text) for text in live or ())
    if data is not None:
        return _run(Settings(data, database, site, host, port, workers, driven), demo, as_json)
    with TemporaryDirectory(prefix="siloscope-demo-") as folder:
        return _run(Settings(Path(folder), database, site, host, port, workers, driven), demo, as_json)


def _driven(text: str) -> tuple[str, str]:
    """Camera and source of ``CAMERA=SOURCE``; raises `UsageError`."""
    camera, equals, source = text.partition("=")
    if not (camera and equals and source):
        raise UsageError(f"--live '{text}': give a camera and its source, such as cam7=realsense")
    return camera, source


def _run(settings: Settings, demo: bool, as_json: bool) -> int:
    from siloscope.monitor import server
    from siloscope.monitor.access import first_link
    from siloscope.monitor.live.attach import attach as drive
    from siloscope.monitor.publish.attach import attach
    from siloscope.monitor.service import Service

    service = Service(settings)
    swept = service.prepare()
    if swept.stray or swept.requeued or swept.damaged:
        say(f"after the last stop: {swept.stray} unfinished files removed, {swept.requeued} frames queued again, "
            f"{swept.damaged} damaged")  # fmt: skip
    link = first_link(service)
    if link is not None and not settings.loopback:
        raise UsageError(
            f"--bind {settings.host}: there is no user yet, so only this machine may reach it; "
            "make one with `siloscope monitor user NAME`, or start with --bind 127.0.0.1:8480 and use the link"
        )
    attach(service)
    drive(service)
    sock = server.listening(settings.host, settings.port)
    root = f"http://{_shown(settings.host)}:{sock.getsockname()[1]}"
    if as_json:
        print_json({"schema": "siloscope.serve/1", "address": root, "first_user": link and f"{root}/{link}"})
    else:
        print(root, flush=True)
    sys.stdout.flush()
    if link is not None and not as_json:
        say(f"the first user is made here, once: {root}/{link}")
    if demo:
        from siloscope.monitor.demo import farm

        farm.start(service, root)
    server.run(service, sock)
    return 0


def _shown(host: str) -> str:
    return f"[{host}]" if ":" in host else host


def address(bind: str) -> tuple[str, int]:
    """Host and port; raises `UsageError`."""
    host, _, port = bind.rpartition(":")
    if not host or not port.isdecimal() or int(port) > 65_535:
        raise UsageError(f"--bind '{bind}': give an address and a port such as 127.0.0.1:8480")
    return host.strip("[]"), int(port)


def need_monitor(what: str) -> None:
    """Raises `InputError` with the remedy where the extra is not installed."""
    for module in ("fastapi", "uvicorn", "sqlalchemy", "alembic"):
        need(module, "monitor", what)
