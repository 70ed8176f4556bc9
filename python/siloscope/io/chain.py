"""Several files as one source."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from siloscope.errors import InputError
from siloscope.io.source import FrameSource, Item, Options
from siloscope.types.frame import Frame


class Chain(FrameSource):
    """Several sources one after the other; a damaged one costs only its own frames."""

    def __init__(self, sources: Sequence[FrameSource], options: Options) -> None:
        super().__init__(sources[0].path, "several", options)
        self.name = f"{len(sources)} files"
        self.sources = tuple(sources)
        self.provenance = {"format": "several", "files": [source.provenance for source in sources]}
        self.file_camera = _shared([source.camera for source in sources])
        self.file_depth_unit = _shared([source.depth_unit for source in sources])
        self.independent = all(source.independent for source in sources)

    def _items(self) -> Iterator[Item]:
        for source in self.sources:
            items = source._items()
            while (item := _next_or_damage(source, items)) is not None:
                yield item

    def _finished(self, item: Item) -> Frame:
        return item.read()

    def _count(self) -> int | None:
        counts = [source._count() for source in self.sources]
        return None if None in counts else sum(c for c in counts if c is not None)

    def _streams(self) -> list[dict[str, Any]]:
        return [{"file": source.name, **stream} for source in self.sources for stream in source._streams()]

    def close(self) -> None:
        for source in self.sources:
            source.close()


def _next_or_damage(source: FrameSource, items: Iterator[Item]) -> Item | None:
    """The source's next frame, or in its place the error that ends the source."""
    try:
        item = next(items, None)
    except InputError as error:
        return Item(source.name, partial(_raise, error))
    return item and Item(f"{source.name}, {item.label}", partial(source._finished, item))


class Unreadable(FrameSource):
    """A file among several that can't be opened; its one frame raises the reason."""

    def __init__(self, path: Path, options: Options, error: InputError) -> None:
        super().__init__(path, "unreadable", options)
        self.error = error
        self.problems = [str(error)]

    def _items(self) -> Iterator[Item]:
        yield Item(self.path.name, partial(_raise, self.error))

    def _count(self) -> int:
        return 1


def _raise(error: InputError) -> Frame:
    raise error


def _shared(values: list[Any]) -> Any:
    return values[0] if all(value == values[0] for value in values) else None
