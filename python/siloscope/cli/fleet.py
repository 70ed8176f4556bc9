"""``siloscope fleet``: plan, run, follow, compare and publish the measuring of many sealed frames."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from siloscope.cli import measure as one
from siloscope.cli import options
from siloscope.cli.outcome import PARTIAL, print_json, writing
from siloscope.cli.progress import say
from siloscope.cli.serve import need_monitor
from siloscope.errors import UsageError
from siloscope.fleet import plan as plans
from siloscope.fleet import running, settings
from siloscope.fleet.progress import Account, line
from siloscope.fleet.running import Opened
from siloscope.fleet.status import is_flawed
from siloscope.fleet.status import status as status_of
from siloscope.schema import documents
from siloscope.wording import counted

fleet = typer.Typer(
    help="Measure many sealed frames on many machines.\n\n[bold]Example:[/bold] siloscope fleet plan STORE --out RUN, "
    "then siloscope fleet run RUN\n\nEach of these commands has --help with an example, and --json.",
    rich_markup_mode="rich",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)

RunArgument = Annotated[
    str, typer.Argument(metavar="RUN", help="The run's folder or URL; PLACE@ID names one of several.")
]
Metrics = Annotated[
    Path | None, typer.Option("--metrics", metavar="FILE", help="Keep a Prometheus text file up to date.")
]
Retry = Annotated[bool, typer.Option("--retry-failed", help="Try shards again that were given up.")]


@fleet.command("plan")
def plan(
    store: Annotated[str, typer.Argument(metavar="STORE", help="What `siloscope pack` made: a folder or URL.")],
    out: Annotated[str, typer.Option("--out", "-o", metavar="RUN", help="Folder or URL for the run.")],
    calibrations: Annotated[
        Path | None, typer.Option("--calibrations", metavar="DIR", help="SILO.json for each silo that has one.")
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option("--config", metavar="TOML", help="What to measure with: all silos, single ones."),
    ] = None,
    sensor: options.Sensor = None,
    product: one.Product = None,
    as_json: options.AsJson = False,
) -> int:
    """Plan a run: its id is the hash of version, configuration and calibrations.

    [bold]Example:[/bold] siloscope fleet plan s3://mill/frames --out s3://mill/runs --calibrations calibrations

    Silos without a calibration are calibrated from their own frames. Plan again when frames were added: the same run
    goes on with them.
    """
    made, shards = plans.make(store, out, calibrations, settings.settings(config, sensor=sensor, product=product))
    if as_json:
        print_json({**made.to_dict(), "shards": shards, "place": out})
    else:
        say(f"run {made.run}: {counted(shards, 'shard')}; start it with `siloscope fleet run {out}`")
    return 0


@fleet.command("run")
def run(
    name: RunArgument,
    engine: Annotated[str, typer.Option(metavar="local|ray", help="Where tasks run.")] = "local",
    workers: Annotated[
        int | None, typer.Option(min=1, max=running.MOST_WORKERS, help="Tasks at a time; all cores unless given.")
    ] = None,
    address: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Of a running Ray cluster, such as auto or ray://head:10001.")
    ] = None,
    retry_failed: Retry = False,
    metrics: Metrics = None,
    as_json: options.AsJson = False,
) -> int:
    """Do what a run lacks, on this machine's cores or on Ray.

    [bold]Example:[/bold] siloscope fleet run runs/march --engine local --workers 8

    A shard that is committed is never done again, so the same command goes on with a run that was cut off. With --json,
    the progress on stderr is a JSON line each time, and stdout has the status at the end.

    Exit code 5: shards failed three times, or frames can't be read; both are named.
    """
    if address is not None and engine != "ray":
        raise UsageError("--address is a Ray cluster's; add --engine ray")
    opened, _ = running.run(
        name,
        engine=engine,
        workers=workers or os.cpu_count() or 1,
        address=address,
        again=retry_failed,
        say=_teller(as_json),
        metrics=metrics,
    )
    return _ended(opened, as_json)


@fleet.command("worker")
def worker(
    name: RunArgument,
    index: Annotated[int, typer.Option("--index", min=0, help="This worker's number, from 0.")],
    of: Annotated[int, typer.Option("--of", min=1, help="Number of workers.")],
    retry_failed: Retry = False,
    metrics: Metrics = None,
    as_json: options.AsJson = False,
) -> int:
    """Do one worker's part of a run without an engine: in a Slurm array or a Kubernetes Indexed Job.

    [bold]Example:[/bold] siloscope fleet worker /shared/run --index $SLURM_ARRAY_TASK_ID --of 100

    Workers share nothing but the run's place and wait for nobody. A silo that is calibrated from its own frames is one
    worker's alone. Exit code 5 as for `fleet run`.
    """
    opened, _ = running.run(name, part=(index, of), again=retry_failed, say=_teller(as_json), metrics=metrics)
    return _ended(opened, as_json)


@fleet.command("status")
def status(name: RunArgument, as_json: options.AsJson = False) -> int:
    """Tell how far a run is, what failed and why, and what it has cost.

    [bold]Example:[/bold] siloscope fleet status runs/march

    Exit code 5: shards failed, or frames can't be read.
    """
    return _ended(Opened.of(name), as_json)


@fleet.command("diff")
def diff(
    before: RunArgument,
    after: RunArgument,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="HTML", help="Write a page with the worst.")
    ] = None,
    as_json: options.AsJson = False,
) -> int:
    """Compare two runs frame by frame: answers, poses, volumes, deviations, remarks, by silo and in all.

    [bold]Example:[/bold] siloscope fleet diff runs@0123456789abcdef runs --out changes.html
    """
    from siloscope.fleet.diff import diff as compared
    from siloscope.fleet.diff_page import page

    found = compared(Opened.of(before), Opened.of(after))
    if out is not None:
        with writing(out):
            page(found).write(out)
        say(f"wrote {out}")
    if as_json:
        print_json(found)
    else:
        _print_diff(found)
    return 0


@fleet.command("publish")
def publish(
    name: RunArgument,
    to: Annotated[
        str | None,
        typer.Option("--to", metavar="PLACE", help="Whose current.json is moved; the run's own."),
    ] = None,
    monitor: Annotated[
        Path | None,
        typer.Option("--monitor", metavar="DATA", help="Bring it into a service instead: its --data folder."),
    ] = None,
    database: Annotated[
        str | None, typer.Option("--database", metavar="URL", help="With --monitor: the service's --database.")
    ] = None,
    partial: Annotated[bool, typer.Option("--partial", help="Publish a run that is not complete.")] = False,
    as_json: options.AsJson = False,
) -> int:
    """Make a run the current one: readers see all of it, or all of the one before.

    [bold]Example:[/bold] siloscope fleet publish runs/march --to s3://mill/readings

    With --monitor, the readings come into a service as a run: they count from then on, and those that they replace are
    kept. Silos and cameras are those that the frames were packed with. Doing it again changes nothing.
    """
    from siloscope.fleet.publish import check_complete
    from siloscope.fleet.publish import publish as published

    if monitor is not None:
        if to is not None:
            raise UsageError("give --to or --monitor, not both")
        opened = Opened.of(name)
        check_complete(opened, partial)
        return _into_monitor(opened, monitor, database, as_json)
    if database is not None:
        raise UsageError("--database is a service's; add --monitor with its data folder")
    document = published(Opened.of(name), to, partial)
    if as_json:
        print_json(document)
    else:
        before = "" if document["previous"] is None else f"; before it {document['previous']}"
        say(f"current is run {document['run']}{before}")
    return 0


def _into_monitor(run: Opened, data: Path, database: str | None, as_json: bool) -> int:
    need_monitor("a service's readings")
    from siloscope.fleet.importing import into_monitor

    told = into_monitor(run, data, database)
    if as_json:
        print_json(told)
    else:
        say(f"it is run {told['monitor_run']} there: {told['added']} readings added, {told['again']} known")
    return 0


def _teller(as_json: bool) -> Any:
    def tell(account: Account) -> None:
        say(json.dumps(documents.plain(account.to_dict())) if as_json else line(account))

    return tell


def _ended(run: Opened, as_json: bool) -> int:
    """Prints a run's status; the exit code."""
    document = status_of(run)
    if as_json:
        print_json(document)
    else:
        _print_status(document)
    for row in document["failed"]:
        say(f"failed: {row['shard']} ({row['stage']}): {row['reason']}")
    for row in document["damaged"]:
        say(f"damaged: {row['shard']}: {'; '.join(row['frames'])}")
    return PARTIAL if is_flawed(document) else 0


