"""Frames of a monitor's store for sealing: by camera and calibration in force, with the silo's settings.

``monitor.json`` in the store leads back (`siloscope.fleet.origin`).
"""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from siloscope.errors import InputError
from siloscope.fleet import settings
from siloscope.fleet.naming import Series, as_id
from siloscope.fleet.origin import NAME, SCHEMA, told_of
from siloscope.fleet.store import Store
from siloscope.io.archive_layout import document_bytes
from siloscope.monitor import worker
from siloscope.monitor.blobs import Blobs
from siloscope.monitor.clock import SECOND
from siloscope.monitor.settings import Settings as MonitorSettings
from siloscope.monitor.store import frames, places
from siloscope.monitor.store.engine import Store as Database
from siloscope.monitor.store.engine import opened
from siloscope.monitor.workers import camera_of
from siloscope.types.calibration import Calibration
from siloscope.types.frame import Frame

ATTEMPTS = 20
"""Times that the document is written anew because another packing was quicker."""


@dataclass(frozen=True)
class Measured:
    """What a monitor's camera measured with one calibration."""

    silo: str
    camera: str
    calibration: str
    document: bytes
    settings: worker.CameraSettings
    rows: tuple[Any, ...]
    """Its frames in their order."""


class Monitor:
    """A monitor's database and the bytes of its frames.

    Parameters
    ----------
    data : path
        The folder of ``siloscope serve --data``.
    database : str, optional
        Its ``--database``.
    """

    def __init__(self, data: Path, database: str | None) -> None:
        if not (data / "frames").is_dir() or (database is None and not (data / "siloscope.db").is_file()):
            raise InputError(f"{data}: no monitor's data; give the --data folder of `siloscope serve`")
        self.store: Database = opened(MonitorSettings(data, database).url)
        self.blobs = Blobs(data / "frames")

    def measured(self, silo: str | None) -> Iterator[Measured]:
        """What can be sealed: frames whose bytes are there and whose time is known, of all silos or one."""
        with self.store.read() as connection:
            for camera in places.listed(connection, "camera"):
                if silo not in (None, camera.silo):
                    continue
                found: dict[str, list[Any]] = {}
                calibrations: dict[str, Any] = {}
                for row in frames.dated(connection, camera.id):
                    calibration = places.calibration_at(connection, camera.id, row.captured)
                    if calibration is not None:
                        calibrations[calibration.id] = calibration
                        found.setdefault(calibration.id, []).append(row)
                for key, rows in found.items():
                    document = places.document_bytes(calibrations[key])
                    yield Measured(camera.silo, camera.id, key, document, camera_of(camera), tuple(rows))

    def frames(self, measured: Measured, problems: list[str]) -> Iterator[Frame]:
        """The frames themselves; those that can't be read are left out and told in `problems`."""
        for row in measured.rows:
            try:
                frame = worker.frame_of(self.blobs.path(row.sha256), measured.settings)
            except InputError as error:
                problems.append(f"{measured.camera} {row.id}: {error}")
                continue
            yield replace(frame, timestamp=row.captured / SECOND, source=f"{measured.camera} {row.id}")

    def settings_of(self, silo: str) -> dict[str, Any]:
        """What a silo is measured with here, as a run's settings have it."""
        with self.store.read() as connection:
            row = places.get(connection, "silo", silo)
            cameras = [one for one in places.listed(connection, "camera") if one.silo == silo]
            product = places.product_at(connection, silo, 1 << 62)
        told = {} if row is None else dict(row.vessel)
        sensors = {one.sensor for one in cameras}
        if len(sensors) == 1 and (sensor := sensors.pop()) is not None:
            told["sensor"] = sensor
        told = settings.with_texts(told, Path())
        return told if product is None else told | {"product": _product(product.document)}

    def close(self) -> None:
        """Lets go of the database."""
        self.store.close()


def _product(document: dict[str, Any]) -> dict[str, str]:
    """A product's document as the text of a product file."""
    numbers = {
        "density": document["loose"],
        "density_std": document.get("std", 0.0),
        "friction": document.get("friction"),
        "pressure_ratio": document.get("pressure_ratio"),
        "steepest_repose": None if document.get("steepest") is None else math.degrees(document["steepest"]),
        "compaction": [list(entry) for entry in document.get("compaction", ())] or None,
    }
    lines = [f"name = {json.dumps(document['name'])}"]
    lines += [f"{name} = {value!r}" for name, value in numbers.items() if value is not None]
    return {"name": f"{as_id(document['name'])}.toml", "text": "\n".join(lines) + "\n"}


def series_of(store: Store, measured: Measured, told: dict[str, Any]) -> Series:
    """The series of what was measured with a calibration; the same one in every packing.

    A camera's first calibration has the camera's name, a later one a name of its own, because the frames of a series
    have one calibration. The name is noted before a frame is sealed under it.
    """
    for _ in range(ATTEMPTS):
        version = store.version(NAME)
        known = {"schema": SCHEMA, "series": {}, **told_of(store), **told}
        for name, entry in known["series"].items():
            if (entry["camera"], entry["calibration"]) == (measured.camera, measured.calibration):
                series = Series(*name.split("."))
                break
        else:
            plain = as_id(measured.camera)
            series = Series(as_id(measured.silo), plain)
            if series.name in known["series"]:
                series = Series(series.silo, f"{plain[:60]}-{measured.calibration.replace('-', '')[-12:]}")
            entry = {"silo": measured.silo, "camera": measured.camera, "calibration": measured.calibration}
            known["series"] = {**known["series"], series.name: entry}
        if store.exchange(NAME, version, document_bytes(known)):
            return series
    raise InputError(f"{store.place}/{NAME}: other packings keep writing it; run this one again")


def calibration_of(measured: Measured) -> Calibration:
    """The calibration, read as a file is."""
    with tempfile.TemporaryDirectory(prefix="siloscope-") as folder:
        path = Path(folder) / "calibration.json"
        path.write_bytes(measured.document)
        return Calibration.load(path)
