"""How often somebody may fail to sign in."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field

from siloscope.monitor.clock import MINUTE, SECOND

FREE = 5
"""Failures without a wait."""

LONGEST = 15 * MINUTE

MOST = 10_000
"""Names and addresses that are remembered."""


@dataclass
class Throttle:
    """Failures by name and by address; each one beyond the free ones doubles the wait."""

    failures: OrderedDict[str, tuple[int, int]] = field(default_factory=OrderedDict)
    """Key: number of failures, time of the last one."""

    def wait(self, keys: tuple[str, ...], now: int) -> int:
        """µs until the next try is allowed; 0 for now."""
        return max(self._wait(key, now) for key in keys)

    def _wait(self, key: str, now: int) -> int:
        count, last = self.failures.get(key, (0, now))
        if count < FREE:
            return 0
        return max(0, last + min(SECOND << min(count - FREE, 20), LONGEST) - now)

    def failed(self, keys: tuple[str, ...], now: int) -> None:
        """Counts a failure."""
        for key in keys:
            count, last = self.failures.pop(key, (0, now))
            self.failures[key] = (1 if now - last > 2 * LONGEST else count + 1, now)
        while len(self.failures) > MOST:
            self.failures.popitem(last=False)

    def succeeded(self, keys: tuple[str, ...]) -> None:
        """Forgets failures."""
        for key in keys:
            self.failures.pop(key, None)
