"""``siloscope strap``: the vessel's volume by height, with its uncertainty, as a table and a page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

import siloscope
from siloscope.cli import options
from siloscope.cli.outcome import print_json, writing
from siloscope.cli.progress import say
from siloscope.content.knowledge import filled_to, know
from siloscope.content.strapping_table import COVERAGE_FACTOR, strapping_table, write_csv
from siloscope.vessel.vessel import given
from siloscope.wording import with_std


def strap(
    calibration: Annotated[Path, typer.Argument(metavar="CALIBRATION", help="What `calibrate` wrote.")],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="CSV", help="Write height, volume, deviation here.")
    ] = None,
    page: Annotated[Path | None, typer.Option(metavar="HTML", help="Write one printable page here.")] = None,
    step: Annotated[float, typer.Option(min=0.001, max=10.0, metavar="M", help="Step of the height.")] = 0.01,
    vessel: options.VesselFile = None,
    diameter: options.Diameter = None,
    cylinder: options.Cylinder = None,
    cone: options.Cone = None,
    bottom: options.Bottom = None,
    top: options.Top = None,
    as_json: options.AsJson = False,
) -> int:
    """Write a strapping table: the volume under a level plane by height, with its deviation.

    [bold]Example:[/bold] siloscope strap silo7.json --top -0.3 -o silo7.csv --page silo7.html

    Heights are over the floor's lowest point. The page has the geometry, the datum, the uncertainty budget (k = 2) and
    what was assumed. `measure --strapping` reads the table back.
    """
    about = given(vessel, top, diameter=diameter, cylinder=cylinder, cone=cone, bottom=bottom)
    silo = siloscope.Calibration.load(calibration)
    known = filled_to(know(silo, None, about.sheet, about.top, about.sheet.diameter), about)
    table = strapping_table(known, about, step)
    if out is not None:
        with writing(out):
            write_csv(out, table)
        say(f"wrote {len(table.rows)} rows to {out}")
    if page is not None:
        from siloscope.reporting.strapping_page import write_page

        with writing(page):
            write_page(page, table, about.name or calibration.stem)
        say(f"wrote {page}")
    if as_json:
        print_json(table.to_dict())
        return 0
    last = table.rows[-1]
    console = Console(highlight=False, soft_wrap=True)
    console.print(f"capacity {with_std(last.volume, last.std, 1.0, ' m³')} at {last.height:.3f} m", markup=False)
    for name, own, share in table.budget:
        console.print(f"  {name}: {1e3 * own:.2f} mm, {COVERAGE_FACTOR * share:.4f} m³ (k = 2)", markup=False)
    return 0
