"""What the service runs by: where its data are, what it listens on, and its limits."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from siloscope.monitor.clock import DAY, HOUR, MINUTE

MIB = 1 << 20

HOST, PORT = "127.0.0.1", 8480


@dataclass(frozen=True)
class Limits:
    """What bounds a request and a measurement."""

    body: int = 16 * MIB
    """Largest frame file, bytes."""
    queue: int = 20_000
    """Frames that may wait; more are refused with 429 until some are measured."""
    reserve: int = 256 * MIB
    """Free disk space that frames may not use, bytes; readings and alerts still go on in it."""
    reserve_fraction: float = 0.05
    """And no more than this fraction of the disk."""
    attempts: int = 3
    """How often a frame is tried that ends its worker."""
    measure_s: float = 60.0
    """Longest time of a measurement."""
    calibrate_s: float = 1800.0
    """Longest time of a calibration."""
    memory: int = 4096 * MIB
    """Address space of a worker, bytes."""


@dataclass(frozen=True)
class Retention:
    """How long things stay. Readings stay for ever."""

    frames: int = 30 * DAY
    """Every frame; older ones: one a day."""
    surfaces: int = 90 * DAY
    """Every surface; older ones: one a day."""
    changes: int = 30 * DAY
    audit: int = 730 * DAY
    every: int = HOUR


@dataclass(frozen=True)
class Settings:
    """Of one service."""

    data: Path
    """Folder of the database and the frames."""
    database: str | None = None
    """SQLAlchemy URL; None for SQLite in `data`."""
    site: Path | None = None
    """SITE.toml, applied at every start."""
    host: str = HOST
    port: int = PORT
    workers: int = 1
    live: tuple[tuple[str, str], ...] = ()
    """Cameras that the service drives beside those of SITE.toml, and their sources."""
    idle_s: float = 300.0
    """A worker without a frame for so long ends, and starts again with the next."""
    tick: int = MINUTE
    """How often rules see that nothing has come."""
    limits: Limits = field(default_factory=Limits)
    retention: Retention = field(default_factory=Retention)

    @property
    def url(self) -> str:
        """Of the database."""
        return self.database or f"sqlite:///{(self.data / 'siloscope.db').absolute()}"

    @property
    def loopback(self) -> bool:
        """Whether only this machine can reach it."""
        return self.host in ("127.0.0.1", "::1", "localhost")
