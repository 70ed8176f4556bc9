"""Months of a silo's life as stored readings: use, deliveries, dust, outages, a dirty lens, a moved camera."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from siloscope.types.track import DAY, Reading

HOUR = 3600.0
START = 1.77e9
DAYS = 30
FORWARD = 120
"""Days of use that are drawn beyond the story, for the truth of the forecast."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Delivery:
    """A refill: time, s, and amount, m³."""

    time: float
    amount: float


@dataclass(frozen=True)
class Story:
    """Readings beside what happened. Volumes in m³."""

    readings: tuple[Reading, ...]
    deliveries: tuple[Delivery, ...]
    capacity: float
    times: Array
    """Hourly, s, from the beginning to `FORWARD` days after the end."""
    used: Array
    """What was used since the beginning at `times`."""

    def volume(self, time: float) -> float:
        """What is in the silo."""
        delivered = sum(d.amount for d in self.deliveries if d.time <= time)
        return self.readings_begin + delivered - float(np.interp(time, self.times, self.used))

    readings_begin: float = 0.0

    def empty_at(self, time: float) -> float:
        """When what is there at a time is used up without another delivery."""
        end = float(np.interp(time, self.times, self.used)) + self.volume(time)
        return float(np.interp(end, self.used, self.times, right=np.inf))


def draw(seed: int) -> Story:
    """A month."""
    rng = np.random.default_rng((seed, 20))
    capacity = float(np.exp(rng.uniform(np.log(5.0), np.log(200.0))))
    times = START + HOUR * np.arange((DAYS + FORWARD) * 24, dtype=np.float64)
    used = _use(rng, len(times), capacity * rng.uniform(0.02, 0.12))
    begin = capacity * rng.uniform(0.4, 0.95)
    deliveries = _deliveries(rng, times[: DAYS * 24], used, begin, capacity)
    told = Story((), tuple(deliveries), capacity, times, used, begin)
    return replace(told, readings=tuple(_readings(rng, told)))


