"""Small files of the formats that came later, made from scratch: what tests read and mutate."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import recording_files
from frame_files import CAMERA, CLOUD, METRES, POINTS, RAW
from siloscope.io.zstandard import zstd


def pgm(raw: NDArray[np.uint16] = RAW, comment: bytes = b"# a depth image\n") -> bytes:
    """A binary PGM of 16 bits."""
    height, width = raw.shape
    return b"P5\n" + comment + f"{width} {height}\n65535\n".encode() + raw.astype(">u2").tobytes()


def text_pgm() -> bytes:
    """A PGM as text."""
    height, width = RAW.shape
    rows = "\n".join(" ".join(map(str, row)) for row in RAW.tolist())
    return f"P2 {width} {height} 65535\n{rows}\n".encode()


def pfm(order: str = "<") -> bytes:
    """A PFM, whose rows go upwards, in either byte order."""
    height, width = METRES.shape
    scale = "-1.0" if order == "<" else "1.0"
    return f"Pf\n{width} {height}\n{scale}\n".encode() + METRES[::-1].astype(f"{order}f4").tobytes()


VIEWER = f"""Frame Info:\x20
Type,Depth
Format,Z16
Frame Number,12
Resolution x,{CAMERA.width}
Resolution y,{CAMERA.height}
Bytes per pixel,2

Intrinsic:,
Fx,{CAMERA.fx}
Fy,{CAMERA.fy}
PPx,{CAMERA.cx}
PPy,{CAMERA.cy}
Distorsion,Brown Conrady
"""


def write_snapshot(folder: Path, name: str = "shot_Depth") -> Path:
    """What the Viewer's snapshot leaves: the pixels and their description."""
    (folder / f"{name}.raw").write_bytes(RAW.astype("<u2").tobytes())
    (folder / f"{name}_metadata.csv").write_text(VIEWER)
    return folder / f"{name}.raw"


def pixel_table(step: int = 1) -> bytes:
    """The 3-D CSV of rs-convert, of every so many pixels."""
    rows = ["i,j,x (meters),y (meters),depth (meters)"]
    for v in range(0, CAMERA.height, step):
        for u in range(0, CAMERA.width, step):
            x, y, z = POINTS[v, u]
            if math.isfinite(z):
                rows.append(f"{u},{v},{x:.6f},{y:.6f},{z:.6g}")
    return "\n".join(rows).encode() + b"\n"


def faces_first_ply(order: str = "<", mixed: bool = False) -> bytes:
    """A binary PLY whose faces, of three or of three and four corners, stand before the vertices."""
    kind = "binary_little_endian" if order == "<" else "binary_big_endian"
    corners = [4 if mixed and i % 3 == 0 else 3 for i in range(20)]
    head = (
        f"ply\nformat {kind} 1.0\nelement face {len(corners)}\nproperty list uchar int vertex_indices\n"
        f"property uchar flag\nelement vertex {len(CLOUD)}\nproperty float x\nproperty float y\nproperty float z\n"
        "end_header\n"
    ).encode()
    faces = b"".join(struct.pack(f"{order}B{n}iB", n, *range(n), 7) for n in corners)
    return head + faces + CLOUD.astype(f"{order}f4").tobytes()


def _vertices() -> list[str]:
    return [f"{x:.9g} {y:.9g} {z:.9g}" for x, y, z in CLOUD]


def obj() -> bytes:
    """An OBJ with normals, textures and faces."""
    lines = ["# a mesh", "mtllib a.mtl", "o silo", *(f"v {vertex}" for vertex in _vertices())]
    return "\n".join([*lines, "vn 0 0 1", "vt 0.5 0.5", "f 1//1 2//1 3//1", "f 1 2 3 4"]).encode() + b"\n"


def off() -> bytes:
    """An OFF with a comment and faces."""
    vertices = _vertices()
    return "\n".join(["OFF # a mesh", f"{len(vertices)} 2 0", *vertices, "3 0 1 2", "4 0 1 2 3", ""]).encode()


# --- Livox, laid out by hand.

LIVOX = np.random.default_rng(6).integers(-4000, 4000, (3, 96, 3)).astype("<i4")
"""Three packages of points, millimetres."""
TAGS = np.zeros((3, 96), np.uint8)
TAGS[:, 5], TAGS[:, 6], TAGS[:, 7], TAGS[:, 8] = 0b0100, 0b1000, 0b0010, 0b110000
"""Noise by strength with high confidence and with moderate, by place with moderate; the last is a second return."""
TIMES_NS = (5_000_000_000, 5_400_000_000, 6_200_000_000)


