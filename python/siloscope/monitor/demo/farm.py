"""The farm is made once, at the first start, and then goes on by itself."""

from __future__ import annotations

import json
import multiprocessing
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from siloscope import _core
from siloscope.calibrate import calibrate
from siloscope.content.density import products
from siloscope.monitor import access, surfaces
from siloscope.monitor.clock import DAY
from siloscope.monitor.demo import cameras, history
from siloscope.monitor.demo.silos import CAMERA, SENSOR, SILOS, UNIT, FarmSilo
from siloscope.monitor.service import Service
from siloscope.monitor.store import people, places, readings
from siloscope.monitor.store.engine import Store
from siloscope.types.calibration import Calibration

ZONE = "Europe/Madrid"

CALIBRATED_AT = (0.08, 0.2, 0.35, 0.55, 0.75)
"""Fill fractions of the frames that a camera is calibrated from."""

SURFACES = 60
"""Days of which there is a surface."""

CHUNK = 20_000

STALE_S = 7200


def start(service: Service, root: str) -> None:
    """Makes the farm where there is none, and starts its cameras."""
    with service.store.read() as connection:
        begin = places.fact(connection, "demo")
    if begin is None:
        begin = service.clock.now()
        make(service, begin)
    tokens = _camera_tokens(service)
    context = multiprocessing.get_context("spawn")
    arguments = (root, tokens, int(begin))
    context.Process(target=cameras.run, args=arguments, daemon=True, name="siloscope-demo-cameras").start()
    for silo in SILOS:
        service.changed(silo.id, service.clock.now() - history.BEFORE)


def make(service: Service, begin: int) -> None:
    """Places, silos, cameras, calibrations, and two years of readings."""
    found = {silo.id: calibrated(silo) for silo in SILOS}
    with service.store.write() as connection:
        places.set_fact(connection, "name", "Simulated farm")
        places.set_fact(connection, "zone", ZONE)
        for key, parent, kind, name in (
            ("mill", None, "mill", "Mill"),
            ("farm", "mill", "farm", "Simulated farm"),
            ("north", "farm", "barn", "North barn"),
            ("south", "farm", "barn", "South barn"),
        ):
            places.put(connection, "place", key, {"parent": parent, "kind": kind, "name": name}, begin)
        run = readings.run_of(
            connection, _core.__version__, "demo", "simulated", begin, "history of the simulated farm"
        )
        for silo in SILOS:
            _add(connection, silo, found[silo.id], begin)
    for silo in SILOS:
        _add_history(service.store, silo, run, begin)
    with service.store.write() as connection:
        places.set_fact(connection, "demo", begin)


def calibrated(silo: FarmSilo) -> Calibration:
    """From simulated frames at several levels, as a user would do it."""
    scenes = [silo.scene(fill * silo.full, 1000 * silo.seed + k) for k, fill in enumerate(CALIBRATED_AT)]
    frames = [replace(scene.render().frame(), source=f"{silo.camera} {k}") for k, scene in enumerate(scenes)]
    return calibrate(frames, sensor=SENSOR, bottom="cone")


def _add(connection: Any, silo: FarmSilo, calibration: Calibration, begin: int) -> None:
    density = products()[silo.product]
    values = {"name": density.name, "density": density.loose, "density_std": density.std, "document": asdict(density)}
    places.put(connection, "product", silo.product, values, begin)
    shape = silo.silo
    vessel = {
        "top": shape.top,
        "cylinder": shape.cylinder_height,
        "bottom": "cone",
        "outlet_diameter": 2.0 * shape.outlet_radius,
    }
    values = {"name": silo.name, "place": silo.place, "product": silo.product, "vessel": vessel}
    values |= {"stale_after_s": STALE_S, "capacity": shape.capacity, "modbus_unit": silo.seed}
    places.put(connection, "silo", silo.id, values, begin)
    places.fill(connection, silo.id, silo.product, 0)
    text = json.dumps(CAMERA.to_dict() | {"depth_unit": UNIT})
    values = {"silo": silo.id, "intrinsics": text, "sensor": SENSOR, "depth_unit": UNIT, "expected_s": 60}
    places.put(connection, "camera", silo.camera, values, begin)
    row = {"origin": "site", "state": places.CONFIRMED, "valid_from": 0, "confirmed_by": "simulated"}
    places.add_calibration(
        connection, silo.id, silo.camera, calibration.to_dict(), begin, frames=len(calibration.frames), **row
    )


def _add_history(store: Store, silo: FarmSilo, run: int, begin: int) -> None:
    told = history.history(silo, begin)
    with store.read() as connection:
        calibration = places.calibration_at(connection, silo.camera, begin)
        product = places.product_at(connection, silo.id, begin)
    until = begin - 26 * DAY // 24 if silo.fault == "silent" else begin
    common: dict[str, Any] = {
        "silo": silo.id,
        "camera": silo.camera,
        "clock": "good",
        "run": run,
        "calibration": None if calibration is None else calibration.id,
        "status": "ok",
        "capacity": silo.silo.capacity,
        "density": 0.0 if product is None else product.density,
        "datum": "cone-vertex",
        "quality": [],
    }
    rows = history.readings(silo, told, until, common)
    for k in range(0, len(rows), CHUNK):
        with store.write() as connection:
            readings.insert_many(connection, rows[k : k + CHUNK])
    _add_surfaces(store, silo, told, until)


def _add_surfaces(store: Store, silo: FarmSilo, told: history.History, until: int) -> None:
    """One a day, and the last one."""
    with store.write() as connection:
        for day in range(SURFACES):
            row = readings.last(connection, silo.id, answered=True, until=until + 1 - day * DAY)
            if row is not None:
                readings.add_surface(connection, row, surface(silo, told.at(row.time)))


def surface(silo: FarmSilo, volume: float) -> bytes:
    """The feed's true surface as a reading keeps it, with a deviation that grows towards the wall."""
    side, radius = surfaces.SIDE, silo.silo.radius
    middles = (np.arange(side) + 0.5) / side * 2.0 * radius - radius
    x, y = np.meshgrid(middles, middles)
    away = np.hypot(x, y)
    feed = replace(silo.feed, level=silo.level(volume))
    heights = silo.silo.feed_heights(feed, np.stack([x, y], axis=-1))
    inside = (away <= radius) & np.isfinite(heights)
    seen = inside & (np.hypot(x - silo.at[0], y - silo.at[1]) < 1.7 * radius)
    std = np.where(inside, 0.004 + 0.03 * ~seen, np.nan)
    return surfaces.packed(np.where(inside, heights, np.nan), std, seen.astype(np.uint8), radius)


def _camera_tokens(service: Service) -> dict[str, str]:
    """A new token for each camera, for the process that plays the cameras."""
    now = service.clock.now()
    tokens = {}
    with service.store.write() as connection:
        for silo in SILOS:
            tokens[silo.camera] = access.new_secret("silo_camera")
            people.add_token(connection, access.hash_of(tokens[silo.camera]), "camera", silo.camera, "simulated", now)
    return tokens
