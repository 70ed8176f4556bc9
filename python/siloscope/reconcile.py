"""`reconcile`: weighbridge tickets against the events of a track: the lot's density, and tickets that don't match."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from siloscope.content.units import MASSES
from siloscope.errors import InputError, UsageError
from siloscope.types.track import Event

LARGEST_FILE = 10_000_000
"""Bytes of a table of tickets."""

APART = 6.0 * 3600.0
"""Seconds that a ticket may lie outside its event: trucks weigh before they tip and after they load."""

SCALE_STD = 0.005
"""Relative standard deviation of a weighbridge's mass where nobody tells."""

OUTLYING = 4.0
"""Deviations beyond which a ticket does not match its event."""

FEWEST_PACKING = 5
"""Matched events that tell a packing."""

SURE_PACKING = 0.01
"""Largest standard deviation of a packing that is stated; grain packs by 2 to 8 % (Bhadra et al.)."""

FEWEST = 2
"""Matched events that make a density."""


@dataclass(frozen=True)
class Ticket:
    """One weighing: what went in (positive) or out (negative)."""

    time: float
    """Seconds since 1970."""
    mass: float
    """kg."""
    name: str = ""


@dataclass(frozen=True)
class Match:
    """An event and its tickets."""

    event: Event
    tickets: tuple[Ticket, ...]
    mass: float
    """kg, positive for both kinds."""
    mass_std: float
    deviation: float = 0.0
    """How far its density is off the lot's, in deviations."""

    @property
    def density(self) -> float:
        """kg/m³."""
        return self.mass / self.event.volume


@dataclass(frozen=True)
class Packing:
    """How the lot packs under its own weight: the content V weighs ρ₀ (V + κ V²)."""

    loose: float
    """ρ₀, kg/m³: as poured."""
    loose_std: float
    growth: float
    """κ V of the fullest matched reading: by how much the whole content is denser than as poured."""
    growth_std: float
    volume: float
    """V of that reading, m³."""

    def to_dict(self) -> dict[str, float]:
        """Plain data."""
        return {
            "loose_kg_m3": self.loose,
            "loose_std_kg_m3": self.loose_std,
            "growth": self.growth,
            "growth_std": self.growth_std,
            "at_volume_m3": self.volume,
        }


@dataclass(frozen=True)
class Reconciliation:
    """What tickets and a track say together."""

    density: float | None
    """kg/m³; None where fewer than two events have tickets."""
    density_std: float | None
    matches: tuple[Match, ...]
    outlying: tuple[Match, ...]
    """Matched events whose mass contradicts the rest."""
    unmatched: tuple[Ticket, ...]
    without: tuple[Event, ...]
    """Events without a ticket."""
    packing: Packing | None = None
    """None unless the matched events reach so deep and so shallow that they tell it."""

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "schema": "siloscope.reconciliation/1",
            "density_kg_m3": self.density,
            "density_std_kg_m3": self.density_std,
            "matches": [_plain(match) for match in self.matches],
            "outlying": [_plain(match) for match in self.outlying],
            "unmatched_tickets": [{"name": t.name, "time": t.time, "mass_kg": t.mass} for t in self.unmatched],
            "events_without_ticket": [event.to_dict() for event in self.without],
            "packing": None if self.packing is None else self.packing.to_dict(),
        }


def reconcile(
    events: Sequence[Event],
    tickets: Sequence[Ticket],
    scale_std: float = SCALE_STD,
    volumes: Mapping[int, float] | None = None,
) -> Reconciliation:
    """Match tickets with events of the same direction and time, and fit one density to all of them.

    The density is the mean of mass by volume, weighed by both deviations, with outlying events left out one by one:
    robust against a ticket that was lost or typed wrong. Its deviation contains the scatter of the events that remain.

    Parameters
    ----------
    events : sequence of Event
        Of a track, with times.
    tickets : sequence of Ticket
        In any order.
    scale_std : float
        Relative standard deviation of a ticket's mass.
    volumes : mapping of int to float, optional
        Volume, m³, of a track's readings by their index: with them the lot's packing is told where it shows.
    """
    if not 0.0 < scale_std < 0.5:
        raise UsageError(f"the scale's deviation must be a fraction between 0 and 0.5, got {scale_std:g}")
    groups, unmatched = _grouped(events, tickets)
    found = [_match(events[k], group, scale_std) for k, group in sorted(groups.items())]
    kept, outlying = list(found), []
    density = std = None
    while len(kept) >= FEWEST:
        density, std, deviations = _mean(kept)
        worst = max(range(len(kept)), key=lambda i: deviations[i])
        if deviations[worst] <= OUTLYING or len(kept) <= FEWEST:
            kept = [_with(match, value) for match, value in zip(kept, deviations, strict=True)]
            break
        outlying.append(_with(kept.pop(worst), deviations[worst]))
    without = tuple(event for k, event in enumerate(events) if k not in groups)
    packing = None if volumes is None or density is None else _packing(kept, volumes)
    return Reconciliation(density, std, tuple(kept), tuple(outlying), tuple(unmatched), without, packing)


