"""The ``….raw`` of RealSense Viewer's snapshots: pixels alone, described by the ``…_metadata.csv`` beside them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from siloscope.errors import InputError
from siloscope.io import camera_files
from siloscope.io.images.one_image import ImageSource
from siloscope.io.source import Format, Options, check_image_size, read_bytes
from siloscope.types.frame import Frame

_DEPTH = "Z16"


def metadata_of(path: Path) -> Path:
    """Where a snapshot's description is."""
    return path.with_name(f"{path.stem}_metadata.csv")


def read_size(path: Path) -> tuple[int, int]:
    """Width and height by the metadata; raises `InputError` for other pixels than depth, or another number of them."""
    beside = metadata_of(path)
    told = dict(line.partition(",")[::2] for line in camera_files.text_of(beside).splitlines())
    pixels = {key.strip(): value.strip() for key, value in told.items()}
    if pixels.get("Format") != _DEPTH:
        raise InputError(f"{path}: {beside.name} says the pixels are '{pixels.get('Format', '')}', not {_DEPTH} depth")
    sides = [pixels.get(f"Resolution {axis}", "") for axis in "xy"]
    if not all(side.isascii() and side.isdigit() and len(side) < 6 for side in sides):
        raise InputError(f"{path}: in {beside.name}, 'Resolution x' and 'Resolution y' are no sizes; save it again")
    width, height = int(sides[0]), int(sides[1])
    check_image_size(str(path), width, height)
    if path.stat().st_size != 2 * width * height:
        raise InputError(
            f"{path}: {path.stat().st_size} bytes are not {width} x {height} pixels of 16 bits, as {beside.name} says; "
            "save the snapshot again"
        )
    return width, height


def read(path: Path) -> Frame:
    """The depth image, in raw units."""
    width, height = read_size(path)
    pixels = np.frombuffer(read_bytes(path), "<u2", width * height)
    return Frame(depth=pixels.reshape(height, width).astype(np.uint16), source=str(path))


class ViewerRawSource(ImageSource):
    """One snapshot with its camera; the metadata tell no depth unit."""

    def __init__(self, path: Path, options: Options) -> None:
        super().__init__(path, "viewer-raw", options, read_size(path), "uint16", read)
        if not options.cameras and options.beside:
            beside = metadata_of(path)
            self.file_camera = camera_files.load(beside, self.size)
            self.provenance["camera_from"] = beside.name


def _sniff(head: bytes, path: Path) -> bool:
    return path.suffix.lower() == ".raw" and metadata_of(path).is_file()


FORMAT = Format("viewer-raw", _sniff, ViewerRawSource, read_one=read)
