"""OpenEXR depth images of renderers.

Some renderers store the length of the ray, not z; nothing in the file tells, `ray_length` says it.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from siloscope import _core
from siloscope.errors import InputError
from siloscope.io.beside import take_camera_beside
from siloscope.io.source import Format, FrameSource, Item, Options, check_image_size
from siloscope.types.frame import Frame

MAGIC = b"\x76\x2f\x31\x01"
_NAMES = ("z", "depth", "distance")
"""Names of depth channels, with or without a layer before them, the surest first."""
_BACKGROUND = 1e9
"""Renderers write such distances, or infinity, where the ray meets nothing."""


class Channel(NamedTuple):
    """One channel of one part of the file."""

    part: int
    name: str
    size: tuple[int, int]
    """Width and height."""


def depth_channel(name: str, channels: list[Channel], wanted: str | None) -> Channel:
    """The channel that holds depth; raises `InputError` where nothing tells, naming the channels."""
    listed = ", ".join(dict.fromkeys(channel.name for channel in channels)) or "none"
    if wanted is not None:
        fitting = [channel for channel in channels if channel.name == wanted]
        fitting = fitting or [channel for channel in channels if wanted in channel.name]
        if len(fitting) == 1:
            return fitting[0]
        raise InputError(f"{name}: {len(fitting)} channels named '{wanted}'; there are {listed}")
    if len(channels) == 1:
        return channels[0]
    for ending in _NAMES:
        fitting = [channel for channel in channels if channel.name.rsplit(".", 1)[-1].lower() == ending]
        if len(fitting) == 1:
            return fitting[0]
    fitting = [channel for channel in channels if "depth" in channel.name.lower()]
    if len(fitting) == 1:
        return fitting[0]
    raise InputError(f"{name}: which channel is depth? choose with --stream: {listed}")


class ExrSource(FrameSource):
    """One EXR image, as floating-point metres."""

    def __init__(self, path: Path, options: Options) -> None:
        super().__init__(path, "exr", options)
        self.channels = self._read_channels()
        self.channel = depth_channel(self.name, self.channels, options.stream)
        check_image_size(self.name, *self.channel.size)
        self.provenance["stream"] = self.channel.name
        take_camera_beside(self, self.channel.size)

    def _read_channels(self) -> list[Channel]:
        try:
            parts = _core.exr_parts(self.path)
        except ValueError as error:
            raise self._damaged(error) from None
        return [Channel(i, name, (part.width, part.height)) for i, part in enumerate(parts) for name in part.channels]

    def _items(self) -> Iterator[Item]:
        yield Item(self.path.name, self._decode)

    def _decode(self) -> Frame:
        width, height = self.channel.size
        try:
            depth = _core.decode_exr(self.path, self.channel.part, self.channel.name).reshape(height, width)
        except ValueError as error:
            raise self._damaged(error) from None
        return Frame(depth=np.where(depth < _BACKGROUND, depth, np.float32(0)))

    def _damaged(self, error: ValueError) -> InputError:
        return InputError(f"{self.name}: damaged EXR, or a compression not read ({error}); save it with ZIP")

    def _count(self) -> int:
        return 1

    def _streams(self) -> list[dict[str, Any]]:
        stream = {"kind": "depth", "frames": 1}
        return [{**stream, "name": c.name, "size": c.size, "chosen": c is self.channel} for c in self.channels]


FORMAT = Format("exr", lambda head, path: head.startswith(MAGIC), ExrSource)