def _packing(matches: Sequence[Match], volumes: Mapping[int, float]) -> Packing | None:
    """ρ₀ and κ by least squares of the masses, weighed by both deviations and the scatter that remains.

    Feed is the denser the more lies on it, in a first approximation in proportion to the depth: a content V then weighs
    ρ₀ (V + κ V²), and what an event moves is the difference of two contents.
    """
    known = [m for m in matches if m.event.first in volumes and m.event.last in volumes]
    if len(known) < FEWEST_PACKING:
        return None
    first, last = (np.array([volumes[getattr(m.event, end)] for m in known]) for end in ("first", "last"))
    mass = np.array([math.copysign(m.mass, b - a) for m, a, b in zip(known, first, last, strict=True)])
    std = np.array([m.mass * math.hypot(m.mass_std / m.mass, _own_std(m.event) / m.event.volume) for m in known])
    most = float(max(first.max(), last.max()))
    columns = np.column_stack([last - first, (last**2 - first**2) / most])
    weighed, values = columns / std[:, None], mass / std
    normal = weighed.T @ weighed
    if np.linalg.cond(normal) > 1e10:
        return None
    covariance = np.linalg.inv(normal)
    loose, square = covariance @ (weighed.T @ values)
    excess = float(((values - weighed @ (loose, square)) ** 2).sum()) / (len(known) - 2)
    covariance *= max(excess, 1.0)
    growth = square / loose
    by = np.array([-growth / loose, 1.0 / loose])
    growth_std = math.sqrt(float(by @ covariance @ by))
    if growth_std > SURE_PACKING:
        return None
    return Packing(float(loose), math.sqrt(float(covariance[0, 0])), float(growth), growth_std, most)


def _grouped(events: Sequence[Event], tickets: Sequence[Ticket]) -> tuple[dict[int, tuple[Ticket, ...]], list[Ticket]]:
    """Tickets by the number of the nearest event of their direction, and those that have none."""
    groups: dict[int, tuple[Ticket, ...]] = {}
    unmatched = []
    for ticket in sorted(tickets, key=lambda t: t.time):
        kind = "refill" if ticket.mass > 0.0 else "withdrawal"
        near = [(_apart(event, ticket.time), k) for k, event in enumerate(events) if event.kind == kind]
        apart, k = min(near, default=(math.inf, -1))
        if apart <= APART:
            groups[k] = (*groups.get(k, ()), ticket)
        else:
            unmatched.append(ticket)
    return groups, unmatched


def _apart(event: Event, time: float) -> float:
    """Seconds between a time and an event; 0 within it."""
    if event.start is None or event.end is None:
        return math.inf
    return max(event.start - time, time - event.end, 0.0)


def _match(event: Event, tickets: tuple[Ticket, ...], scale_std: float) -> Match:
    masses = np.array([abs(ticket.mass) for ticket in tickets])
    return Match(event, tickets, float(masses.sum()), scale_std * float(np.sqrt((masses**2).sum())))


def _mean(matches: Sequence[Match]) -> tuple[float, float, list[float]]:
    """Density, its deviation, and how far each match is off the mean of the others, in deviations."""
    values = np.array([match.density for match in matches])
    own = np.array([m.density * math.hypot(m.mass_std / m.mass, _own_std(m.event) / m.event.volume) for m in matches])
    middle = float(np.median(values))
    scatter = 1.4826 * float(np.median(np.abs(values - middle)))
    spread = math.sqrt(max(scatter**2 - float(np.median(own)) ** 2, 0.0))
    weight = 1.0 / (own**2 + spread**2)
    mean = float((weight * values).sum() / weight.sum())
    deviations = np.abs(values - middle) / np.sqrt(own**2 + spread**2)
    return mean, float(weight.sum() ** -0.5), deviations.tolist()


def _own_std(event: Event) -> float:
    """What differs from event to event; what all share is an error of the density that they give."""
    return event.volume_std if event.own_std is None else event.own_std


def _with(match: Match, deviation: float) -> Match:
    return Match(match.event, match.tickets, match.mass, match.mass_std, float(deviation))


def _plain(match: Match) -> dict[str, Any]:
    return {
        "event": match.event.to_dict(),
        "tickets": [ticket.name for ticket in match.tickets],
        "mass_kg": match.mass,
        "density_kg_m3": match.density,
        "deviation": match.deviation,
    }


def read_tickets(path: str | Path, unit: str = "kg") -> list[Ticket]:
    """Tickets of a CSV file with a heading: ``time`` (ISO 8601), ``mass`` (positive in, negative out), ``ticket``.

    Raises
    ------
    InputError
        That names the file, the line and what is wrong.
    """
    path = Path(path)
    if unit not in MASSES:
        raise UsageError(f"unknown unit '{unit}'; known are {', '.join(MASSES)}")
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise InputError(f"{path}: too large for tickets; give the columns time, mass and ticket")
        text = path.read_text("utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: can't be read ({error.strerror}); check its name and permissions") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: no text; save the tickets as CSV in UTF-8") from None
    rows = csv.DictReader(text.splitlines(), delimiter=";" if ";" in text else ",")
    if not {"time", "mass"} <= set(rows.fieldnames or ()):
        raise InputError(f"{path}: the heading must name the columns time and mass; ticket is optional")
    return [_ticket(row, f"{path}, line {number}", MASSES[unit][0]) for number, row in enumerate(rows, 2)]


def _ticket(row: dict[str, str], where: str, kilograms: float) -> Ticket:
    try:
        moment = datetime.fromisoformat((row["time"] or "").strip())
        mass = float((row["mass"] or "").replace(",", "."))
    except (ValueError, TypeError):
        raise InputError(f"{where}: give a time such as 2026-03-01T06:00Z and a mass") from None
    if not math.isfinite(mass) or mass == 0.0:
        raise InputError(f"{where}: a mass of {mass:g} is no delivery; give more than 0 in, less than 0 out")
    moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    return Ticket(moment.timestamp(), mass * kilograms, (row.get("ticket") or where).strip())
