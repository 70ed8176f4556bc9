"""From readings in their order to the story: flow, events, use."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from siloscope.tracking.events import events
from siloscope.tracking.use import use
from siloscope.types.content import Content
from siloscope.types.track import Reading, Track


@dataclass(frozen=True, eq=False)
class Moment:
    """One frame as measured, without its surface."""

    index: int
    time: float | None
    content: Content
    datum: float | None
    """z of the heights' zero."""


def track_of(moments: Sequence[Moment], last: Content | None = None, problems: tuple[str, ...] = ()) -> Track:
    """The story of readings in their order; `last` is the newest one with its surface, `problems` what was not read."""
    answered = [m for m in moments if m.content.volume is not None]
    contents = [m.content for m in answered]
    time, volume, std, own, mass = (
        np.array([np.nan if value is None else value for value in values], np.float64)
        for values in (
            [m.time for m in answered],
            [c.volume for c in contents],
            [c.volume_std for c in contents],
            [c.own_std for c in contents],
            [c.mass for c in contents],
        )
    )
    found = events(time, volume, own, capacity=contents[-1].capacity if contents else None, mass=mass)
    unread = tuple(Reading(len(moments) + i, name, None, "unreadable", name) for i, name in enumerate(problems))
    return Track(
        tuple(_readings(moments)) + unread,
        tuple(replace(e, first=answered[e.first].index, last=answered[e.last].index) for e in found),
        use(time, volume, std, found),
        None if last is None else last.capacity,
        None if last is None else last.height_datum,
        problems,
        last,
        {} if last is None else last.config,
    )


def _readings(moments: Sequence[Moment]) -> Iterator[Reading]:
    """The rows of the table; where the cone is not known, heights are over the lowest point of the whole story."""
    lowest = max((m.datum for m in moments if m.datum is not None), default=0.0)
    before: Moment | None = None
    for moment in moments:
        c = moment.content
        lift = 0.0 if moment.datum is None else lowest - moment.datum
        flow = None if before is None else _flow(before, moment)
        dense = c if c.volume or before is None else before.content
        yield Reading(
            moment.index,
            c.source,
            moment.time,
            c.status,
            {"refused": c.reason, "unreadable": c.message}.get(c.status),
            c.volume,
            c.volume_std,
            c.fill_fraction,
            None if c.level.mean is None else c.level.mean + lift,
            c.mass,
            c.mass_std,
            c.coverage,
            flow,
            _mass_flow(flow, dense),
            tuple(remark.code for remark in c.quality),
        )
        before = moment if c.volume is not None else before


def _flow(before: Moment, now: Moment) -> float | None:
    """m³/h between two readings."""
    if before.content.volume is None or now.content.volume is None or before.time is None or now.time is None:
        return None
    hours = (now.time - before.time) / 3600.0
    return (now.content.volume - before.content.volume) / hours if hours > 0.0 else None


def _mass_flow(flow: float | None, dense: Content) -> float | None:
    """t/h of content as dense as that of a reading."""
    if flow is None or dense.mass is None or not dense.volume:
        return None
    return 1e-3 * flow * dense.mass / dense.volume
