"""Small files of every base format, made from scratch, and how tests read them."""

from __future__ import annotations

import io
import json
import struct
import zlib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import siloscope
from siloscope import Camera, Frame
from siloscope.io import camera_files

HEIGHT, WIDTH = 48, 64
CAMERA = Camera(WIDTH, HEIGHT, 57.25, 57.5, 31.75, 23.25)
UNIT = 0.00025

_rng = np.random.default_rng(7)
RAW: NDArray[np.uint16] = _rng.integers(4000, 20_000, (HEIGHT, WIDTH)).astype(np.uint16)
RAW[:3, :5] = 0
METRES: NDArray[np.float32] = (RAW * UNIT).astype(np.float32)
LABELS: NDArray[np.uint8] = _rng.integers(0, 5, (HEIGHT, WIDTH)).astype(np.uint8)


def organised() -> NDArray[np.float32]:
    """The points (H, W, 3) that `CAMERA` sees in `METRES`, NaN where there is no measurement."""
    z = np.where(METRES > 0, METRES.astype(np.float64), np.nan)
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    x, y = (u - CAMERA.cx) / CAMERA.fx * z, (v - CAMERA.cy) / CAMERA.fy * z
    return np.stack([x, y, z], axis=-1).astype(np.float32)


POINTS = organised()
CLOUD = POINTS[np.isfinite(POINTS).all(axis=2)]


def read(path: Path, **options: object) -> Frame:
    """The only frame of a file."""
    with siloscope.open(path, **options) as source:  # type: ignore[arg-type]
        (frame,) = source
    return frame


def put(folder: Path, content: bytes, name: str = "file") -> Path:
    """A file with this content."""
    (folder / name).write_bytes(content)
    return folder / name