def _use(rng: np.random.Generator, hours: int, daily: float) -> Array:
    """Days that follow each other in part, weekends in half of the stories, meals in half of them."""
    factors, z = [], 0.0
    weekend = rng.uniform(0.6, 1.0) if rng.uniform() < 0.5 else 1.0
    for day in range(hours // 24):
        z = 0.4 * z + np.sqrt(1.0 - 0.16) * rng.normal()
        factors.append(max(1.0 + 0.2 * z, 0.1) * (weekend if day % 7 > 4 else 1.0))
    profile = np.ones(24) / 24.0
    if rng.uniform() < 0.5:
        profile = np.where(np.isin(np.arange(24), (5, 10, 15, 20)), 0.25, 0.0)
    rate = daily * np.repeat(factors, 24) * np.tile(profile, hours // 24)
    return np.concatenate([[0.0], np.cumsum(rate)[:-1]])


def _deliveries(rng: np.random.Generator, times: Array, used: Array, begin: float, capacity: float) -> list[Delivery]:
    """A truck by day when little is left, some in two loads; now and then a little between."""
    made: list[Delivery] = []
    low, volume, last = rng.uniform(0.08, 0.3), begin, 0.0
    for hour, time in enumerate(times):
        volume -= used[hour] - last
        last = used[hour]
        if 8 <= hour % 24 <= 16 and volume < low * capacity and rng.uniform() < 0.2:
            amount = capacity * rng.uniform(0.6, 0.97) - volume
            parts = (0.6, 0.4) if rng.uniform() < 0.3 else (1.0,)
            made += [Delivery(time + HOUR * (2 * k + rng.uniform(0.1, 0.9)), amount * p) for k, p in enumerate(parts)]
            volume, low = volume + amount, rng.uniform(0.08, 0.3)
        elif volume < 0.8 * capacity and rng.uniform() < 2.0 / len(times):
            made.append(Delivery(time + HOUR * rng.uniform(0.1, 0.9), capacity * rng.uniform(0.025, 0.06)))
            volume += made[-1].amount
    return made


def _readings(rng: np.random.Generator, told: Story) -> list[Reading]:
    capacity, hours = told.capacity, DAYS * 24
    own = capacity * np.exp(rng.uniform(np.log(1e-4), np.log(6e-4)))
    dirty_from, dirty = rng.uniform(0.3, 0.9) * hours, rng.uniform(1.0, 4.0)
    scale = 1.0 + 0.003 * rng.normal()
    hidden = 0.002 * capacity * rng.normal()
    moved_at = rng.uniform(0.3, 0.8) * hours if rng.uniform() < 0.5 else np.inf
    moved, moved_refused = 0.01 * capacity * rng.normal(), rng.uniform() < 0.5
    outages = [(s, s + rng.uniform(3.0, 60.0)) for s in rng.uniform(0, hours, rng.integers(1, 4))]
    found: list[Reading] = []
    for hour in range(hours):
        time = START + HOUR * (hour + rng.uniform(-0.05, 0.05))
        if any(a <= hour < b for a, b in outages):
            continue
        since = min((time - d.time for d in told.deliveries if d.time <= time), default=np.inf) / HOUR
        dust = since < rng.uniform(0.0, 4.0)
        growth = 1.0 + dirty * max(hour - dirty_from, 0.0) / hours
        std = own * growth
        true = told.volume(time)
        volume = scale * true + hidden * np.sin(6.0 * true / capacity) + std * rng.normal()
        total, quality, coverage = np.hypot(std, 0.004 * capacity), [], 0.8 / growth
        status = "refused" if rng.uniform() < (0.4 if dust else 0.02) else "ok"
        if growth > 2.0:
            quality.append("lens-film")
        if dust:
            volume += 0.08 * capacity * rng.uniform(-1.0, 1.0)
            quality.append("dust-or-fog")
            coverage *= rng.uniform(0.2, 0.6)
        elif rng.uniform() < 0.005:
            volume += 0.15 * capacity * rng.uniform(-1.0, 1.0)
        if hour > moved_at:
            quality.append("camera-moved")
            volume, total = volume + moved, np.hypot(total, abs(moved))
            status = "refused" if moved_refused and hour < moved_at + 48 else status
        reason = "too-little-seen" if status == "refused" else None
        answer = (None, None) if reason else (float(max(volume, 0.0)), float(total))
        found.append(
            Reading(
                len(found), f"{hour}.png", time, status, reason, *answer, coverage=coverage, own_std=float(std),
                density=700.0, quality=tuple(quality), digest=f"{hour}",
                ullage=None if reason else capacity - float(volume), ullage_std=None if reason else float(total),
            )
        )  # fmt: skip
    return found


def refills(story: Story, found: tuple[tuple[float, float], ...]) -> tuple[int, int]:
    """False and missed refills among found ones, which are pairs of beginning and end, s.

    A found refill is true where a delivery came in it; a second one about the same delivery is false. One is missed
    where the readings before and after it, without dust, differ by more than 2 % of the capacity, and a further one
    confirms it.
    """
    explained = [
        {k for k, d in enumerate(story.deliveries) if start - HOUR < d.time < end + HOUR} for start, end in found
    ]
    false, known = 0, set[int]()
    for deliveries in explained:
        false += not deliveries - known
        known |= deliveries
    missed = 0
    clean = [r for r in story.readings if r.status == "ok" and "dust-or-fog" not in r.quality and r.time is not None]
    for k, delivery in enumerate(story.deliveries):
        before = [r for r in clean if (r.time or 0.0) < delivery.time]
        after = [r for r in clean if (r.time or 0.0) > delivery.time]
        if k in known or not before or len(after) < 2:
            continue
        rise = story.volume(after[0].time or 0.0) - story.volume(before[-1].time or 0.0)
        missed += rise > 0.02 * story.capacity
    return false, missed


def until(story: Story, day: float) -> tuple[Reading, ...]:
    """The readings of the first days."""
    return tuple(r for r in story.readings if (r.time or 0.0) < START + DAY * day)
