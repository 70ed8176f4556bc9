"""``monitor.json`` of a store whose frames come from a monitor.

It names the monitor's silo, camera and calibration of every series, so that a run of the frames can be imported, and
what the monitor measures each silo with, which a run takes unless it is told otherwise.
"""

from __future__ import annotations

import json
from typing import Any

from siloscope.fleet.store import Missing, Store

SCHEMA = "siloscope.packed-monitor/1"

NAME = "monitor.json"


def told_of(store: Store) -> dict[str, Any]:
    """What the document says; nothing where the frames come from elsewhere."""
    try:
        return dict(json.loads(store.get(NAME)))
    except Missing:
        return {}