def _livox(version: int, packages: Iterable[bytes]) -> bytes:
    devices = {1: 59, 2: 63}[version]
    head = b"livox_tech".ljust(16, b"\0") + bytes([version, 2 - version, 0, 0]) + struct.pack("<IIB", 0xAC0EA767, 50, 1)
    data = head + bytes(devices)
    for number, content in enumerate(packages):
        after = len(data) + 24 + len(content)
        data += struct.pack("<QQQ", len(data), after, number) + content
    return data


def lvx_1_0(devices: int) -> bytes:
    """An LVX of version 1.0: one byte beside its head, devices of so many bytes, packages as in 1.1."""
    head = b"livox_tech".ljust(16, b"\0") + bytes([1, 0, 0, 0]) + struct.pack("<IB", 0xAC0EA767, 2)
    data = head + bytes(2 * devices)
    for number, (points, time_ns) in enumerate(zip(LIVOX, TIMES_NS, strict=True)):
        rows = np.zeros(100, [("xyz", "<i4", 3), ("reflectivity", "u1")])
        rows["xyz"][:96] = points
        content = struct.pack("<5BIBBQ", 0, 5, 1, 1, 0, 0, 0, 0, time_ns) + rows.tobytes()
        data += struct.pack("<QQQ", len(data), len(data) + 24 + len(content), number) + content
    return data


def _tagged(points: NDArray[np.int32], tags: NDArray[np.uint8]) -> bytes:
    rows = np.zeros(len(points), [("xyz", "<i4", 3), ("reflectivity", "u1"), ("tag", "u1")])
    rows["xyz"], rows["tag"] = points, tags
    return rows.tobytes()


def lvx() -> bytes:
    """An LVX of version 1.1: a frame a package, each beside a sample of the accelerometer."""
    packages = []
    for points, tags, time_ns in zip(LIVOX, TAGS, TIMES_NS, strict=True):
        head = struct.pack("<5BIBBQ", 0, 5, 1, 1, 0, 0, 0, 2, time_ns)
        imu = struct.pack("<5BIBBQ", 0, 5, 1, 1, 0, 0, 0, 6, time_ns) + struct.pack("<6f", 0, 0, 0, 0.6, 0.0, 0.8)
        packages.append(head + _tagged(points, tags) + imu)
    return _livox(1, packages)


def polar_lvx() -> bytes:
    """An LVX with 100 points in polar form: range in millimetres, zenith and azimuth in hundredths of a degree."""
    rows = np.zeros(100, [("depth", "<u4"), ("theta", "<u2"), ("phi", "<u2"), ("reflectivity", "u1")])
    rows["depth"], rows["theta"], rows["phi"] = 2000, 9000, np.arange(100) * 90
    return _livox(1, [struct.pack("<5BIBBQ", 0, 5, 1, 1, 0, 0, 0, 1, TIMES_NS[0]) + rows.tobytes()])


def lvx2(centimetres: bool = False) -> bytes:
    """An LVX2 with points in millimetres, or in centimetres."""
    packages = []
    for points, tags, time_ns in zip(LIVOX, TAGS, TIMES_NS, strict=True):
        body = _tagged(points, tags)
        if centimetres:
            rows = np.zeros(96, [("xyz", "<i2", 3), ("reflectivity", "u1"), ("tag", "u1")])
            rows["xyz"], rows["tag"] = points // 10, tags
            body = rows.tobytes()
        kind = 2 if centimetres else 1
        packages.append(struct.pack("<BIBBQHBIB4x", 0, 9, 6, 0, time_ns, 1, kind, len(body), 0) + body)
    return _livox(2, packages)


MAKERS: dict[str, Callable[[], bytes]] = {
    "depth.pgm": pgm,
    "text.pgm": text_pgm,
    "depth.pfm": pfm,
    "pixels.csv": lambda: pixel_table(4),
    "utf-16.csv": lambda: pixel_table(4).decode().encode("utf-16"),
    "faces-first.ply": lambda: faces_first_ply(mixed=True),
    "mesh.obj": lambda: obj()[:6000] + b"\nf 1 2 3\n",
    "mesh.off": off,
    "scan.lvx": lvx,
    "polar.lvx": polar_lvx,
    "old.lvx": lambda: lvx_1_0(58),
    "scan.lvx2": lvx2,
    "bag.mcap.zstd": lambda: zstd.compress(recording_files.ros2(mcap=True)),
    "bag.db3.zst": lambda: zstd.compress(recording_files.ros2(mcap=False)),
}
"""Good files by name."""