def _print_status(document: dict[str, Any]) -> None:
    shards, frames, silos = document["shards"], document["frames"], document["silos"]
    console = Console(highlight=False, soft_wrap=True)
    console.print(f"run {document['run']} of siloscope {document['version']}", markup=False)
    console.print(f"shards  {shards['done']} of {shards['total']}, {len(document['failed'])} failed", markup=False)
    console.print(f"frames  {frames['done']} of {frames['total']}", markup=False)
    given, folded, to_fold = silos["given"], silos["folded"], silos["to_fold"]
    console.print(
        f"silos   {given} with a calibration, {folded} of {to_fold} calibrated from their frames", markup=False
    )
    cost = f"{document['core_hours']:.3f} core-hours, {document['bytes_read'] / 1e9:.2f} GB read"
    console.print(f"cost    {cost}", markup=False)


def _print_diff(found: dict[str, Any]) -> None:
    whole, volume = found["all"], found["all"]["volume_m3"]
    console = Console(highlight=False, soft_wrap=True)
    console.print(f"frames in both  {whole['frames']}, {whole['same']} the same to the last bit", markup=False)
    console.print(f"answers         {whole['gained']} gained, {whole['lost']} lost", markup=False)
    if volume["rms"] is not None:
        sizes = f"RMS {1e3 * volume['rms']:.3g} l, largest {1e3 * volume['largest']:.3g} l"
        console.print(f"volume          {sizes}", markup=False)
    for row in found["worst"][:5]:
        console.print(f"worst           {row['silo']} {row['sha256'][:12]} {row['gap_m3']} m³", markup=False)
