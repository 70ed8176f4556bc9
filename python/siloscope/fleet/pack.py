"""`pack`: frames of any source sealed in a store, each path's frames as a silo of their own."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from siloscope.errors import UsageError
from siloscope.fleet import manifest
from siloscope.fleet.naming import Series, as_id, checked
from siloscope.fleet.places import open_store
from siloscope.fleet.sealing import SeriesWriter
from siloscope.fleet.store import Store
from siloscope.io import FrameSource
from siloscope.io import open as open_frames
from siloscope.io.archive_layout import document_bytes
from siloscope.io.sealed import STORE_SCHEMA
from siloscope.io.shard_layout import MOST_FRAMES
from siloscope.schema import documents
from siloscope.tracking.clock import Clock
from siloscope.types.calibration import Calibration
from siloscope.types.frame import Frame

CAMERA = "cam"
"""The camera's id unless one is given."""

Progress = Callable[[FrameSource], Iterable[Any]]


@dataclass
class Packed:
    """What a packing has done."""

    store: str
    frames: int = 0
    """Sealed by it."""
    present: int = 0
    """Sealed before."""
    shards: int = 0
    series: dict[str, int] = field(default_factory=dict)
    """Frames sealed by it, by silo and camera."""
    problems: list[str] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        """The document of ``siloscope pack --json`` (schema ``siloscope.pack/1``)."""
        return {"schema": "siloscope.pack/1", **self.__dict__}


def pack(
    paths: Iterable[str | Path],
    place: str | Path,
    *,
    silo: str | None = None,
    camera_id: str = CAMERA,
    shard_frames: int = MOST_FRAMES,
    calibration: str | Path | None = None,
    progress: Progress = iter,
    **reading: Any,
) -> Packed:
    """Seal frames in a store, behind those that are in it.

    Parameters
    ----------
    paths : paths
        Archives, folders, recordings, images: what `siloscope.open` opens. Each is a silo by its name (single images:
        by their folder's), or all are of `silo`.
    place : path or URL
        The store; made where it is missing.
    silo, camera_id : str
        Ids: letters, digits, ``-`` and ``_``.
    shard_frames : int
        Most frames an object, 1 to `MOST_FRAMES`; a new month begins a new one.
    calibration : path, optional
        The silo's calibration, kept with the frames; `plan` takes it unless it is given another one.
    progress : callable, optional
        Is given every source and gives its frames on.
    **reading
        ``camera``, ``depth_unit``, ``stream`` as for `siloscope.open`.

    Raises
    ------
    InputError
        For frames that can't be read or are unlike those that are in the store.
    UsageError
        For an id or number that can't be.
    """
    _check_shard(shard_frames)
    store = open_store(place)
    done = Packed(store.place)
    kept = None if calibration is None else _kept(store, Path(calibration))
    writers: dict[Series, SeriesWriter] = {}
    _found(store)
    for series, files in _by_series(paths, silo, checked(camera_id, "--camera-id")).items():
        writer = writers.setdefault(series, SeriesWriter(store, series, shard_frames, kept))
        with open_frames(files, **reading) as source:
            _seal(writer, source, progress, done)
    made = [(series, w.next_shard, w.slots, w.calibration) for series, w in writers.items()]
    manifest.add(store, made)
    return done


def pack_monitor(
    data: str | Path,
    place: str | Path,
    *,
    database: str | None = None,
    silo: str | None = None,
    shard_frames: int = MOST_FRAMES,
    progress: Callable[[Iterable[Frame]], Iterable[Frame]] = iter,
) -> Packed:
    """Seal the frames that a monitor still has, with its calibrations and what it measures its silos with.

    Frames without a calibration, of a clock that can't be right, or that failed, stay out.

    Parameters
    ----------
    data : path
        The folder of ``siloscope serve --data``; the service may run meanwhile.
    place : path or URL
        The store; made where it is missing.
    database : str, optional
        The service's ``--database``.
    silo : str, optional
        One silo alone.
    shard_frames : int
        Most frames an object, 1 to `MOST_FRAMES`.
    progress : callable, optional
        Is given each camera's frames and gives them on.

    Raises
    ------
    InputError
        For a folder without a monitor's data, or frames unlike those that are in the store.
    """
    from siloscope.fleet import monitored
    from siloscope.fleet.origin import told_of

    _check_shard(shard_frames)
    store, monitor = open_store(place), monitored.Monitor(Path(data), database)
    done, writers = Packed(store.place), {}
    _found(store)
    try:
        for found in monitor.measured(silo):
            told = {"settings": {**told_of(store).get("settings", {})}}
            told["settings"][as_id(found.silo)] = monitor.settings_of(found.silo)
            series = monitored.series_of(store, found, told)
            kept = _kept_document(store, monitored.calibration_of(found))
            writers[series] = SeriesWriter(store, series, shard_frames, kept)
            _append(writers[series], progress(monitor.frames(found, done.problems)), done)
    finally:
        monitor.close()
    manifest.add(store, [(series, w.next_shard, w.slots, w.calibration) for series, w in writers.items()])
    return done


def _append(writer: SeriesWriter, frames: Iterable[Frame], done: Packed) -> None:
    """Seals frames that have their times."""
    first, name = writer.next_shard, writer.series.name
    for frame in frames:
        if writer.append(frame):
            done.frames += 1
            done.series[name] = done.series.get(name, 0) + 1
        else:
            done.present += 1
    writer.flush()
    done.shards += writer.next_shard - first


def _check_shard(frames: int) -> None:
    if not 1 <= frames <= MOST_FRAMES:
        raise UsageError(f"{frames} frames a shard: give 1 to {MOST_FRAMES}")


def _found(store: Store) -> None:
    """Writes the store's own description where there is none."""
    document = {"zarr_format": 3, "node_type": "group", "attributes": {"schema": STORE_SCHEMA}}
    store.create("zarr.json", document_bytes(document))


def _by_series(paths: Iterable[str | Path], silo: str | None, camera: str) -> dict[Series, list[Path]]:
    """The files of every silo, in their order."""
    found: dict[Series, list[Path]] = {}
    for path in map(Path, paths):
        name = as_id(_own_name(path)) if silo is None else checked(silo, "--silo")
        found.setdefault(Series(name, camera), []).append(path)
    return found


_ONE_FRAME = (".png", ".npy", ".npz", ".tif", ".tiff", ".pgm", ".pfm", ".exr", ".raw")


def _own_name(path: Path) -> str:
    whole = path.absolute()
    return whole.parent.name if path.suffix.lower() in _ONE_FRAME else whole.name.removesuffix(path.suffix)


def _seal(writer: SeriesWriter, source: FrameSource, progress: Progress, done: Packed) -> None:
    timed = (
        replace(frame, timestamp=Clock().time(number, frame.timestamp, frame.source))
        for number, frame in enumerate(progress(source))
    )
    _append(writer, timed, done)
    done.problems += source.problems


def _kept(store: Store, path: Path) -> str:
    """The name of the calibration's copy in the store."""
    return _kept_document(store, Calibration.load(path))


def _kept_document(store: Store, calibration: Calibration) -> str:
    document = documents.text(calibration.to_dict() | {"timing_ms": {}}).encode()
    name = f"calibrations/{hashlib.sha256(document).hexdigest()}.json"
    store.create(name, document)
    return name
