"""The cameras that the service is to drive, as SITE.toml and the command line name them, made parts of it."""

from __future__ import annotations

from pathlib import Path

from siloscope.errors import UsageError
from siloscope.monitor.live.captures import LiveSource
from siloscope.monitor.live.command import CommandSource
from siloscope.monitor.live.device import DeviceSource
from siloscope.monitor.live.driver import Driver
from siloscope.monitor.live.folder import FolderSource
from siloscope.monitor.service import Service
from siloscope.monitor.store import live, places
from siloscope.sensors.live import sensor

KINDS = "realsense, realsense:SERIAL, orbbec, folder:PATH, inbox:PATH, command:WORDS"

DEVICES = ("realsense", "orbbec")


def attach(service: Service) -> None:
    """Adds a driver for each; they start and stop with the service.

    Raises `UsageError` for a source that is none, a camera that is not there, or a device that two cameras share.
    """
    sources = {camera: source_of(service, camera, *entry) for camera, entry in service.live.items()}
    _check_devices({camera: text for camera, (text, _) in service.live.items()})
    with service.store.write() as connection:
        for camera in sources:
            if places.get(connection, "camera", camera) is None:
                raise UsageError(f"--live {camera}: there is no such camera; add a [[camera]] to SITE.toml")
        kinds = {camera: text.partition(":")[0] for camera, (text, _) in service.live.items()}
        live.set_all(connection, kinds, service.clock.now())
    service.parts += [Driver(service, camera, source) for camera, source in sources.items()]


def source_of(service: Service, camera: str, text: str, folder: Path) -> LiveSource:
    """The source that a text names; paths in it begin at `folder`. Raises `UsageError`."""
    kind, _, rest = text.partition(":")
    largest = service.settings.limits.body
    if kind in ("folder", "inbox") and rest:
        return FolderSource(folder / rest, largest, removes=kind == "inbox")
    if kind == "command":
        return CommandSource(rest, folder, largest)
    if kind in DEVICES:
        return DeviceSource(sensor(kind, rest or None))
    raise UsageError(f"camera '{camera}', live = '{text}': no such source; known are {KINDS}")


def _check_devices(texts: dict[str, str]) -> None:
    """Raises `UsageError` where two cameras would open the same device."""
    devices = sorted(text for text in texts.values() if text.partition(":")[0] in DEVICES)
    for kind in DEVICES:
        same = [text for text in devices if text.partition(":")[0] == kind]
        if len(same) > 1 and (kind in same or len(set(same)) < len(same)):
            raise UsageError(f"several cameras are live from {kind}; give each its own, such as {kind}:SERIAL")
