"""When a frame was taken: its own time, else the one in its name, else an interval."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from siloscope.types.track import ABSOLUTE

_ISO = re.compile(
    r"(?<!\d)(20\d\d|19\d\d)[-_.]?(0[1-9]|1[0-2])[-_.]?(0[1-9]|[12]\d|3[01])"
    r"[T _-]{0,3}([01]\d|2[0-3])[-_.:hH]?([0-5]\d)(?:[-_.:mM]?([0-5]\d))?(?:[.,](\d{1,6}))?"
    r"(?:(Z)|([+-])(\d\d)[:.]?(\d\d))?(?!\d)"
)
"""2026-03-01T06:00:00Z, 20260301_060000, IMG_20260301-0600, 2026-03-01 06.00.00.123+0100, ..."""

_EPOCH = re.compile(r"(?<!\d)(1\d{9})(?:[._]?(\d{3}))?(?:\d{3}){0,2}(?!\d)")
"""Seconds since 1970 between 2001 and 2033, with or without milli-, micro- or nanoseconds."""


def time_in_name(name: str) -> float | None:
    """Seconds since 1970 that a file's name carries (UTC where it names no zone); None where it carries none."""
    base = re.split(r"[/\\]", name)[-1]
    found = _ISO.search(base)
    if found is not None:
        return _of_iso(found)
    epoch = _EPOCH.search(base)
    return None if epoch is None else float(epoch[1]) + float(epoch[2] or 0) / 1000.0


def _of_iso(found: re.Match[str]) -> float | None:
    year, month, day, hour, minute, second, fraction, _, sign, zone_hours, zone_minutes = found.groups()
    try:
        moment = datetime(int(year), int(month), int(day), int(hour), int(minute), int(second or 0), tzinfo=UTC)
    except ValueError:
        return None
    shift = timedelta(hours=int(zone_hours or 0), minutes=int(zone_minutes or 0))
    moment -= -shift if sign == "-" else shift
    return moment.timestamp() + (float(f"0.{fraction}") if fraction else 0.0)


@dataclass(frozen=True)
class Clock:
    """Times of frames in their order."""

    interval: float | None = None
    """Seconds between frames that have no time at all."""
    start: float | None = None
    """Time of the first of them."""

    def time(self, index: int, own: float | None, name: str) -> float | None:
        """A frame's own time since 1970, else the one in its name, else its own time since the recording's start."""
        if own is not None and own > ABSOLUTE:
            return own
        named = time_in_name(name)
        if named is not None:
            return named
        if own is not None or self.interval is None:
            return own
        return (self.start or 0.0) + index * self.interval
