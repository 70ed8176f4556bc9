"""Depth frames from the files and sensors that users have.

`open` looks at the content, picks the format's module, and gives a `FrameSource` to iterate over.
"""

from __future__ import annotations

import math
import stat
from collections.abc import Iterator, Sequence
from importlib import import_module
from os import PathLike
from pathlib import Path

from siloscope.errors import InputError, UsageError
from siloscope.io.camera_sizes import Known
from siloscope.io.chain import Chain, Unreadable
from siloscope.io.orientation import checked_axes
from siloscope.io.registry import unread, without_header
from siloscope.io.source import HEAD_BYTES, Format, FrameSource, Item, Options
from siloscope.types.camera import Camera
from siloscope.types.frame import Frame

__all__ = ["Format", "Frame", "FrameSource", "Item", "Options", "formats", "open", "sniff"]

_MODULES = (
    # Own magic bytes first, plain text last.
    "images.png",
    "arrays.npy",
    "arrays.npz",
    "clouds.ply",
    "clouds.pcd",
    "images.tiff",
    "images.netpbm",
    "recordings.containers.rosbag1",
    "recordings.containers.mcap",
    "recordings.containers.sqlite_bag",
    "sealed",
    "archive",
    "recordings.containers.ros2_folder",
    "recordings.containers.mkv",
    "clouds.e57",
    "clouds.las",
    "clouds.livox",
    "images.exr",
    "recordings.containers.packed",
    "images.viewer_raw",
    "clouds.off",
    "clouds.obj",
    "folder",
    "clouds.xyz",
)
"""One module a format, in the order they are asked; each has a `Format` named ``FORMAT``."""

StrPath = str | PathLike[str]


def formats() -> Iterator[Format]:
    """All formats, in the order in which they are asked; imports their modules."""
    for module in _MODULES:
        yield import_module(f"siloscope.io.{module}").FORMAT


def open(
    path: StrPath | Sequence[StrPath],
    *,
    camera: Camera | StrPath | None = None,
    depth_unit: float | None = None,
    stream: str | None = None,
    ray_length: bool = False,
    axes: str | None = None,
    up: str | None = None,
) -> FrameSource:
    """Opens a file or folder, or several one after the other, by its content; decodes nothing yet.

    Parameters
    ----------
    path : path, or sequence of paths
        What to read.
    camera : Camera or path, optional
        Intrinsics, or a file with them; wins over the file's own.
    depth_unit : float, optional
        Metres per raw unit; wins over the file's own. Floating-point values that are metres already stay so.
    stream : str, optional
        Which of several depth streams.
    ray_length : bool
        The stored depth is the length of the ray, not z.
    axes : str, optional
        Axes of a cloud's file that are right, down and forward for the sensor, such as "x,-y,-z" where z points
        backwards and y up. Without it they are found by where the points lie.
    up : str, optional
        Instead of `axes`, the axis of the file that points upwards: "z", "-y".

    Raises
    ------
    InputError
        Where the file is missing, empty, of no known format, or damaged at its head.
    UsageError
        For a depth unit that can't be one, or axes that are no right-handed frame.
    """
    cameras, camera_unit = _cameras(camera)
    options = Options(cameras, _unit(depth_unit), camera_unit, stream, ray_length, turn=checked_axes(axes, up))
    if isinstance(path, str | PathLike):
        return _open_one(Path(path), options)
    if not path:
        raise UsageError("no files given")
    if len(path) == 1:
        return _open_one(Path(path[0]), options)
    return Chain([_open_or_tell(Path(one), options) for one in path], options)


def sniff(path: StrPath) -> Format:
    """The format of a file or folder, from its content; raises `InputError` where none fits."""
    path = Path(path)
    head = _head(path)
    *marked, text = formats()
    for known in marked:
        if known.sniff(head, path):
            return known
    if other := unread(head, path):  # some are text with numbers in it
        raise InputError(f"{path}: is {other.name}, which is not read; {other.advice}")
    if text.sniff(head, path):
        return text
    if other := without_header(head, path):
        raise InputError(f"{path}: is {other.name}, which is not read; {other.advice}")
    names = ", ".join(known.name for known in formats())
    found = "a folder with nothing readable in it" if path.is_dir() else f"content starting with {head[:16]!r}"
    raise InputError(f"{path}: {found} is of no known format; formats read are {names}")


def _open_one(path: Path, options: Options) -> FrameSource:
    try:
        source = sniff(path).open(path, options)
        _check_stream(source, options.stream)
        return source
    except OSError as error:
        cause = error.strerror or str(error)
        raise InputError(f"{path}: can't be read ({cause}); check the path and its permissions") from None


def _check_stream(source: FrameSource, wanted: str | None) -> None:
    """Formats with one stream don't look for the one that the user names."""
    names = [str(stream.get("name")) for stream in source._streams() if stream.get("chosen")] if wanted else []
    if wanted and names and not any(wanted in name for name in names):
        source.close()
        raise UsageError(f"{source.name}: has the stream '{names[0]}', none named '{wanted}'; leave --stream out")


def _open_or_tell(path: Path, options: Options) -> FrameSource:
    try:
        return _open_one(path, options)
    except InputError as error:
        return Unreadable(path, options, error)


def _head(path: Path) -> bytes:
    try:
        mode = path.stat().st_mode
        if stat.S_ISDIR(mode):
            return b""
        if not stat.S_ISREG(mode):
            raise InputError(f"{path}: not a file or folder; save the frame in a file first")
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
    except InputError:
        raise
    except FileNotFoundError:
        if url := _url_of(path):
            raise InputError(
                f"{url}: frames in an object store are read by `siloscope fleet` and written by `siloscope pack`; for "
                "this command copy the store, or a silo's folder of it, to a disk and name that"
            ) from None
        raise InputError(f"{path}: no such file; give the path of a frame that exists") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: can't be read ({error}); check the path and its permissions") from None
    if not head:
        raise InputError(f"{path}: the file is empty; export the frame again")
    return head


def _url_of(path: Path) -> str | None:
    """The URL that was given as a path, which has lost a slash; None for a path."""
    scheme, colon, rest = str(path).partition(":/")
    return f"{scheme}://{rest.lstrip('/')}" if colon and scheme.isalnum() and len(scheme) > 1 else None


def _cameras(camera: Camera | StrPath | None) -> tuple[tuple[Known, ...], float | None]:
    """The cameras that the user gives, and the depth unit in their file."""
    if camera is None or isinstance(camera, Camera):
        return () if camera is None else (camera,), None
    from siloscope.io import camera_files

    stored = camera_files.read(camera)
    return stored.cameras, stored.depth_unit


def _unit(depth_unit: float | None) -> float | None:
    if depth_unit is None:
        return None
    unit = float(depth_unit)
    if not (math.isfinite(unit) and 0 < unit <= 1):
        raise UsageError(f"a depth unit of {depth_unit} m is not possible; give metres per raw unit, such as 0.001")
    return unit
