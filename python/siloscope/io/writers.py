"""Writes frames and clouds in formats that everybody reads; `siloscope.io` reads them again."""

from __future__ import annotations

import json
from collections.abc import Sequence
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import UsageError
from siloscope.io import camera_files
from siloscope.types.camera import Camera
from siloscope.types.frame import Frame

StrPath = str | PathLike[str]

LARGEST_RAW = 65_534
"""Largest depth in raw units: 65535 is "no measurement"."""

PNG_LEVEL = 2
"""Deflate level: files a few per cent larger than at the usual 6, written some times faster."""

_PLY_TYPES = {"f4": "float", "f8": "double", "u1": "uchar", "i4": "int"}

write_camera = camera_files.dump


def to_raw(depth: NDArray[Any], depth_unit: float) -> NDArray[np.uint16]:
    """Depth in metres as raw units, rounded; what is no measurement becomes 0.

    Raises `UsageError` where the unit is too fine for the farthest depth.
    """
    measured = np.isfinite(depth) & (depth > 0)
    raw = np.rint(np.where(measured, depth, 0.0) / depth_unit)
    if raw.max(initial=0) > LARGEST_RAW:
        farthest = float(np.max(depth, where=measured, initial=0.0))
        raise UsageError(
            f"16 bits of {depth_unit} m reach {LARGEST_RAW * depth_unit:.3f} m, not {farthest:.3f} m; "
            f"use a unit of {farthest / LARGEST_RAW:.2g} m or more"
        )
    return raw.astype(np.uint16)


def write_png(path: StrPath, raw: NDArray[np.uint16]) -> None:
    """Writes raw depth (H, W) as 16-bit grey PNG; the unit goes into the camera file beside it."""
    from PIL import Image

    if raw.dtype != np.uint16 or raw.ndim != 2:
        raise UsageError(f"a depth PNG takes a uint16 array (H, W), not {raw.dtype} {raw.shape}; see to_raw")
    Image.fromarray(np.ascontiguousarray(raw)).save(path, "PNG", compress_level=PNG_LEVEL)


def write_npy(path: StrPath, array: NDArray[Any]) -> None:
    """Writes one array: raw units as integers, metres as floating point."""
    with open(path, "wb") as file:
        np.save(file, array, allow_pickle=False)


def write_npz(
    path: StrPath,
    values: NDArray[Any],
    *,
    name: str = "depth",
    camera: Camera | None = None,
    depth_unit: float | None = None,
    timestamps: Sequence[float] | None = None,
    gravity: NDArray[np.float64] | None = None,
    labels: NDArray[np.integer[Any]] | None = None,
    provenance: str | None = None,
) -> None:
    """Writes depth (H, W), a stack (F, H, W), or points (`name` "points") with what belongs to them into one file.

    `provenance` is text, such as the JSON of `siloscope convert`.
    """
    known: dict[str, Any] = {"depth_unit": depth_unit, "timestamps": timestamps, "gravity": gravity, "labels": labels}
    known |= {name: values, "provenance": provenance}
    beside: dict[str, Any] = {key: np.asarray(value) for key, value in known.items() if value is not None}
    if camera is not None:
        beside["camera"] = np.asarray(json.dumps(camera.to_dict()))
    with open(path, "wb") as file:
        np.savez_compressed(file, **beside)


def write_ply(
    path: StrPath,
    points: NDArray[Any],
    *,
    colours: NDArray[np.uint8] | None = None,
    normals: NDArray[Any] | None = None,
    labels: NDArray[np.integer[Any]] | None = None,
    comments: Sequence[str] = (),
) -> None:
    """Writes points (N, 3), or organised (H, W, 3), as binary PLY with what goes with each of them.

    float64 stays double, all else becomes float. `colours` (…, 3) uint8, `normals` (…, 3), `labels` (…) as int.
    """
    columns = [*_columns("x y z", points, _float_kind(points))]
    if normals is not None:
        columns += _columns("nx ny nz", normals, "f4")
    if colours is not None:
        columns += _columns("red green blue", colours, "u1")
    if labels is not None:
        columns += _columns("label", labels[..., None], "i4")
    table = np.empty(len(columns[0][2]), [(name, f"<{kind}") for name, kind, _ in columns])
    for name, _, values in columns:
        if len(values) != len(table):
            raise UsageError(f"'{name}' has {len(values)} entries for {len(table)} points")
        table[name] = values
    with open(path, "wb") as file:
        file.write(_ply_header(columns, points.shape, comments).encode("ascii", "replace"))
        file.write(table.tobytes())


def _float_kind(points: NDArray[Any]) -> str:
    return "f8" if points.dtype == np.float64 else "f4"


def _columns(names: str, values: NDArray[Any], kind: str) -> list[tuple[str, str, NDArray[Any]]]:
    flat = values.reshape(-1, values.shape[-1])
    keys = names.split()
    if flat.shape[1] != len(keys):
        raise UsageError(f"'{names}' takes {len(keys)} values a point, not {flat.shape[1]}")
    return [(key, kind, flat[:, i]) for i, key in enumerate(keys)]


def _ply_header(columns: Sequence[tuple[str, str, Any]], shape: tuple[int, ...], comments: Sequence[str]) -> str:
    organised = [f"obj_info num_cols {shape[1]}", f"obj_info num_rows {shape[0]}"] if len(shape) == 3 else []
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        *(f"comment {' '.join(comment.split())}" for comment in comments),
        *organised,
        f"element vertex {len(columns[0][2])}",
        *(f"property {_PLY_TYPES[kind]} {name}" for name, kind, _ in columns),
        "end_header",
    ]
    return "\n".join(lines) + "\n"


def write_frame(path: StrPath, frame: Frame) -> None:
    """Writes a frame's values in the format that keeps them: raw depth as PNG, metres as NumPy array, points as PLY."""
    if frame.points is not None:
        write_ply(path, frame.points, labels=frame.labels)
    elif frame.depth is not None and frame.depth.dtype == np.uint16:
        write_png(path, frame.depth)
    elif frame.depth is not None:
        write_npy(path, frame.depth)


def suffix(frame: Frame) -> str:
    """The name ending that goes with `write_frame`."""
    if frame.points is not None:
        return ".ply"
    return ".png" if frame.depth is not None and frame.depth.dtype == np.uint16 else ".npy"