def chunk(kind: bytes, data: bytes) -> bytes:
    """One PNG chunk."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(width: int, height: int, rows: bytes, bits: int = 16, colour: int = 0, interlaced: int = 0) -> bytes:
    """A PNG of filtered rows, whatever its header says of them."""
    header = struct.pack(">IIBBBBB", width, height, bits, colour, 0, 0, interlaced)
    return png_of(chunk(b"IHDR", header), chunk(b"IDAT", zlib.compress(rows)), chunk(b"IEND", b""))


def png_of(*chunks: bytes) -> bytes:
    """A PNG of these chunks."""
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def unfiltered(raw: NDArray[np.uint16]) -> bytes:
    """Rows of a 16-bit PNG with filter 0."""
    return b"".join(b"\0" + row.astype(">u2").tobytes() for row in raw)


def filtered(raw: NDArray[np.uint16], filters: Sequence[int]) -> bytes:
    """Rows of a 16-bit PNG, each with its filter, as the specification defines them (section 9.2)."""
    rows, above = [], [0] * (2 * raw.shape[1])
    for kind, row in zip(filters, raw.astype(">u2"), strict=True):
        line = list(row.tobytes())
        left, corner = [0, 0, *line[:-2]], [0, 0, *above[:-2]]
        foretold = (_foretold(kind, *neighbours) for neighbours in zip(left, above, corner, strict=True))
        rows.append(bytes([kind, *((byte - guess) % 256 for byte, guess in zip(line, foretold, strict=True))]))
        above = line
    return b"".join(rows)


def _foretold(kind: int, a: int, b: int, c: int) -> int:
    nearest = min((a, b, c), key=lambda value: abs(a + b - c - value))
    return (0, a, b, (a + b) // 2, nearest)[kind]


def interlaced_png(raw: NDArray[np.uint16]) -> bytes:
    """A 16-bit grey PNG in the seven passes of Adam7."""
    passes = [(0, 0, 8, 8), (0, 4, 8, 8), (4, 0, 8, 4), (0, 2, 4, 4), (2, 0, 4, 2), (0, 1, 2, 2), (1, 0, 2, 1)]
    parts = [raw[top::down, left::right] for top, left, down, right in passes]
    height, width = raw.shape
    return png(width, height, b"".join(unfiltered(part) for part in parts if part.size), interlaced=1)


def npy(array: NDArray[np.generic]) -> bytes:
    """An array file."""
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def npz(**arrays: object) -> bytes:
    """A compressed archive of arrays."""
    file = io.BytesIO()
    np.savez_compressed(file, **{key: np.asarray(value) for key, value in arrays.items()})  # type: ignore[arg-type]
    return file.getvalue()


def tiff(array: NDArray[np.generic], compression: str | None = None, pages: int = 1) -> bytes:
    """A TIFF with equal pages."""
    file = io.BytesIO()
    more = [Image.fromarray(array)] * (pages - 1)
    Image.fromarray(array).save(file, "TIFF", compression=compression, save_all=True, append_images=more)
    return file.getvalue()


def pcd(data: str, fields: Iterable[tuple[str, str, int]], size: tuple[int, int], body: bytes) -> bytes:
    """A PCD file: fields as (name, TYPE, SIZE)."""
    names, kinds, sizes = zip(*fields, strict=True)
    lines = [
        "# .PCD v0.7 - Point Cloud Data file format",
        "VERSION 0.7",
        f"FIELDS {' '.join(names)}",
        f"SIZE {' '.join(map(str, sizes))}",
        f"TYPE {' '.join(kinds)}",
        f"COUNT {' '.join('1' for _ in names)}",
        f"WIDTH {size[0]}",
        f"HEIGHT {size[1]}",
        "VIEWPOINT 0 0 0 1 0 0 0",
        f"POINTS {size[0] * size[1]}",
        f"DATA {data}",
    ]
    return "\n".join(lines).encode() + b"\n" + body


LABELLED = (("label", "U", 4), ("z", "F", 4), ("x", "F", 4), ("y", "F", 4))


def labelled_table() -> NDArray[np.void]:
    """`POINTS` and `LABELS` as the records of `LABELLED`."""
    table = np.zeros(HEIGHT * WIDTH, [("label", "<u4"), ("z", "<f4"), ("x", "<f4"), ("y", "<f4")])
    table["label"] = LABELS.reshape(-1)
    for i, axis in enumerate("xyz"):
        table[axis] = POINTS[..., i].reshape(-1)
    return table


def lzf(data: bytes) -> bytes:
    """Compresses as LZF does: greedy matches of the last three bytes seen before, literal runs between."""
    out, run, i = bytearray(), bytearray(), 0
    last: dict[bytes, int] = {}
    while i < len(data):
        key = data[i : i + 3]
        start = last.get(key, -1) if len(key) == 3 else -1
        last[key] = i
        back = i - start - 1
        if start < 0 or back >= 1 << 13:
            run.append(data[i])
            i += 1
            if len(run) == 32:
                _flush(out, run)
            continue
        length = 3
        while i + length < len(data) and length < 264 and data[start + length] == data[i + length]:
            length += 1
        _flush(out, run)
        short = length - 2
        out += bytes([min(short, 7) << 5 | back >> 8, *([short - 7] if short >= 7 else []), back & 255])
        i += length
    _flush(out, run)
    return bytes(out)


def _flush(out: bytearray, run: bytearray) -> None:
    if run:
        out += bytes([len(run) - 1]) + run
        run.clear()


def compressed(table: NDArray[np.void]) -> bytes:
    """The body of a binary_compressed PCD."""
    values = b"".join(np.ascontiguousarray(table[name]).tobytes() for name in table.dtype.names or ())
    packed = lzf(values)
    return struct.pack("<II", len(packed), len(values)) + packed


def ply(kind: str = "ascii", points: NDArray[np.float32] = CLOUD) -> bytes:
    """A PLY with an element before the vertices, a comment, and faces after them."""
    order = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}[kind]
    head = (
        f"ply\nformat {kind} 1.0\ncomment made by a test\nelement camera 1\nproperty float view_px\n"
        f"element vertex {len(points)}\nproperty uchar red\nproperty float x\nproperty double y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    ).encode()
    if not order:
        rows = "".join(f"255 {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in points)
        return head + b"0.5\n" + rows.encode() + b"3 0 1 2\n"
    table = np.zeros(len(points), [("r", "u1"), ("x", order + "f4"), ("y", order + "f8"), ("z", order + "f4")])
    for i, axis in enumerate("xyz"):
        table[axis] = points[:, i]
    face = np.array([(3, 0, 1, 2)], f"u1,{order}i4,{order}i4,{order}i4").tobytes()
    return head + np.array(0.5, order + "f4").tobytes() + table.tobytes() + face


def xyz(delimiter: str = " ", heading: str = "") -> bytes:
    """Points as text."""
    rows = (delimiter.join(f"{value:.9g}" for value in point) for point in CLOUD)
    return (heading + "\n".join(rows) + "\n").encode()


def _table(binary: str) -> bytes:
    table = labelled_table()
    if binary == "ascii":
        body = "".join(" ".join(f"{value:.9g}" for value in row) + "\n" for row in table.tolist()).encode()
    else:
        body = table.tobytes() if binary == "binary" else compressed(table)
    return pcd(binary, LABELLED, (WIDTH, HEIGHT), body)


def write_folder(folder: Path) -> Path:
    """A folder of three depth images with their camera."""
    folder.mkdir(parents=True)
    for i in (1, 2, 10):
        (folder / f"depth_{i}.png").write_bytes(png(WIDTH, HEIGHT, unfiltered(RAW + np.uint16(i))))
    camera_files.dump(CAMERA, folder / "camera.json", depth_unit=UNIT)
    return folder


def write_tum(folder: Path) -> Path:
    """The TUM layout with two depth images."""
    (folder / "depth").mkdir(parents=True)
    names = [f"depth/13050314{i:02d}.25.png" for i in (53, 54)]
    for name in names:
        (folder / name).write_bytes(png(WIDTH, HEIGHT, unfiltered(RAW)))
    (folder / "depth.txt").write_text("# depth maps\n" + "".join(f"{name[6:-4]} {name}\n" for name in names))
    return folder


MAKERS: dict[str, Callable[[], bytes]] = {
    "depth.png": lambda: png(WIDTH, HEIGHT, unfiltered(RAW)),
    "interlaced.png": lambda: interlaced_png(RAW),
    "raw.npy": lambda: npy(RAW),
    "metres.npy": lambda: npy(METRES),
    "stack.npy": lambda: npy(np.stack([RAW, RAW])),
    "points.npy": lambda: npy(POINTS),
    "frame.npz": lambda: npz(depth=RAW, depth_unit=UNIT, camera=json.dumps(CAMERA.to_dict()), labels=LABELS),
    "raw.tif": lambda: tiff(RAW),
    "lzw.tif": lambda: tiff(METRES, "tiff_lzw"),
    "deflate.tif": lambda: tiff(RAW, "tiff_deflate", pages=2),
    "ascii.ply": lambda: ply("ascii"),
    "little.ply": lambda: ply("binary_little_endian"),
    "big.ply": lambda: ply("binary_big_endian"),
    "ascii.pcd": lambda: _table("ascii"),
    "binary.pcd": lambda: _table("binary"),
    "compressed.pcd": lambda: _table("binary_compressed"),
    "points.xyz": xyz,
    "points.csv": lambda: xyz(",", "x,y,z\n"),
    "image.csv": lambda: "\n".join(",".join(map(str, row)) for row in RAW.tolist()).encode(),
}
"""Content of one small file of every base format, by its name."""
