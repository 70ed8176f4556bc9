"""What a vessel is drawn from: the lengths of its calibration, and what was told of it."""

from __future__ import annotations

from collections import OrderedDict
from typing import Any

from sqlalchemy import Connection

from siloscope.monitor.api import models
from siloscope.monitor.store import places

KEPT = 4096
"""Calibrations whose lengths are remembered; a calibration never changes."""

_Lengths = tuple[float | None, float | None, float | None]

_seen: OrderedDict[str, _Lengths] = OrderedDict()


def vessel(connection: Connection, told: dict[str, Any], reading: Any) -> models.Vessel:
    """Of a silo, as the reading has it: what was seen first, then what was told."""
    radius, bottom, apex = _lengths(connection, None if reading is None else reading.calibration)
    if radius is None and told.get("diameter"):
        radius = told["diameter"] / 2.0
    top = told.get("top")
    if bottom is None and top is not None and told.get("cylinder") is not None:
        bottom = top + told["cylinder"]
    if apex is None and bottom is not None and told.get("cone") is not None:
        apex = bottom + told["cone"]
    return models.Vessel(
        radius_m=radius,
        top_z_m=top,
        cylinder_bottom_z_m=bottom,
        bottom_z_m=apex,
        bottom=told.get("bottom") or ("cone" if apex is not None else None),
        datum_z_m=_datum(reading),
    )


def _datum(reading: Any) -> float | None:
    if reading is None or reading.distance is None or reading.level is None:
        return None
    return float(reading.distance + reading.level)


def _lengths(connection: Connection, calibration: str | None) -> _Lengths:
    """Radius, the cylinder's bottom and the apex (z) as a calibration has them."""
    if calibration is None:
        return None, None, None
    if calibration not in _seen:
        row = places.calibration_get(connection, calibration)
        silo = {} if row is None else places.document(row)["silo"]
        _seen[calibration] = (silo.get("radius"), silo.get("cylinder_bottom"), silo.get("apex"))
        if len(_seen) > KEPT:
            _seen.popitem(last=False)
    return _seen[calibration]
