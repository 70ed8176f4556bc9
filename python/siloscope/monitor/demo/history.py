"""What happened in a silo of the farm over two years, and what its camera said of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.monitor.clock import DAY, HOUR, MINUTE
from siloscope.monitor.demo.silos import FarmSilo

BEFORE, AHEAD = 730 * DAY, 60 * DAY

STEP = 10 * MINUTE

FINE = 60 * DAY
"""Of which there is a reading every ten minutes; before, every hour."""

OWN_STD, SHARED_STD = 0.0015, 0.012
"""Deviations of a volume as fractions of the capacity: from frame to frame, and common to all."""


@dataclass(frozen=True)
class History:
    """Times (µs) and true volumes (m³), from two years before the farm was made to two months after."""

    time: NDArray[np.int64]
    volume: NDArray[np.float64]

    def at(self, time: int) -> float:
        """The volume at a time."""
        return float(np.interp(time, self.time, self.volume))


def history(silo: FarmSilo, begin: int) -> History:
    """Feeding by day, less at weekends, and a delivery whenever it runs low; the same for the same silo and time."""
    draw = np.random.default_rng((silo.seed, 20))
    time = np.arange(begin - BEFORE, begin + AHEAD, STEP)
    days = (time - time[0]) // DAY
    hours = (time % DAY) / HOUR
    whole = int(days[-1]) + 1
    of_day = np.clip(draw.normal(1.0, 0.15, whole), 0.4, 1.6) * np.where(np.arange(whole) % 7 > 4, 0.8, 1.0)
    feeding = np.where((hours > 5) & (hours < 9), 3.0, np.where((hours > 15) & (hours < 19), 2.4, 0.12))
    rate = feeding / feeding[: DAY // STEP].mean() * of_day[days] * silo.daily * silo.full * STEP / DAY
    return History(time, _with_deliveries(rate, silo.full, draw))


def _with_deliveries(rate: NDArray[np.float64], full: float, draw: np.random.Generator) -> NDArray[np.float64]:
    """The volume that a use (m³ a step) leaves; a delivery takes three steps."""
    volume = np.empty(len(rate))
    now, low, steps, portion = 0.7 * full, 0.18 * full, 0, 0.0
    for step, used in enumerate(rate.tolist()):
        now = max(0.0, now - used)
        if not steps and now < low:
            steps, portion = 3, (draw.uniform(0.82, 0.93) * full - now) / 3.0
            low = draw.uniform(0.12, 0.3) * full
        if steps:
            now, steps = now + portion, steps - 1
        volume[step] = now
    return volume


def readings(silo: FarmSilo, told: History, until: int, common: dict[str, Any]) -> list[dict[str, Any]]:
    """Rows of the table of readings up to a time."""
    draw = np.random.default_rng((silo.seed, 21))
    fine = told.time > until - FINE
    chosen = (told.time <= until) & (fine | (told.time % HOUR < STEP))
    time, true = told.time[chosen], told.volume[chosen]
    seen = np.maximum(0.0, true + draw.normal(0.0, OWN_STD * silo.full, len(true)))
    coverage = np.clip(draw.normal(0.82, 0.04, len(true)), 0.4, 1.0)
    keep = draw.random(len(true)) > 0.01
    rows = zip(time[keep].tolist(), seen[keep].tolist(), coverage[keep].tolist(), strict=True)
    return [_row(silo, *row, common) for row in rows]


def _row(silo: FarmSilo, time: int, volume: float, coverage: float, common: dict[str, Any]) -> dict[str, Any]:
    capacity, density = common["capacity"], common["density"]
    std = silo.full * SHARED_STD
    level = silo.level(volume) * silo.silo.height
    mass = volume * density
    return {
        **common,
        "time": time,
        "volume": volume,
        "volume_std": std,
        "own_std": OWN_STD * silo.full,
        "ullage": capacity - volume,
        "ullage_std": std,
        "fill": volume / capacity,
        "mass": mass,
        "mass_std": mass * 0.05,
        "level": level,
        "level_min": 0.9 * level,
        "level_max": 1.1 * level,
        "level_axis": level,
        "level_std": 0.01,
        "distance": silo.silo.apex - level,
        "distance_min": silo.silo.apex - 1.1 * level,
        "distance_max": silo.silo.apex - 0.9 * level,
        "coverage": coverage,
    }
