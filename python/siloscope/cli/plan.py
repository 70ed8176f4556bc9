"""``siloscope plan``: where to hang a camera under a vessel's roof."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from siloscope.cli import options
from siloscope.cli.outcome import print_json, writing
from siloscope.cli.progress import say, track
from siloscope.io import camera_files
from siloscope.planning.plan import LEVELS, Place, Plan, plan

SHOWN = 5
"""Rows of the table."""


def plan_command(
    vessel: Annotated[Path, typer.Argument(metavar="VESSEL", help="Vessel file with diameter, cylinder and bottom.")],
    sensor: Annotated[
        str, typer.Option("--sensor", metavar="NAME|FILE", help="Sensor profile: its depth bias and noise.")
    ],
    camera: options.CameraFile = None,
    drop: Annotated[
        float | None, typer.Option(metavar="M", help="From the wall's upper edge down to the camera.")
    ] = None,
    levels: Annotated[
        str | None, typer.Option(metavar="L,L,…", help="Levels, as fractions of the height up to the upper edge.")
    ] = None,
    intrinsics: options.Intrinsics = None,
    out: Annotated[Path | None, typer.Option(metavar="PNG", help="Draw the plan on the roof.")] = None,
    as_json: options.AsJson = False,
) -> int:
    """Compare places for a camera by the deviations to expect there, before anything is mounted.

    [bold]Example:[/bold] siloscope plan silo7.toml --sensor orbbec-astra-s --out plan.png

    The surface fit's covariance, with the same draw of the noise at each place, holds what noise, bias, form of the
    wall and intrinsics leave open. Places are ordered by how many levels one frame alone answers, then by the volume's
    deviation. The last line lists the levels of which a calibration needs a frame.
    """
    made = plan(
        vessel,
        sensor,
        None if camera is None else camera_files.load(camera),
        drop=drop,
        levels=LEVELS if levels is None else options.numbers(levels, levels.count(",") + 1, "--levels"),
        intrinsics=intrinsics,
        progress=lambda items, label, total: track(items, label, total=total),
    )
    if out is not None:
        from siloscope.reporting.plots import save
        from siloscope.reporting.plots.plan import plan_picture

        with writing(out):
            save(plan_picture(made), out)
        say(f"wrote {out}")
    for line in made.assumed:
        say(f"assumed: {line}")
    if as_json:
        print_json(made.to_dict())
    else:
        _show(made)
    return 0


def _show(made: Plan) -> None:
    console = Console(highlight=False)
    table = Table("off the axis", "looks", "tilt", "levels", "axis ±", "volume ±", box=None)
    for place in made.places[:SHOWN]:
        table.add_row(*_row(place))
    console.print(table)
    for one in made.best.levels:
        for warning in one.warnings:
            say(f"warning: at {100 * one.level:.0f} % {warning}")
    needed = ", ".join(f"{100 * level:.0f} % (axis ± {1e3 * std:.1f} mm)" for level, std in made.calibration_levels)
    console.print(f"Frames for a calibration, most useful first: level {needed}", markup=False, soft_wrap=True)


def _row(place: Place) -> list[str]:
    a, axis, volume = place.placement, place.best_axis_std, place.worst_volume_std
    return [
        f"{math.hypot(a.x, a.y):.2f} m at {math.degrees(math.atan2(a.y, a.x)):.0f}°",
        a.aim,
        f"{math.degrees(a.tilt):.0f}°",
        f"{place.answered} of {len(place.levels)}",
        "refused" if axis is None else f"{1e3 * axis:.1f} mm",
        "unknown" if volume is None else f"{volume:.3f} m³",
    ]
