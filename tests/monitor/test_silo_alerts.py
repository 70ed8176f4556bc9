"""A silo's alerts over days: values that flap, data that stop and come back, delays that hold for every kind."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from monitor import farm
from monitor.farm import Farm
from siloscope.monitor.clock import MINUTE
from siloscope.monitor.store import alerts

DELAYED = '[[rule]]\nid = "no-data"\nkind = "no-data"\nlevel = 1200\nclear = 1200\ndelay_s = 1800\n'


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Farm]:
    made = farm.make(tmp_path, DELAYED)
    yield made
    farm.close(made)


def told(service: Farm, fill: float, minutes: int = 10) -> None:
    """A reading so many minutes later, and a look at it."""
    service.clock.time += minutes * MINUTE
    farm.reading(service, fill=fill)
    farm.look(service)


def waits(service: Farm, minutes: int) -> None:
    """Time passes without a reading; the rules look every minute."""
    for _ in range(minutes):
        service.clock.time += MINUTE
        farm.look(service)


def found(service: Farm, kind: str) -> list[Any]:
    with service.store.read() as connection:
        rows = alerts.listed(connection, silo="silo7", firing=None, before=None, count=100)
    return [row for row in rows if row.kind == kind]


def firing(service: Farm) -> set[str]:
    with service.store.read() as connection:
        return {row.kind for row in alerts.firing(connection) if row.silo == "silo7"}


def test_a_silo_that_flaps_about_its_level_rings_once(service: Farm) -> None:
    for number in range(60):
        told(service, 0.199 if number % 2 else 0.205)
    assert len(found(service, "low")) == 1
    told(service, 0.3)
    assert firing(service) == set()
    assert len(found(service, "low")) == 1


def test_no_data_is_an_alert_of_its_own_and_keeps_the_others(service: Farm) -> None:
    told(service, 0.15)
    assert firing(service) == {"low"}
    (low,) = found(service, "low")
    with service.store.write() as connection:
        alerts.acknowledge(connection, low.id, "Anna", None, service.clock.now())
    waits(service, 60)
    assert firing(service) == {"low", "no-data"}
    told(service, 0.14)
    assert firing(service) == {"low"}
    (same,) = found(service, "low")
    assert (same.id, same.acknowledged_by, same.resolved) == (low.id, "Anna", None)
    assert len(found(service, "no-data")) == 1


def test_no_data_waits_its_delay_as_any_other(service: Farm) -> None:
    told(service, 0.5)
    waits(service, 20 + 25)
    assert firing(service) == set()
    told(service, 0.5, 0)  # it came back in time
    waits(service, 20 + 25)
    assert firing(service) == set()
    waits(service, 10)
    assert firing(service) == {"no-data"}
    (alert,) = found(service, "no-data")
    assert alert.fired - alert.since >= 30 * MINUTE


def test_an_outage_between_two_levels_ends_nothing_and_begins_nothing(service: Farm) -> None:
    told(service, 0.5)
    waits(service, 60)
    told(service, 0.22)  # between the levels: neither low nor known to have been
    assert firing(service) == set()
    told(service, 0.19)
    waits(service, 60)
    told(service, 0.22)
    assert firing(service) == {"low"}


def test_a_look_before_the_first_reading_does_not_make_it_late(service: Farm) -> None:
    """Frames are measured some time after they were taken; the rules may have looked in between."""
    taken = service.clock.now()
    waits(service, 2)
    farm.reading(service, time=taken, fill=0.1)
    farm.look(service)
    assert firing(service) == {"low"}
