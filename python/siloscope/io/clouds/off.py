"""OFF meshes: their vertices are the points, faces are left out."""

from __future__ import annotations

import re
from pathlib import Path

from siloscope.errors import InputError
from siloscope.io.clouds.columns import CloudSource, cloud_frame, numbers_in_text
from siloscope.io.source import Format, Options, read_bytes
from siloscope.types.frame import Frame

_MAGIC = re.compile(rb"\s*(?:ST)?C?N?OFF(?=[\s#])(?! BINARY)")
_COUNTS = re.compile(rb"(?:\s|#[^\n]*\n)*(\d{1,12})\s+\d{1,12}(?:\s+\d{1,12})?[^\n]*\n")
_LONGEST_HEADER = 4096


def _header(name: str, head: bytes) -> tuple[int, int]:
    """Number of vertices, and where they begin; raises `InputError`."""
    magic = _MAGIC.match(head)
    counts = _COUNTS.match(head, magic.end()) if magic else None
    if counts is None:
        raise InputError(f"{name}: the OFF header names no counts of vertices and faces; export the mesh again")
    return int(counts[1]), counts.end()


def read(path: Path) -> Frame:
    """The vertices (N, 3); what stands behind their coordinates, such as a colour, is left out."""
    name, data = str(path), read_bytes(path)
    count, start = _header(name, data[:_LONGEST_HEADER])
    rest = re.sub(rb"#[^\n]*", b"", data[start:])
    first = rest.lstrip().split(b"\n", 1)[0].split()
    table = numbers_in_text(name, rest, count, max(3, len(first)), "vertices")
    return cloud_frame(name, {axis: table[:, i] for i, axis in enumerate("xyz")}, None)


class OffSource(CloudSource):
    """One OFF file."""

    def __init__(self, path: Path, options: Options) -> None:
        super().__init__(path, "off", options, read)
        with path.open("rb") as file:
            self.size = [_header(self.name, file.read(_LONGEST_HEADER))[0]]


FORMAT = Format("off", lambda head, path: _MAGIC.match(head) is not None, OffSource, read_one=read)
