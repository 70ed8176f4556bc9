"""``siloscope check-volume``: two readings against a known amount, or against another silo's."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from siloscope.cli import measure as one
from siloscope.cli import options
from siloscope.cli.outcome import print_json
from siloscope.conservation import change, check_volume, moved_amount, read_reading
from siloscope.errors import UsageError
from siloscope.wording import with_std

Reading = Annotated[Path, typer.Argument(help="What `measure --json` printed.")]


def check(
    before: Reading,
    after: Reading,
    moved: Annotated[
        str | None, typer.Option(metavar="AMOUNT", help="What was moved, with its unit: 3.5m3, 120bu, 2400kg, 2.4t.")
    ] = None,
    moved_std: Annotated[
        float, typer.Option(metavar="PERCENT", min=0.0, max=50.0, help="Its standard deviation.")
    ] = 0.5,
    into: Annotated[
        tuple[Path, Path] | None, typer.Option(metavar="BEFORE AFTER", help="Readings of the silo it went to.")
    ] = None,
    density: one.DensityNumber = None,
    density_std: one.DensityStd = None,
    as_json: options.AsJson = False,
) -> int:
    """Check volumes by conservation: what two readings differ by is what was moved between them.

    [bold]Example:[/bold] siloscope check-volume monday.json tuesday.json --moved 12.4t --density 772

    The field test that needs no instrument: move a known amount, or from one silo into another (--into), and measure
    before and after.
    """
    if (moved is None) == (into is None):
        raise UsageError("give what was moved (--moved), or the readings of the silo it went to (--into)")
    measured = change(read_reading(before), read_reading(after))
    if into is not None:
        other = change(*(read_reading(path) for path in into))
    else:
        other = moved_amount(moved or "", density, density_std or 0.0, moved_std / 100.0)
    found = check_volume(measured, other)
    if as_json:
        print_json(found.to_dict())
        return 0
    console = Console(highlight=False, soft_wrap=True)
    word = "agree" if found.agrees else "disagree"
    sides = [with_std(side.volume, side.std, 1.0, " m³") for side in (found.measured, found.moved)]
    console.print(f"measured {sides[0]}, moved {sides[1]}", markup=False)
    console.print(f"they {word}: {found.difference:+.4f} m³, {abs(found.deviations):.1f} deviations", markup=False)
    return 0
