"""``siloscope reconcile``: a track's events against weighbridge tickets."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from siloscope.cli import options
from siloscope.cli.outcome import REFUSED, print_json
from siloscope.cli.progress import say
from siloscope.errors import InputError
from siloscope.reconcile import read_tickets
from siloscope.reconcile import reconcile as matched
from siloscope.schema import TRACK
from siloscope.types.track import Event
from siloscope.wording import with_std


def reconcile(
    track: Annotated[Path, typer.Argument(metavar="TRACK.json", help="What `track --out` or `track --json` wrote.")],
    tickets: Annotated[
        Path, typer.Option("--tickets", metavar="CSV", help="Columns time, mass (out: negative), ticket.")
    ],
    unit: Annotated[str, typer.Option(help="Unit of the masses: kg, t, short-ton, long-ton, cwt, lb.")] = "kg",
    scale_std: Annotated[
        float, typer.Option(metavar="PERCENT", min=0.01, max=49.0, help="Standard deviation of one weighing.")
    ] = 0.5,
    as_json: options.AsJson = False,
) -> int:
    """Match weighbridge tickets with refills and withdrawals: the lot's density and packing, and what does not match.

    [bold]Example:[/bold] siloscope reconcile march/track.json --tickets tickets.csv --unit t

    Give the density to `measure --density` and `--density-std`: it replaces the 5 % of a product table. Exit code 4:
    fewer than two events have tickets.
    """
    events, volumes = _story(track)
    found = matched(events, read_tickets(tickets, unit), scale_std / 100.0, volumes)
    if as_json:
        print_json(found.to_dict())
    else:
        console = Console(highlight=False, soft_wrap=True)
        density = "unknown" if found.density is None else with_std(found.density, found.density_std, 1.0, " kg/m³")
        console.print(f"density {density} from {len(found.matches)} events", markup=False)
        if found.packing is not None:
            packing, percent = (
                found.packing,
                with_std(100 * found.packing.growth, 100 * found.packing.growth_std, 1.0, " %"),
            )
            loose = with_std(packing.loose, packing.loose_std, 1.0, " kg/m³")
            console.print(f"packing: {loose} as poured, {percent} more at {packing.volume:.1f} m³", markup=False)
        for match in found.outlying:
            names = ", ".join(ticket.name for ticket in match.tickets)
            say(f"does not match: {names}, {match.density:.0f} kg/m³, {match.deviation:.0f} deviations off")
        for ticket in found.unmatched:
            say(f"no event for the ticket {ticket.name}")
        for event in found.without:
            say(f"no ticket for the {event.kind} of {event.volume:.2f} m³")
    return 0 if found.density is not None else REFUSED


def _story(path: Path) -> tuple[list[Event], dict[int, float]]:
    """The events of a track's document, and the volumes of its readings by their index."""
    try:
        document = json.loads(path.read_bytes())
        if document["schema"] != TRACK:
            raise InputError(f"{path}: no track of the schema {TRACK}; give what `siloscope track --json` printed")
        names = ("kind", "first", "last", "start", "end", "volume_m3", "volume_std_m3", "mass_kg")
        fields = {name: name.removesuffix("_m3").removesuffix("_kg") for name in names}
        told = [{field: e[name] for name, field in fields.items()} for e in document["events"]]
        events = [Event(**e, own_std=o.get("own_std_m3")) for e, o in zip(told, document["events"], strict=True)]
        readings = document.get("readings", ())
        return events, {r["index"]: float(r["volume_m3"]) for r in readings if r["volume_m3"] is not None}
    except OSError as error:
        raise InputError(f"{path}: can't be read ({error.strerror}); check its name and permissions") from None
    except (ValueError, KeyError, TypeError, RecursionError):
        raise InputError(f"{path}: no track, or a damaged one; give what `siloscope track --json` printed") from None
