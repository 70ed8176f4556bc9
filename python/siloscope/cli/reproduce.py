"""``siloscope reproduce``: the paper's tables and figures, ours beside theirs."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import typer

from siloscope.cli import options
from siloscope.cli.outcome import print_json, writing
from siloscope.cli.progress import say, track


def reproduce(
    tables: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[TABLE]...",
            help="table3 table4 table5 table6 table7 fig9 fig11 fig13 fig14 fig17 timing limitations, "
            "or all, which is also what none means.",
        ),
    ] = None,
    steps: Annotated[
        int | None, typer.Option(min=1, max=10_000, help="Frames a discharge instead of the paper's 100, 296 and 418.")
    ] = None,
    jobs: Annotated[int, typer.Option(min=1, max=256, help="Processes that work at the same time.")] = 2,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where to write.")] = Path("reproduced"),
    as_json: options.AsJson = False,
) -> None:
    """Repeat the paper's evaluation and put our numbers beside the paper's.

    [bold]Example:[/bold] siloscope reproduce table3 fig9 --steps 20 --out reproduced

    Writes results.md, and its tables (CSV) and pictures (PNG) into the folder results beside it. Every finished frame
    is kept there too: an interrupted run goes on where it stopped when it is started again.
    """
    from siloscope.reproduction.evaluation.plan import Plan
    from siloscope.reproduction.evaluation.reproduction import Reproduction

    names = tables or []
    with writing(out):
        done = Reproduction.of(names, Plan(steps), out, workers=jobs, progress=_shown)
        written = done.write(out, _command(names, steps, out), say)
    if as_json:
        print_json({**done.to_dict(), "files": [str(path) for path in written]})
    else:
        typer.echo(f"{len(written)} files; read {written[0]}")


def _shown(finished: Iterable[Any], count: int) -> Iterable[Any]:
    say(f"{count} frames to simulate and solve" if count else "every frame is finished already")
    return track(finished, "frames", total=count)


def _command(names: list[str], steps: int | None, out: Path) -> str:
    """The command that makes the same page; how many processes worked makes no difference."""
    size = [] if steps is None else ["--steps", str(steps)]
    return " ".join(["siloscope", "reproduce", *(names or ["all"]), *size, "--out", out.name or "."])
