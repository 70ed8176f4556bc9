"""Writes frames of any source as files that other programs read, with their camera, times, gravity and provenance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from siloscope.errors import InputError, UsageError
from siloscope.io import archive, writers
from siloscope.schema import documents
from siloscope.types.frame import Frame

FRAME_LIST = "frames.json"
CAMERA_FILE = "camera.json"


class Sink(Protocol):
    """Takes frames one at a time; what it wrote is complete after `finish`."""

    files: list[Path]
    repeated: int
    """Frames that were not written because the output has them already."""

    def add(self, frame: Frame) -> None:
        """Writes or keeps one frame; raises `UsageError` where it does not go with the ones before."""

    def finish(self) -> None:
        """Writes what comes last."""


def open_sink(out: Path, raw_unit: float | None = None) -> Sink:
    """The sink that the name of the output asks for: one of `SINKS`, else a folder; an archive is gone on with.

    `raw_unit` has floating-point depth written as 16-bit raw units of so many metres.

    Raises `UsageError` for an output that is there already, or a unit that can't be one.
    """
    if raw_unit is not None and not 1e-7 <= raw_unit <= 1.0:
        raise UsageError(f"a raw unit of {raw_unit} m is not possible; give metres per raw unit, such as 0.001")
    if out.is_dir() and any(out.iterdir()) and not (out.suffix.lower() == ".zarr" and (out / "zarr.json").is_file()):
        raise UsageError(f"{out}: the folder is not empty; name a new one")
    if out.is_file():
        raise UsageError(f"{out}: exists already; name a new file or folder")
    return SINKS.get(out.suffix.lower(), FolderSink)(out, raw_unit)


class FolderSink:
    """A folder with a file a frame, ``camera.json`` with the camera and unit, and ``frames.json`` with all else."""

    repeated = 0

    def __init__(self, out: Path, raw_unit: float | None) -> None:
        self.out, self.files = out, list[Path]()
        self._raw_unit = raw_unit
        self._rows: list[dict[str, Any]] = []
        self._first: Frame | None = None

    def add(self, frame: Frame) -> None:
        """Writes the frame; its name has its number from 0."""
        frame = as_raw(frame, self._raw_unit)
        self._first = same_camera(self._first, frame)
        self.out.mkdir(parents=True, exist_ok=True)
        path = self.out / f"frame_{len(self._rows):06d}{writers.suffix(frame)}"
        writers.write_frame(path, frame)
        self.files.append(path)
        self._rows.append({"file": path.name, **description(frame)})

    def finish(self) -> None:
        """Writes the camera file and the list."""
        if self._first is not None and self._first.camera is not None:
            self.files.append(self.out / CAMERA_FILE)
            writers.write_camera(self._first.camera, self.out / CAMERA_FILE, self._first.depth_unit)
        self.files.append(self.out / FRAME_LIST)
        unit = None if self._first is None else self._first.depth_unit
        document = {"schema": "siloscope.frames/1", "depth_unit": unit, "frames": self._rows}
        documents.write(self.out / FRAME_LIST, document)


class NpzSink:
    """One compressed file with the depth images stacked (F, H, W), or one cloud."""

    repeated = 0

    def __init__(self, out: Path, raw_unit: float | None) -> None:
        self.out, self.files = out, [out]
        self._raw_unit = raw_unit
        self._frames: list[Frame] = []

    def add(self, frame: Frame) -> None:
        """Keeps the frame until `finish`."""
        frame = as_raw(frame, self._raw_unit)
        if self._frames:
            same_camera(self._frames[0], frame)
            if frame.depth is None or self._frames[0].depth is None or not _stacks(frame, self._frames[0]):
                raise UsageError(f"{self.out}: frames of different kinds or sizes don't stack; name a folder instead")
        self._frames.append(frame)

    def finish(self) -> None:
        """Writes the file."""
        first = self._frames[0]
        labels = [frame.labels for frame in self._frames if frame.labels is not None]
        times = [frame.timestamp for frame in self._frames if frame.timestamp is not None]
        single = len(self._frames) == 1
        whole = len(self._frames)
        values = np.stack([frame.depth for frame in self._frames]) if first.depth is not None else first.points  # type: ignore[misc]
        writers.write_npz(
            self.out,
            values[0] if single and first.depth is not None else values,  # type: ignore[index, arg-type]
            name="points" if first.depth is None else "depth",
            camera=first.camera,
            depth_unit=first.depth_unit,
            timestamps=times if len(times) == whole else None,
            gravity=first.gravity,
            labels=(labels[0] if single else np.stack(labels)) if len(labels) == whole else None,
            provenance=documents.text([description(frame) for frame in self._frames]),
        )


class PlySink:
    """One point cloud file, for one frame."""

    repeated = 0

    def __init__(self, out: Path, raw_unit: float | None) -> None:
        self.out, self.files = out, [out]
        self._frame: Frame | None = None

    def add(self, frame: Frame) -> None:
        """Keeps the frame until `finish`, so that a second one leaves no file behind."""
        if self._frame is not None:
            raise UsageError(f"{self.out}: a PLY file takes one frame; name a folder for several")
        self._frame = frame

    def finish(self) -> None:
        """Writes the frame's points."""
        if self._frame is not None:
            points, labels = frame_points(self._frame)
            comments = [f"from {Path(self._frame.source).name}"]
            writers.write_ply(self.out, points, labels=labels, comments=comments)


