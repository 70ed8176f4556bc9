"""The simulated farm says what is wrong with it, and nothing else."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from monitor.farm import NOON
from siloscope.monitor import alerts
from siloscope.monitor.clock import DAY, HOUR
from siloscope.monitor.demo import history
from siloscope.monitor.demo.silos import SILOS, FarmSilo

COMMON = {"capacity": 20.0, "density": 700.0}


def days(silo: FarmSilo) -> tuple[list[Any], history.History]:
    """The readings of a silo's last weeks, and the truth."""
    told = history.history(silo, NOON)
    rows = history.readings(silo, told, NOON, COMMON | {"capacity": silo.silo.capacity})
    return [SimpleNamespace(**row) for row in rows if row["time"] > NOON - 22 * DAY], told


def used(told: history.History, since: int, until: int) -> float:
    """What is really taken out a day, m³."""
    chosen = (told.time >= since) & (told.time <= until)
    falls = -np.diff(told.volume[chosen])
    return float(falls[falls > 0].sum()) / ((until - since) / DAY)


@pytest.mark.parametrize("silo", SILOS, ids=[silo.id for silo in SILOS])
def test_noise_between_readings_is_no_use(silo: FarmSilo) -> None:
    """At 80 moments of 20 days, deliveries among them, the last day differs from the usual one as it really does."""
    rows, told = days(silo)
    daily = used(told, NOON - 28 * DAY, NOON)
    fires = 0
    for end in range(NOON - 20 * DAY, NOON, 6 * HOUR):
        day = [row for row in rows if end - DAY <= row.time <= end]
        seen = alerts.Seen(end, 2 * HOUR, day[-1], [day[-1]], [], day, daily)
        found = alerts.values(seen)["consumption"].value
        assert found == pytest.approx(abs(used(told, day[0].time, day[-1].time) / daily - 1.0), abs=0.13)
        fires += found > 0.5
    assert fires <= 1


@pytest.mark.parametrize("factor", [0.3, 2.0])
def test_unusual_use_is_told(factor: float) -> None:
    rows, told = days(SILOS[0])
    daily = used(told, NOON - DAY, NOON)
    day = [row for row in rows if row.time > NOON - DAY]
    seen = alerts.Seen(NOON, 2 * HOUR, day[-1], [day[-1]], [], day, daily / factor)
    assert alerts.values(seen)["consumption"].value > 0.5
