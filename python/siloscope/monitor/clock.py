"""Times: microseconds of UTC as the store has them, and how far the time of a frame can be trusted."""

from __future__ import annotations

import time
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Protocol
from zoneinfo import ZoneInfo

SECOND = 1_000_000
"""Microseconds."""

MINUTE, HOUR, DAY = 60 * SECOND, 3600 * SECOND, 86_400 * SECOND

EARLIEST = 1_735_689_600 * SECOND
"""2025-01-01: no camera of this program took a frame before; a clock that says so was never set."""

AHEAD = 5 * MINUTE
"""A capture time may be so far in the server's future before it counts as wrong."""

GOOD, CORRECTED, SUSPECT = "good", "corrected", "suspect"


class Clock(Protocol):
    """Where the service has its time from; tests give their own."""

    def now(self) -> int:
        """Microseconds since 1970, UTC."""


class SystemClock:
    """The machine's clock."""

    def now(self) -> int:
        """Microseconds since 1970, UTC."""
        return time.time_ns() // 1000


@dataclass
class SetClock:
    """A clock that stands until it is set."""

    time: int

    def now(self) -> int:
        """Microseconds since 1970, UTC."""
        return self.time


@dataclass(frozen=True)
class Capture:
    """When a frame was taken, and how that is known."""

    time: int
    clock: str
    """`GOOD`: the sender's time; `CORRECTED`: the server's time less the age that the sender measured without a clock,
    or the time of arrival where it sent none; `SUSPECT`: a time that can't be right."""


def capture(told: int | None, age: int | None, received: int) -> Capture:
    """The capture time of a frame.

    Parameters
    ----------
    told : int or None
        What the sender's clock said, µs.
    age : int or None
        How long ago it was taken by the sender's monotonic clock, µs; wins over `told`.
    received : int
        The server's time, µs.
    """
    if age is not None or told is None:
        time = received - (age or 0)
        return Capture(time, SUSPECT if time < EARLIEST else CORRECTED)
    if told < EARLIEST or told > received + AHEAD:
        return Capture(told, SUSPECT)
    return Capture(told, GOOD)


def iso(micros: int) -> str:
    """RFC 3339 in UTC with milliseconds."""
    return datetime.fromtimestamp(micros / SECOND, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def moment(micros: int) -> datetime:
    """As a `datetime` in UTC."""
    return datetime.fromtimestamp(micros // SECOND, UTC).replace(microsecond=micros % SECOND)


def micros(text: str) -> int:
    """Of an RFC 3339 time; raises `ValueError` where it is none or names no zone."""
    found = datetime.fromisoformat(text)
    if found.tzinfo is None:
        raise ValueError("the time names no zone")
    return int(found.timestamp()) * SECOND + found.microsecond


def zone(name: str) -> str:
    """Checks the name of a time zone; raises `ValueError` where the machine knows none of this name."""
    try:
        ZoneInfo(name)
    except (ValueError, OSError, KeyError):
        raise ValueError(f"must be a time zone such as Europe/Madrid, not {name[:40]!r}") from None
    return name
