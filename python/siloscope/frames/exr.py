"""OpenEXR depth images of renderers, by `OpenEXR` (extra ``exr``).

Some renderers store the length of the ray, not z; nothing in the file tells, `ray_length` says it.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError
from siloscope.frame import Frame
from siloscope.frames.extras import need
from siloscope.frames.source import Format, FrameSource, Item, Options, check_image_size

MAGIC = b"\x76\x2f\x31\x01"
_NAMES = ("z", "depth", "distance")
"""Names of depth channels, with or without a layer before them, the surest first."""
_BACKGROUND = 1e9
"""Renderers write such distances, or infinity, where the ray meets nothing."""


def depth_channel(name: str, channels: list[str], wanted: str | None) -> str:
    """The channel that holds depth; raises `InputError` where nothing tells, naming the channels."""
    if wanted is not None:
        fitting = [channel for channel in channels if channel == wanted] or [c for c in channels if wanted in c]
        if len(fitting) == 1:
            return fitting[0]
        raise InputError(f"{name}: {len(fitting)} channels named '{wanted}'; there are {', '.join(channels)}")
    if len(channels) == 1:
        return channels[0]
    for ending in _NAMES:
        fitting = [channel for channel in channels if channel.rsplit(".", 1)[-1].lower() == ending]
        if len(fitting) == 1:
            return fitting[0]
    layers = [c for c in channels if "depth" in c.lower() or "dist" in c.lower()]
    if len(layers) == 1:
        return layers[0]
    raise InputError(f"{name}: which channel is depth? choose with --stream: {', '.join(channels)}")


class ExrSource(FrameSource):
    """One EXR image, as floating-point metres."""

    def __init__(self, path: Path, options: Options) -> None:
        super().__init__(path, "exr", options)
        self.exr = need("OpenEXR", "exr", f"{path}: reading EXR")
        header, self.channels = self._header()
        low, high = header["dataWindow"]
        self.size = int(high[0]) - int(low[0]) + 1, int(high[1]) - int(low[1]) + 1
        check_image_size(self.name, *self.size)
        self.channel = depth_channel(self.name, self.channels, options.stream)
        self.provenance["stream"] = self.channel

    def _header(self) -> tuple[dict[str, Any], list[str]]:
        try:
            with self.exr.File(str(self.path), separate_channels=True, header_only=True) as file:
                header = dict(file.header())
                return header, [channel.name for channel in header["channels"]]
        except Exception as error:
            raise self._damaged(error) from None

    def _items(self) -> Iterator[Item]:
        yield Item(self.path.name, self._decode)

    def _decode(self) -> Frame:
        try:
            with self.exr.File(str(self.path), separate_channels=True) as file:
                pixels: NDArray[Any] = np.array(file.channels()[self.channel].pixels)
        except Exception as error:
            raise self._damaged(error) from None
        if pixels.ndim != 2 or pixels.dtype.kind != "f":
            raise InputError(
                f"{self.name}: channel {self.channel} is {pixels.dtype} of shape {pixels.shape}, not depth"
            )
        depth = pixels.astype(np.float32)
        return Frame(depth=np.where(depth < _BACKGROUND, depth, np.float32(0)))

    def _damaged(self, error: Exception) -> InputError:
        cause = str(error).splitlines()[0] if str(error) else type(error).__name__
        return InputError(f"{self.name}: damaged EXR file ({cause}); render it again")

    def _count(self) -> int:
        return 1

    def _streams(self) -> list[dict[str, Any]]:
        return [
            {"name": name, "kind": "depth", "size": self.size, "frames": 1, "chosen": name == self.channel}
            for name in self.channels
        ]


FORMAT = Format("exr", lambda head, path: head.startswith(MAGIC), ExrSource, extra="exr")
