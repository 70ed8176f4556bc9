"""What a measuring process does: a frame's file and its calibration in, plain data out.

It runs in a process of its own, with limits of memory and time, because the files come from outside.
"""

from __future__ import annotations

import hashlib
import json
import os
import resource
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias


@dataclass(frozen=True)
class CameraSettings:
    """What is known of a camera."""

    intrinsics: str | None = None
    """Text of a camera file."""
    sensor: str | None = None
    """Name of a profile, or the path of one."""
    depth_unit: float | None = None


@dataclass(frozen=True)
class MeasureJob:
    """One frame to be measured."""

    path: Path
    camera: CameraSettings
    calibration: Path
    """Its file."""
    vessel: dict[str, Any] = field(default_factory=dict)
    """Settings of `siloscope.measure` that describe the vessel."""
    product: dict[str, Any] | None = None
    """Fields of a `siloscope.content.Density`."""


@dataclass(frozen=True)
class CalibrateJob:
    """Frames to be fused."""

    paths: tuple[Path, ...]
    camera: CameraSettings
    vessel: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class LookJob:
    """One frame to be looked at, without a calibration."""

    path: Path
    camera: CameraSettings


@dataclass(frozen=True)
class Measured:
    """A reading without what the service knows of it."""

    values: dict[str, Any]
    """Columns of the table of readings."""
    surface: bytes | None = None
    seconds: float = 0.0


@dataclass(frozen=True)
class Calibrated:
    """A calibration's document."""

    document: dict[str, Any]
    ok: bool
    message: str | None = None


@dataclass(frozen=True)
class Looked:
    """What one frame shows."""

    pose: dict[str, Any]
    """``status``, ``reason``, ``message``, ``r_x``, ``r_y``, ``t_x``, ``t_y`` and ``std`` of `siloscope.locate`."""
    picture: bytes | None
    """PNG; None for a cloud."""


@dataclass(frozen=True)
class Unusable:
    """What was wrong with the input, in a sentence."""

    message: str


Job: TypeAlias = MeasureJob | CalibrateJob | LookJob
"""What a worker is asked for."""


def serve(pipe: Connection, memory: int) -> None:
    """Answers jobs until the other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ.setdefault("RAYON_NUM_THREADS", "1")
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        while True:
            pipe.send(answer(pipe.recv()))
    except (EOFError, BrokenPipeError, ConnectionResetError):
        return


def answer(job: Job) -> Measured | Calibrated | Looked | Unusable:
    """The work of one job; input that can't be used is an answer too."""
    from siloscope.errors import SiloscopeError

    try:
        return WORK[type(job)](job)
    except SiloscopeError as error:
        return Unusable(str(error))
    except MemoryError:
        return Unusable("the frame needs more memory than a measurement may take; send a smaller one")


def measured(job: MeasureJob) -> Measured:
    """Reads and measures one frame."""
    from siloscope.content.density import Density
    from siloscope.measure import measure

    start = time.perf_counter()
    frame = frame_of(job.path, job.camera)
    density = None if job.product is None else Density(**job.product)
    content = measure(frame, _calibration(job.calibration), sensor=job.camera.sensor, product=density, **job.vessel)
    return Measured(reading(content), packed_surface(content.surface), time.perf_counter() - start)


def calibrated(job: CalibrateJob) -> Calibrated:
    """Reads and fuses frames; those that can't be read are left out."""
    from siloscope.calibrate import calibrate

    told = job.vessel
    frames = (frame_of(path, job.camera) for path in job.paths)
    found = calibrate(frames, sensor=job.camera.sensor, diameter=told.get("diameter"), bottom=told.get("bottom"))
    return Calibrated(found.to_dict(), found.ok, found.message)


def looked(job: LookJob) -> Looked:
    """Reads one frame, draws it, and finds the pose that it shows alone."""
    from siloscope.locate import locate
    from siloscope.monitor.picture import drawn

    frame = frame_of(job.path, job.camera)
    found = locate(frame, sensor=job.camera.sensor, ratios=False).to_dict()
    names = ("status", "reason", "message", "r_x", "r_y", "t_x", "t_y", "std")
    return Looked({name: found.get(name) for name in names}, drawn(frame))


WORK: dict[type, Callable[[Any], Measured | Calibrated | Looked]] = {
    MeasureJob: measured,
    CalibrateJob: calibrated,
    LookJob: looked,
}
"""What is done for a job."""


def frame_of(path: Path, camera: CameraSettings) -> Any:
    """The first frame of a file."""
    import siloscope.io

    given = None if camera.intrinsics is None else _camera(camera.intrinsics)
    with siloscope.io.open(path, camera=given, depth_unit=camera.depth_unit) as source:
        return next(iter(source))


@lru_cache(maxsize=256)
def _camera(text: str) -> Any:
    """A camera; the file itself where it has several sizes, of which each frame has its own."""
    from siloscope.errors import InputError
    from siloscope.io import camera_files

    path = _file(text.encode())
    try:
        return camera_files.load(path)
    except InputError:
        return path


@lru_cache(maxsize=64)
def _calibration(path: Path) -> Any:
    from siloscope.types.calibration import Calibration

    return Calibration.load(path)


def _file(content: bytes) -> Path:
    """A file with this content, for what reads files only."""
    path = Path(_room().name) / hashlib.sha256(content).hexdigest()
    path.write_bytes(content)
    return path


@lru_cache(maxsize=1)
def _room() -> TemporaryDirectory[str]:
    return TemporaryDirectory(prefix="siloscope-worker-")


def reading(content: Any) -> dict[str, Any]:
    """A content as columns of the table of readings."""
    level = content.level
    density = (content.density or {}).get("loose_kg_m3")
    values = {
        "status": content.status,
        "reason": content.reason,
        "message": content.message,
        "volume": content.volume,
        "volume_std": content.volume_std,
        "own_std": content.own_std,
        "ullage": content.ullage,
        "ullage_std": content.ullage_std,
        "fill": content.fill_fraction,
        "capacity": content.capacity,
        "mass": content.mass,
        "mass_std": content.mass_std,
        "density": content.mass / content.volume if content.mass and content.volume else density,
        "level": level.mean,
        "level_min": level.min,
        "level_max": level.max,
        "level_axis": level.at_axis,
        "level_std": level.std,
        "datum": content.height_datum,
        "coverage": content.coverage,
        "quality": [remark.to_dict() for remark in content.quality],
    }
    if content.surface is not None:
        heights = {"distance": level.mean, "distance_min": level.max, "distance_max": level.min}
        values |= {name: None if h is None else content.surface.datum - h for name, h in heights.items()}
    return {name: _plain(value) for name, value in values.items()}


def _plain(value: Any) -> Any:
    return value.item() if hasattr(value, "item") else value


def packed_surface(surface: Any) -> bytes | None:
    """A surface as `siloscope.monitor.surfaces` has it."""
    if surface is None:
        return None
    from siloscope.monitor.surfaces import pack

    return pack(surface)


def digest(settings: dict[str, Any]) -> str:
    """Hash of settings, by which readings of the same settings are known."""
    return hashlib.sha256(json.dumps(settings, sort_keys=True, default=str).encode()).hexdigest()
