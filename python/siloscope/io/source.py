"""What every format gives: a source of frames, and the terms on which it was opened."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, NamedTuple, Self, overload

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError
from siloscope.io.camera_sizes import choose
from siloscope.io.terms import Options as Options
from siloscope.io.terms import UnknownUnit, finish
from siloscope.types.camera import Camera
from siloscope.types.frame import Frame
from siloscope.wording import printable

if TYPE_CHECKING:
    from concurrent.futures import Executor, Future

MAX_SIDE = 20_000
"""Largest width or height of an image, in pixels (as in `Camera`)."""

MAX_PIXELS = 100_000_000
"""Largest image, in pixels; above it the file is taken for damaged or hostile."""


class Item(NamedTuple):
    """One frame that has not been decoded yet."""

    label: str
    """Names the frame in messages: ``frame 17``, ``0017.png``."""
    read: Callable[[], Frame]
    """Decodes it; raises `InputError` where it is damaged."""


@dataclass(frozen=True)
class Format:
    """One entry of the registry.

    Attributes
    ----------
    name : str
        Short name: ``png``, ``pcd``.
    sniff : callable (head: bytes, path: Path) -> bool
        Whether the content is of this format, from the file's first `HEAD_BYTES` bytes (empty for a folder).
    open : callable (path: Path, options: Options) -> FrameSource
        Reads headers, no frames; raises `InputError`.
    extra : str or None
        The optional dependency group that reading needs.
    read_one : callable (path: Path) -> Frame, or None
        Reads a file that has one frame, without the user's terms: what a folder of such files is read with.
    """

    name: str
    sniff: Callable[[bytes, Path], bool]
    open: Callable[[Path, Options], FrameSource]
    extra: str | None = None
    read_one: Callable[[Path], Frame] | None = None


HEAD_BYTES = 4096
"""How much of a file the sniffing sees."""


class FrameSource(ABC):
    """Frames of one file, folder or recording, decoded one at a time while iterating.

    Damaged frames are skipped and told in `problems`; a source without one readable frame raises `InputError`.
    Iterating again starts again. Use it in a ``with`` statement, or call `close`.

    A format derives from it, sets the attributes it knows, and gives `_items` and `_streams`. Sources that hold a
    file open also extend `close`.

    Attributes
    ----------
    path : Path
        What was opened.
    name : str
        The same, as text for messages.
    format : str
        Name of the format.
    options : Options
        What the user said.
    timestamps : list of float, or None
        Seconds of every frame, where known without decoding.
    gravity : float array (3,) or None
        Direction of gravity in the camera frame, m/s², where recorded.
    provenance : dict
        What is known about the origin: device, serial number, stream, where camera and unit come from.
    problems : list of str
        What could not be read in the iteration so far: ``frame 17: truncated PNG``.
    independent : bool
        Whether frames can be decoded at the same time, as each has a file of its own.
    """

    independent = False

    def __init__(self, path: Path, format: str, options: Options) -> None:
        self.path = path
        self.name = printable(str(path))
        self.format = format
        self.options = options
        self.timestamps: list[float] | None = None
        self.gravity: NDArray[np.float64] | None = None
        self.provenance: dict[str, Any] = {"format": format, "file": printable(path.name)}
        self.problems: list[str] = []
        self.file_camera: Camera | None = None
        self.file_depth_unit: float | None = None

    @abstractmethod
    def _items(self) -> Iterator[Item]:
        """The frames in order, undecoded.

        It may raise `InputError` where the file breaks off: what came before still counts.
        """

    def _count(self) -> int | None:
        """Number of frames, or None where only reading tells."""
        return None

    def _streams(self) -> list[dict[str, Any]]:
        """For `describe`: one dictionary a stream with ``name``, ``kind`` (depth, points, …), ``size`` (width, height
        or number of points), ``dtype``, ``frames`` and ``chosen``."""
        return []

    def _topics(self) -> list[dict[str, Any]]:
        """For `describe`: one dictionary a topic of a recording; see `siloscope.io.recordings.contents.listed`."""
        return []

    @property
    def camera(self) -> Camera | None:
        """The user's camera, else the file's, else None."""
        given, size = self.options.cameras, self._stream_size()
        if not given or (len(given) > 1 and size is None):
            return self.file_camera
        if size is None:
            return given[0] if isinstance(given[0], Camera) else None
        try:
            return choose(self.name, given, size)[0]
        except InputError:
            return given[0] if isinstance(given[0], Camera) else None  # refused, with the reason, for every frame

    def _stream_size(self) -> tuple[int, int] | None:
        """Width and height of the chosen stream's images, or None for points in no order."""
        sizes: list[Any] = [stream.get("size") or () for stream in self._streams() if stream.get("chosen")]
        return (sizes[0][0], sizes[0][1]) if sizes and len(sizes[0]) == 2 else None

    @property
    def depth_unit(self) -> float | None:
        """Metres per raw unit: the user's, else the file's, else None."""
        known = (self.options.depth_unit, self.options.camera_depth_unit, self.file_depth_unit)
        return next((unit for unit in known if unit is not None), None)

    @property
    def frame_count(self) -> int | None:
        """Number of frames, where it is known without reading them all; `len` raises `TypeError` where it is not."""
        return self._count()

    def __len__(self) -> int:
        count = self._count()
        if count is None:
            raise TypeError(f"{self.name}: the number of frames is known only after reading")
        return count

    def __bool__(self) -> bool:
        return True

    def __iter__(self) -> Iterator[Frame]:
        return self._frames(None, 0)

    def ahead(self, pool: Executor, count: int) -> Ahead:
        """The frames in the same order; the next `count` are decoded in `pool` while one is being used."""
        return Ahead(self, pool, count)

    def _frames(self, pool: Executor | None, count: int) -> Iterator[Frame]:
        self.problems = []
        read = 0
        for item, frame in self._decoded(pool, count):
            if isinstance(frame, InputError):
                self.problems.append(_told(item.label, frame))
                continue
            read += 1
            yield frame
        if not read:
            raise self._nothing_read()

    @overload
    def __getitem__(self, index: int) -> Frame: ...

    @overload
    def __getitem__(self, index: slice) -> list[Frame]: ...

    def __getitem__(self, index: int | slice) -> Frame | list[Frame]:
        """One frame by its number from 0, or from the end by a negative one; the frames of a slice.
        Raises `IndexError` past the end and `InputError` where a frame is damaged."""
        if isinstance(index, slice):
            return [self._finished(item) for item in list(self._items())[index]]
        if index < 0:
            count = self._count()
            index += sum(1 for _ in self._items()) if count is None else count
        item = next(islice(self._items(), index, None), None) if index >= 0 else None
        if item is None:
            raise IndexError(f"{self.name}: no frame {index}")
        return self._finished(item)

    def _decoded(self, pool: Executor | None, count: int) -> Iterator[tuple[Item, Frame | InputError]]:
        """The items in order, each with its frame or what is wrong with it."""
        items = self._items_before_damage()
        if pool is None or not self.independent:
            yield from ((item, self._attempt(item)) for item in items)
            return
        waiting: deque[tuple[Item, Future[Frame | InputError]]] = deque()
        try:
            for item in items:
                waiting.append((item, pool.submit(self._attempt, item)))
                if len(waiting) > count:
                    item, frame = waiting.popleft()
                    yield item, frame.result()
            yield from ((item, frame.result()) for item, frame in waiting)
        finally:
            for _, frame in waiting:
                frame.cancel()

    def _attempt(self, item: Item) -> Frame | InputError:
        try:
            return self._finished(item)
        except UnknownUnit:
            raise
        except InputError as error:
            return error

    def _items_before_damage(self) -> Iterator[Item]:
        try:
            yield from self._items()
        except InputError as error:
            self.problems.append(str(error))

    def _finished(self, item: Item) -> Frame:
        with np.errstate(all="ignore"):  # damaged values overflow; they end as no measurement
            return finish(self._completed(item), self.options)

    def _completed(self, item: Item) -> Frame:
        """The frame as stored, with what the whole source knows about it."""
        try:
            frame = item.read()
        except OSError as error:  # gone, or not allowed, since it was opened
            raise InputError(f"{self.name}: {item.label} can't be read ({error.strerror or error}); check it") from None
        return replace(
            frame,
            camera=frame.camera or self.file_camera,
            depth_unit=self.file_depth_unit if frame.depth_unit is None else frame.depth_unit,
            gravity=self.gravity if frame.gravity is None else frame.gravity,
            source=self.name if self._count() == 1 else f"{self.name}, {printable(item.label)}",
            provenance={**self.provenance, "frame": item.label, **frame.provenance},
        )

    def _nothing_read(self) -> InputError:
        if not self.problems:
            return InputError(f"{self.name}: no frames in it; record or export it again")
        if len(self.problems) == 1:
            (problem,) = self.problems
            return InputError(problem if self.name in problem else f"{self.name}, {problem}")
        return InputError(
            f"{self.name}: none of {len(self.problems)} frames can be read; the first: {self.problems[0]}"
        )

    def describe(self) -> dict[str, Any]:
        """What is inside, as plain data (schema ``siloscope.info/1``): the document of ``siloscope info --json``."""
        camera, times = self.camera, self.timestamps
        return {
            "schema": "siloscope.info/1",
            "file": self.name,
            "format": self.format,
            "frames": self._count(),
            "streams": self._streams(),
            "topics": self._topics(),
            "camera": camera.to_dict() if camera else None,
            "camera_from": "given" if self.options.cameras else self.provenance.get("camera_from"),
            "depth_unit": self.depth_unit,
            "depth_unit_from": self._origin_of_unit(),
            "gravity": None if self.gravity is None else [float(g) for g in self.gravity],
            "timestamps": {"first": times[0], "last": times[-1]} if times else None,
            "provenance": self.provenance,
            "problems": self.problems,
        }

    def _origin_of_unit(self) -> str | None:
        if self.options.depth_unit is not None:
            return "given"
        from_file: str | None = self.provenance.get("depth_unit_from")
        return from_file if self.options.camera_depth_unit is None else "given camera file"

    def close(self) -> None:  # noqa: B027 (most sources hold nothing open)
        """Lets go of the file; iterating is over."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class Ahead:
    """What `FrameSource.ahead` gives: the source's frames, to be gone through once or several times."""

    def __init__(self, source: FrameSource, pool: Executor, count: int) -> None:
        self.source = source
        self.pool = pool
        self.count = count

    def __len__(self) -> int:
        return len(self.source)

    def __bool__(self) -> bool:
        return True

    def __iter__(self) -> Iterator[Frame]:
        return self.source._frames(self.pool, self.count)


def _told(label: str, error: InputError) -> str:
    """The error with the frame named once."""
    return str(error) if label in str(error) else f"{label}: {error}"


def check_image_size(name: str, width: int, height: int) -> None:
    """Raises `InputError` for an image size that is none, or too large to be a depth frame."""
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE and width * height <= MAX_PIXELS):
        raise InputError(
            f"{name}: the image is declared {width} x {height} pixels, more than a depth frame has "
            f"({MAX_SIDE} a side, {MAX_PIXELS} in all) or none at all; the file is damaged, export the frame again"
        )


def read_bytes(path: Path) -> bytes:
    """A whole file; raises `InputError` where it can't be read."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: can't be read ({error.strerror}); check the path and its permissions") from None
