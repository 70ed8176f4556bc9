"""Which camera of a file is the frame's: by its size, scaled to it, or sized by it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from siloscope.errors import InputError
from siloscope.types.camera import Camera
from siloscope.types.intrinsics import IntrinsicsStd

Size = tuple[int, int]
"""Width and height in pixels."""

USUAL_SIZES: tuple[Size, ...] = (
    *((640, 480), (848, 480), (960, 540), (960, 720), (1280, 720), (1280, 800), (1280, 960), (1280, 1024)),
    *((1440, 1080), (1920, 1080), (1920, 1200), (1920, 1440), (2592, 1944), (3840, 2160), (4032, 3024)),
)
"""Sizes of colour images whose intrinsics are handed on without a size."""

CENTRED = 0.2
"""Largest distance of a principal point from the middle of its image, as a fraction of the side, for a size to fit
intrinsics that name none. Sensors' own stay within 0.05."""

CENTRED_IN_USUAL = 0.03
"""The same for a size that is only guessed: the usual sizes of one shape differ by 6 % at least."""


@dataclass(frozen=True)
class Intrinsics:
    """Intrinsics of a calibration, which hold for its images at any scale; fields as in `Camera`.

    `size` is that of the calibration's images, or None where the file does not tell.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    distortion_model: str = "none"
    distortion: tuple[float, ...] = ()
    size: Size | None = None
    intrinsics_std: IntrinsicsStd | None = None

    def of_size(self, size: Size) -> Camera:
        """The camera of an image of this size; raises `InputError` for intrinsics that can't be used."""
        pixels = (self.fx, self.fy, self.cx, self.cy)
        return Camera(*size, *pixels, self.distortion_model, self.distortion, self.intrinsics_std)

    def is_centred(self, size: Size, most: float) -> bool:
        """Whether the principal point lies near the middle of an image of this size."""
        return all(abs((c + 0.5) / side - 0.5) < most for c, side in zip((self.cx, self.cy), size, strict=True))


Known = Camera | Intrinsics
"""A camera of frames of one size, or a calibration."""


def size_of(known: Known) -> Size | None:
    """Width and height, where they are known."""
    return (known.width, known.height) if isinstance(known, Camera) else known.size


def scaled(camera: Camera, size: Size) -> Camera:
    """The camera of the same image at another size; pixel centres are at integers, so edges scale, not centres."""
    by = size[0] / camera.width
    cx, cy = (camera.cx + 0.5) * by - 0.5, (camera.cy + 0.5) * by - 0.5
    std = camera.intrinsics_std and camera.intrinsics_std.scaled(by)
    return Camera(*size, camera.fx * by, camera.fy * by, cx, cy, camera.distortion_model, camera.distortion, std)


def choose(name: str, cameras: Sequence[Known], size: Size) -> tuple[Camera, str | None]:
    """The camera for a frame of this size, and how it was brought to the size, or None where it has it.

    Raises `InputError` that starts with `name` where no camera or more than one fits.
    """
    fitting = [camera for camera in cameras if size_of(camera) == size]
    if fitting:
        only = _only(name, fitting, "of this size")
        return (only if isinstance(only, Camera) else only.of_size(size)), None
    alike = [c for c in cameras if isinstance(c, Intrinsics) and c.size is not None and in_ratio(c.size, size)]
    if alike:
        return _scaled(_only(name, alike, "of this shape"), size)
    (first, *others) = cameras
    if isinstance(first, Intrinsics) and first.size is None and not others:
        return _sized(name, first, size)
    raise InputError(_none_fits(name, cameras, size))


def in_ratio(one: Size, other: Size) -> bool:
    """Whether one size is the other's, scaled."""
    return one[0] * other[1] == one[1] * other[0]


K = TypeVar("K", Known, Intrinsics)


def _only(name: str, fitting: Sequence[K], what: str) -> K:
    if len(set(fitting)) > 1:
        raise InputError(
            f"{name}: the camera file has {len(set(fitting))} different cameras {what}; keep that of the depth stream"
        )
    return fitting[0]


def _scaled(known: Intrinsics, size: Size) -> tuple[Camera, str]:
    full = known.size or size
    return scaled(known.of_size(full), size), f"scaled from {full[0]} x {full[1]}"


def _sized(name: str, known: Intrinsics, size: Size) -> tuple[Camera, str | None]:
    """Intrinsics without a size: of the frame's, or of a usual one of its shape, in whose middle they lie."""
    if known.is_centred(size, CENTRED):
        return known.of_size(size), "its size is the frame's"
    usual = [full for full in USUAL_SIZES if in_ratio(full, size) and known.is_centred(full, CENTRED_IN_USUAL)]
    if len(usual) == 1:
        return _scaled(replace(known, size=usual[0]), size)
    raise InputError(
        f"{name}: the camera file names no image size, and its principal point {known.cx:g}, {known.cy:g} is not near "
        f"the middle of the frame of {size[0]} x {size[1]} pixels; write 'width' and 'height' into the file"
    )


def _none_fits(name: str, cameras: Sequence[Known], size: Size) -> str:
    frame = f"{name}: the frame is {size[0]} x {size[1]} pixels"
    sizes = ", ".join(f"{known[0]} x {known[1]}" if (known := size_of(c)) else "no size" for c in cameras)
    if len(cameras) > 1:
        return f"{frame}, the camera file has {sizes}; keep that of the depth stream"
    only = cameras[0]
    if not isinstance(only, Camera) or not in_ratio((only.width, only.height), size):
        return f"{frame} but the camera {sizes}; give the camera of this stream with --camera"
    offer = scaled(only, size)
    numbers = ", ".join(f"{key} {getattr(offer, key):.7g}" for key in ("fx", "fy", "cx", "cy"))
    return (
        f"{frame} but the camera {sizes}; give the camera of this stream with --camera: for the whole image scaled to "
        f"{size[0]} x {size[1]} it is {numbers}"
    )
