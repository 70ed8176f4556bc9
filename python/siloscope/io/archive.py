"""An archive of many depth frames: a Zarr v3 folder, one compressed and checked chunk a frame.

Any Zarr reader opens it: array ``depth`` (frame, row, column), ``timestamp`` (frame), ``gravity`` (frame, 3) and
``digest`` (frame, 16), the hash of the frame's measurements;
camera, depth unit and provenance are the group's attributes. Files are written beside their place and then renamed,
and the array's length last, so an interruption at any moment leaves the frames before it readable.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError
from siloscope.io.archive_layout import (
    array_document,
    compressed,
    decompressed,
    document_bytes,
    with_checksum,
    without_checksum,
)
from siloscope.io.source import Format, FrameSource, Item, Options, check_image_size
from siloscope.types.camera import Camera
from siloscope.types.frame import Frame

SCHEMA = "siloscope.archive/1"
_GROUP = "zarr.json"
_LARGEST_METADATA = 1 << 20
_ROWS = 1024
"""Frames a chunk of the small arrays."""
_DIGEST = 16
"""Bytes of a frame's hash."""
_DTYPES = ("uint16", "float32", "float64")


class Writer:
    """Writes an archive, or goes on with one; use it in a ``with`` statement.

    Parameters
    ----------
    path : path
        The archive's folder; new, empty, or an archive of the same camera, image size and unit.

    Raises
    ------
    InputError
        Where the path is something else.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self.count = 0
        self._head: dict[str, Any] | None = None
        self._times = np.full(_ROWS, np.nan)
        self._gravities = np.full((_ROWS, 3), np.nan)
        self._digests = np.zeros((_ROWS, _DIGEST), np.uint8)
        self._before = frozenset[str]()
        if self.path.exists() and (not self.path.is_dir() or any(self.path.iterdir())):
            self._go_on()

    def _go_on(self) -> None:
        existing = ArchiveSource(self.path, Options())
        if existing.missing:
            raise InputError(f"{existing.problems[0]}; convert what is left into a new archive")
        self._head, self.count = existing.head, existing.declared
        start = self.count - self.count % _ROWS
        self._times[: self.count - start] = existing.times[start:]
        self._gravities[: self.count - start] = existing.gravities[start:]
        digests = existing.digests()
        self._digests[: self.count - start] = digests[start:]
        self._before = frozenset(digest.tobytes().hex() for digest in digests)

    def __contains__(self, frame: Frame) -> bool:
        """Whether the archive that is gone on with had a frame of these measurements."""
        return bool(self._before) and frame.digest in self._before

    def append(self, frame: Frame) -> None:
        """Adds a depth frame; raises `InputError` for points, or a frame unlike those before."""
        depth = frame.depth
        if depth is None or depth.dtype.name not in _DTYPES:
            kind = "points" if depth is None else f"{depth.dtype} depth"
            raise InputError(f"{frame.source}: an archive holds depth images (uint16 or floating point), not {kind}")
        head = head_of(frame, depth)
        if self._head is None:
            self._begin(head, frame)
        else:
            self._check_alike(self._head, head, frame)
        self._write_frame(frame, depth)
        self.count += 1
        self._write_lengths(depth)

    def _begin(self, head: dict[str, Any], frame: Frame) -> None:
        for name in ("depth", "timestamp", "gravity", "digest"):
            (self.path / name).mkdir(parents=True, exist_ok=True)
        self._head = head
        self._write_lengths(np.empty((head["height"], head["width"]), head["dtype"]))
        attributes = {**head, "provenance": {k: v for k, v in frame.provenance.items() if k != "frame"}}
        group = {"zarr_format": 3, "node_type": "group", "attributes": attributes}
        _replace(self.path / _GROUP, document_bytes(group))

    def _check_alike(self, known: dict[str, Any], head: dict[str, Any], frame: Frame) -> None:
        for key, value in head.items():
            if known.get(key) != value:
                raise InputError(
                    f"{frame.source}: its {key.replace('_', ' ')} is {value}, that of {self.path} is "
                    f"{known.get(key)}; an archive holds frames of one camera, write another one"
                )

    def _write_frame(self, frame: Frame, depth: NDArray[Any]) -> None:
        row = self.count % _ROWS
        if row == 0:
            self._times[:], self._gravities[:], self._digests[:] = np.nan, np.nan, 0
        self._times[row] = math.nan if frame.timestamp is None else frame.timestamp
        self._gravities[row] = np.nan if frame.gravity is None else frame.gravity
        self._digests[row] = np.frombuffer(bytes.fromhex(frame.digest), np.uint8)
        chunk = self.count // _ROWS
        _replace(self.path / "digest" / f"c.{chunk}.0", with_checksum(self._digests.tobytes()))
        _replace(self.path / "depth" / f"c.{self.count}.0.0", with_checksum(compressed(depth)))
        _replace(self.path / "timestamp" / f"c.{chunk}", with_checksum(self._times.astype("<f8").tobytes()))
        _replace(self.path / "gravity" / f"c.{chunk}.0", with_checksum(self._gravities.astype("<f8").tobytes()))

    def _write_lengths(self, depth: NDArray[Any]) -> None:
        """The arrays' descriptions; that of the depth last, for it says how many frames there are."""
        height, width = depth.shape
        unit = (self._head or {}).get("depth_unit")
        # xarray and GDAL make metres of these.
        attributes = {"units": "m", "scale_factor": unit if unit is not None else 1.0}
        arrays = {
            "timestamp": array_document([self.count], [_ROWS], "float64", ["frame"]),
            "gravity": array_document([self.count, 3], [_ROWS, 3], "float64", ["frame", "axis"]),
            "digest": array_document([self.count, _DIGEST], [_ROWS, _DIGEST], "uint8", ["frame", "byte"]),
            "depth": array_document(
                [self.count, height, width],
                [1, height, width],
                depth.dtype.name,
                ["frame", "row", "column"],
                attributes=attributes,
            ),
        }
        for name, array in arrays.items():
            _replace(self.path / name / _GROUP, document_bytes(array))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Every frame is complete when `append` returns; nothing is left to do."""


def write(path: str | os.PathLike[str], frames: Iterable[Frame]) -> int:
    """Writes frames to an archive, or adds them to it; gives their number."""
    with Writer(path) as archive:
        before = archive.count
        for frame in frames:
            archive.append(frame)
        return archive.count - before


def head_of(frame: Frame, depth: NDArray[Any]) -> dict[str, Any]:
    """What all frames of an archive have in common."""
    height, width = depth.shape
    raw = depth.dtype == np.uint16
    return {
        "schema": SCHEMA,
        "camera": frame.camera.to_dict() if frame.camera else None,
        "depth_unit": frame.depth_unit if raw else None,
        "dtype": depth.dtype.name,
        "height": height,
        "width": width,
    }


def _replace(path: Path, data: bytes) -> None:
    """Writes a whole file or nothing."""
    beside = path.with_name(f".{path.name}.new")
    beside.write_bytes(data)
    beside.replace(path)


class ArchiveSource(FrameSource):
    """The frames of an archive."""

    rows = _ROWS
    """Frames a chunk of the small arrays."""

    def __init__(self, path: Path, options: Options) -> None:
        super().__init__(path, "archive", options)
        self.head = self._attributes()
        self.dtype, self.shape, self.declared = self._depth_array()
        self.numbers = self._numbers()
        self.missing = self.declared - len(self.numbers)
        self.times = self._rows("timestamp", 1)[:, 0]
        self.gravities = self._rows("gravity", 3)
        known = self.times[self.numbers]
        self.timestamps = known.tolist() if np.all(np.isfinite(known)) else None
        self.file_depth_unit = _unit(self.head.get("depth_unit"))
        self.file_camera = self._camera()
        self.provenance |= self._provenance()
        self.problems = [self._loss()] if self.missing else []

    def _read_json(self, path: Path) -> dict[str, Any]:
        try:
            if path.stat().st_size > _LARGEST_METADATA:
                raise InputError(f"{path}: too long for a Zarr description; the archive is damaged")
            document = json.loads(path.read_bytes())
        except (OSError, ValueError, RecursionError) as error:
            raise InputError(f"{path}: can't be read ({error}); the archive is damaged") from None
        if not isinstance(document, dict) or document.get("zarr_format") != 3:
            raise InputError(f"{path}: not a Zarr v3 description; the archive is damaged")
        return document

    def _attributes(self) -> dict[str, Any]:
        attributes = self._read_json(self.path / _GROUP).get("attributes")
        schema = attributes.get("schema") if isinstance(attributes, dict) else None
        if schema != SCHEMA:
            raise InputError(
                f"{self.name}: a Zarr folder, but no archive of depth frames ({schema!r} instead of '{SCHEMA}'); "
                "make one with `siloscope convert`"
            )
        return dict(attributes or {})

    def _depth_array(self) -> tuple[str, tuple[int, int], int]:
        array = self._read_json(self.path / "depth" / _GROUP)
        shape, dtype = array.get("shape"), array.get("data_type")
        codecs = array.get("codecs")
        names = [codec.get("name") for codec in codecs if isinstance(codec, dict)] if isinstance(codecs, list) else []
        sides = shape if isinstance(shape, list) and len(shape) == 3 else []
        whole = bool(sides) and all(type(n) is int and n >= 0 for n in sides)
        if not whole or dtype not in _DTYPES or not self._is_ours(array, names):
            raise InputError(f"{self.name}: its depth array is not as siloscope writes it; convert the frames again")
        frames, height, width = sides
        check_image_size(self.name, width, height)
        return str(dtype), (height, width), frames

    def _is_ours(self, array: dict[str, Any], codecs: list[Any]) -> bool:
        """Whether the depth's chunks are packed as this source reads them."""
        return codecs == ["bytes", "blosc", "crc32c"]

    def _numbers(self) -> list[int]:
        """Numbers of the frames that are there, in order."""
        with os.scandir(self.path / "depth") as files:
            names = [file.name.split(".") for file in files if file.name.startswith("c.")]
        found = {int(parts[1]) for parts in names if len(parts) == 4 and parts[1].isdecimal() and len(parts[1]) < 10}
        return sorted(number for number in found if number < self.declared)

    def _rows(self, name: str, width: int) -> NDArray[np.float64]:
        """The values of a small array up to the last frame there is; NaN where they are missing or damaged."""
        last = self.numbers[-1] + 1 if self.numbers else 0
        step = self.rows
        rows = np.full((-(-last // step) * step, width), np.nan)
        for chunk in range(len(rows) // step):
            path = self.path / name / (f"c.{chunk}" if width == 1 else f"c.{chunk}.0")
            try:
                data = without_checksum(path.read_bytes())
            except (OSError, InputError):
                continue
            if len(data) == step * width * 8:
                rows[chunk * step : (chunk + 1) * step] = np.frombuffer(data, "<f8").reshape(-1, width)
        return rows[:last]

    def digests(self) -> NDArray[np.uint8]:
        """Hashes (frame, 16) of the frames' measurements; those of an archive that keeps none are worked out."""
        rows = np.zeros((-(-self.declared // _ROWS) * _ROWS, _DIGEST), np.uint8)
        for chunk in range(len(rows) // _ROWS):
            with suppress(OSError, InputError):
                data = without_checksum((self.path / "digest" / f"c.{chunk}.0").read_bytes())
                if len(data) == _ROWS * _DIGEST:
                    rows[chunk * _ROWS : (chunk + 1) * _ROWS] = np.frombuffer(data, np.uint8).reshape(-1, _DIGEST)
        for number in np.flatnonzero(~rows[: self.declared].any(axis=1)):
            with suppress(InputError):  # a damaged frame is told where it is read
                rows[number] = np.frombuffer(bytes.fromhex(self._decode(int(number)).digest), np.uint8)
        return rows[: self.declared]

    def _camera(self) -> Camera | None:
        fields = self.head.get("camera")
        if fields is None or self.options.cameras:
            return None
        try:
            return Camera(**fields)
        except (TypeError, ValueError) as error:
            raise InputError(f"{self.name}: its camera can't be used ({error}); give --camera FILE") from None

    def _provenance(self) -> dict[str, Any]:
        """What the archive keeps of its frames' origin, beside where it lies itself."""
        kept = self.head.get("provenance")
        kept = kept if isinstance(kept, dict) else {}
        return {**kept, **self.provenance, "archived_from": kept.get("file")}

    def _items(self) -> Iterator[Item]:
        for number in self.numbers:
            yield Item(f"frame {number}", partial(self._decode, number))
        if self.missing:
            raise InputError(self._loss())

    def _loss(self) -> str:
        return f"{self.name}: {self.missing} of {self.missing + len(self.numbers)} frames are missing"

    def _chunk(self, number: int) -> bytes:
        """The stored bytes of a frame."""
        path = self.path / "depth" / f"c.{number}.0.0"
        try:
            return path.read_bytes()
        except OSError as error:
            raise InputError(f"frame {number}: {path} can't be read ({error.strerror})") from None

    def _decode(self, number: int) -> Frame:
        data = self._chunk(number)
        depth = decompressed(without_checksum(data), self.shape, self.dtype)
        time, gravity = float(self.times[number]), self.gravities[number]
        return Frame(
            depth=depth,
            timestamp=time if math.isfinite(time) else None,
            gravity=gravity if np.all(np.isfinite(gravity)) else None,
        )

    def _count(self) -> int:
        return len(self.numbers)

    def _streams(self) -> list[dict[str, Any]]:
        size = self.shape[1], self.shape[0]
        stream = {"name": "depth", "kind": "depth", "size": size, "dtype": self.dtype}
        return [{**stream, "frames": len(self.numbers), "chosen": True}]


def _unit(value: Any) -> float | None:
    if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value) and 0 < value <= 1:
        return float(value)
    return None


FORMAT = Format("archive", lambda head, path: path.is_dir() and (path / _GROUP).is_file(), ArchiveSource)
