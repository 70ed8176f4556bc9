"""OBJ meshes: their vertices are the points; faces, normals and textures are left out."""

from __future__ import annotations

import io
import warnings
from pathlib import Path

import numpy as np

from siloscope.errors import InputError
from siloscope.io.clouds.columns import CloudSource, cloud_frame
from siloscope.io.source import Format, Options, read_bytes
from siloscope.types.frame import Frame

_WORDS = (b"v", b"vn", b"vt", b"vp", b"f", b"o", b"g", b"s", b"l", b"p", b"mtllib", b"usemtl")


def read(path: Path) -> Frame:
    """The vertices (N, 3); what stands behind their coordinates, such as a colour, is left out."""
    name, data = str(path), read_bytes(path)
    lines = [line[1:] for line in data.replace(b"\r", b"\n").split(b"\n") if line[:2] in (b"v ", b"v\t")]
    if not lines:
        raise InputError(f"{name}: the OBJ has no vertices; export the mesh again")
    with warnings.catch_warnings(action="ignore"):
        try:
            points = np.loadtxt(io.BytesIO(b"\n".join(lines)), np.float64, usecols=(0, 1, 2), ndmin=2)
        except ValueError as error:
            raise InputError(f"{name}: among the vertices, {error}; export the mesh again") from None
    return cloud_frame(name, {axis: points[:, i] for i, axis in enumerate("xyz")}, None)


class ObjSource(CloudSource):
    """One OBJ file."""

    def __init__(self, path: Path, options: Options) -> None:
        super().__init__(path, "obj", options, read)
        data = b"\n" + read_bytes(path).replace(b"\r", b"\n")
        self.size = [data.count(b"\nv ") + data.count(b"\nv\t")]


def _sniff(head: bytes, path: Path) -> bool:
    """Whether the lines begin with OBJ's words, a vertex or its materials among them; the last line may be cut."""
    if b"\0" in head:
        return False
    lines = [line.split(None, 1) for line in (head.replace(b"\r", b"\n") + b"\n").split(b"\n")]
    words = [line[0] for line in lines if line and not line[0].startswith(b"#")]
    known = words[:-1] if len(words) > 1 else words
    return bool(known) and all(word in _WORDS for word in known) and (b"v" in words or b"mtllib" in words)


FORMAT = Format("obj", _sniff, ObjSource, read_one=read)
