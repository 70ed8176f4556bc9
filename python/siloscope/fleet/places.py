"""The store of a place as the user names it: a folder, or the URL of an object store."""

from __future__ import annotations

from pathlib import Path

from siloscope.fleet.store import Store


def open_store(place: str | Path) -> Store:
    """The store of a folder or URL; nothing is read or made yet."""
    text = str(place)
    if is_url(text):
        from siloscope.fleet.object_store import ObjectStore

        return ObjectStore(text)
    from siloscope.fleet.folder_store import FolderStore

    return FolderStore(Path(text).absolute())


def is_url(place: str) -> bool:
    """Whether a place is an object store's URL."""
    return "://" in place and not place.startswith("file://")