class ArchiveSink:
    """An archive for many frames (`siloscope.io.archive`); every frame is complete when it is added."""

    def __init__(self, out: Path, raw_unit: float | None) -> None:
        self.out, self.files = out, [out]
        self._raw_unit = raw_unit
        self._writer = archive.Writer(out)
        self.repeated = 0

    def add(self, frame: Frame) -> None:
        """Adds the frame behind those that are there, unless it is one of them."""
        frame = as_raw(frame, self._raw_unit)
        if frame in self._writer:
            self.repeated += 1
        else:
            self._writer.append(frame)

    def finish(self) -> None:
        """Nothing is left to write."""


SINKS: dict[str, Callable[[Path, float | None], Sink]] = {".npz": NpzSink, ".ply": PlySink, ".zarr": ArchiveSink}
"""Sinks by the ending of the output's name; other names are folders."""


def as_raw(frame: Frame, raw_unit: float | None) -> Frame:
    """Floating-point depth as raw units where a unit is given."""
    if raw_unit is None or frame.depth is None or frame.depth.dtype == np.uint16:
        return frame
    return replace(frame, depth=writers.to_raw(frame.depth, raw_unit), depth_unit=raw_unit)


def same_camera(first: Frame | None, frame: Frame) -> Frame:
    """The first frame; raises `UsageError` where another's camera or unit differs, which one file can't tell."""
    if first is None:
        return frame
    if (first.camera, first.depth_unit) != (frame.camera, frame.depth_unit):
        raise UsageError(f"{frame.source}: another camera or depth unit than {first.source}; convert them apart")
    return first


def frame_points(frame: Frame) -> tuple[Any, Any]:
    """Points (N, 3) and labels of a frame: as stored, or back-projected (Eqs. 1 and 2) where measured."""
    if frame.points is not None:
        return frame.points, frame.labels
    if frame.camera is None:
        raise InputError(f"{frame.source}: points need the camera; give --camera")
    z, measured = metres(frame)
    rays = frame.camera.rays()[measured]
    points = np.column_stack([rays * z[measured, None], z[measured]])
    return points, None if frame.labels is None else frame.labels[measured]


def metres(frame: Frame) -> tuple[Any, Any]:
    """Depth (H, W) in metres and where it is measured."""
    depth = np.asarray(frame.depth)
    if depth.dtype == np.uint16:
        if frame.depth_unit is None:
            raise InputError(f"{frame.source}: depth in raw units and nothing says how long one is; give --depth-unit")
        return depth * frame.depth_unit, (depth > 0) & (depth < 65_535)
    return depth.astype(np.float64), np.isfinite(depth) & (depth > 0)


def description(frame: Frame) -> dict[str, Any]:
    """What is known of a frame beside its values."""
    known = {"timestamp": frame.timestamp, "gravity": frame.gravity, "source": Path(frame.source).name}
    return {**known, "provenance": frame.provenance}


def _stacks(frame: Frame, first: Frame) -> bool:
    one, other = np.asarray(frame.depth), np.asarray(first.depth)
    return one.shape == other.shape and one.dtype == other.dtype
