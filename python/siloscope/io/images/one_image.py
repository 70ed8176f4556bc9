"""A file that is one depth image."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from siloscope.io.source import FrameSource, Item, Options
from siloscope.types.frame import Frame


class ImageSource(FrameSource):
    """One image of `size` (width, height) and `dtype`, which `read` decodes."""

    independent = True

    def __init__(
        self,
        path: Path,
        format: str,
        options: Options,
        size: tuple[int, int],
        dtype: str,
        read: Callable[[Path], Frame],
    ) -> None:
        super().__init__(path, format, options)
        self.size, self.dtype, self._read = size, dtype, read

    def _items(self) -> Iterator[Item]:
        yield Item(self.path.name, lambda: self._read(self.path))

    def _count(self) -> int:
        return 1

    def _streams(self) -> list[dict[str, Any]]:
        stream = {"name": "depth", "kind": "depth", "size": list(self.size), "dtype": self.dtype}
        return [{**stream, "frames": 1, "chosen": True}]
