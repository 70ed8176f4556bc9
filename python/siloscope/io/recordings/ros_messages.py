"""The messages of ROS that carry depth, cameras, clouds and gravity, for ROS 1 and ROS 2 alike."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError
from siloscope.io import camera_files
from siloscope.io.recordings.wire import Header, Wire
from siloscope.io.source import check_image_size
from siloscope.types.camera import Camera

DEPTH_ENCODINGS = {"16UC1": "u2", "mono16": "u2", "Z16": "u2", "32FC1": "f4"}
"""Image encodings that hold depth, and their pixels (REP 118: 16UC1 is millimetres, 32FC1 metres)."""


class Image(NamedTuple):
    """``sensor_msgs/Image`` with its pixels undecoded, and the bytes after its last declared field."""

    header: Header
    height: int
    width: int
    encoding: str
    big_endian: bool
    step: int
    data: memoryview
    tail: memoryview


def read_image(wire: Wire) -> Image:
    """``sensor_msgs/Image``."""
    header = wire.header()
    height, width, encoding = wire.u32(), wire.u32(), wire.string()
    big_endian, step, data = bool(wire.u8()), wire.u32(), wire.blob()
    return Image(header, height, width, encoding, big_endian, step, data, wire.take(wire.left))


def depth_pixels(image: Image) -> NDArray[np.uint16] | NDArray[np.float32]:
    """Depth (H, W): uint16 in raw units, or float32 in metres; raises `InputError` where the sizes don't agree."""
    kind = DEPTH_ENCODINGS.get(image.encoding)
    if kind is None:
        known = ", ".join(DEPTH_ENCODINGS)
        raise InputError(f"image encoding '{image.encoding}' is not depth; read are {known}")
    check_image_size("image", image.width, image.height)
    size = int(kind[1])
    if image.step < image.width * size or image.step * image.height > len(image.data):
        raise InputError(
            f"image is declared {image.width} x {image.height} with {image.step} bytes a row, "
            f"but {len(image.data)} bytes came"
        )
    order = ">" if image.big_endian else "<"
    rows = np.frombuffer(image.data, np.uint8, image.step * image.height).reshape(image.height, image.step)
    pixels = np.ascontiguousarray(rows[:, : image.width * size]).view(order + kind)
    return pixels.astype(kind, copy=False)


@dataclass(frozen=True)
class CameraInfo:
    """``sensor_msgs/CameraInfo``: what is needed of it, binning and region of interest applied later."""

    header: Header
    height: int
    width: int
    model: str
    d: tuple[float, ...]
    k: tuple[float, ...]
    p: tuple[float, ...]
    binning: tuple[int, int]
    roi: tuple[int, int, int, int]
    """x offset, y offset, height, width; zeros for the whole image."""

    def camera(self, name: str, rectified: bool = False) -> Camera:
        """The camera of the image; `rectified` images have intrinsics P and no distortion (image_pipeline).

        Raises `InputError`, starting with `name`, for intrinsics that are none or an unknown distortion model.
        """
        fx, _, cx, _, fy, cy = self.k[:6]
        model, d = self.model, self.d
        if rectified and self.p[0] > 0:
            fx, cx, fy, cy, d = self.p[0], self.p[2], self.p[5], self.p[6], ()
        bx, by = (max(1, b) for b in self.binning)
        x, y, height, width = self.roi if self.roi[2] and self.roi[3] else (0, 0, self.height, self.width)
        # Binned pixels are averages of bx × by pixels, so centres move by half a pixel of either size.
        cx, cy = (cx - x + 0.5) / bx - 0.5, (cy - y + 0.5) / by - 0.5
        return camera(name, (width // bx, height // by), (fx / bx, fy / by, cx, cy), model, d)


def camera(
    name: str, size: tuple[int, int], focal: tuple[float, float, float, float], model: str, d: tuple[float, ...]
) -> Camera:
    """A camera of `size` (width, height) with `focal` (fx, fy, cx, cy); lenses whose coefficients are 0 have none."""
    fx, fy, cx, cy = focal
    while d and d[-1] == 0:
        d = d[:-1]
    matrix = (fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0)
    return camera_files.camera(name, *size, matrix, model if d else "none", d)


def read_camera_info(wire: Wire) -> CameraInfo:
    """``sensor_msgs/CameraInfo``."""
    header = wire.header()
    height, width, model = wire.u32(), wire.u32(), wire.string()
    d = tuple(wire.f64s().tolist())
    k, _, p = wire.floats(9), wire.floats(9), wire.floats(12)
    binning = wire.u32(), wire.u32()
    roi = wire.u32(), wire.u32(), wire.u32(), wire.u32()
    return CameraInfo(header, height, width, model, d, tuple(k.tolist()), tuple(p.tolist()), binning, roi)


_POINT_FIELDS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}


class Field(NamedTuple):
    """One field of a point: name, offset in bytes, NumPy type."""

    name: str
    offset: int
    dtype: str


class PointCloud(NamedTuple):
    """``sensor_msgs/PointCloud2`` with its points undecoded."""

    header: Header
    height: int
    width: int
    fields: tuple[Field, ...]
    big_endian: bool
    point_step: int
    row_step: int
    data: memoryview


def read_point_cloud(wire: Wire) -> PointCloud:
    """``sensor_msgs/PointCloud2``."""
    header = wire.header()
    height, width = wire.u32(), wire.u32()
    fields = tuple(_read_field(wire) for _ in range(_few(wire.u32())))
    big_endian, point_step, row_step = bool(wire.u8()), wire.u32(), wire.u32()
    return PointCloud(header, height, width, fields, big_endian, point_step, row_step, wire.blob())


def _few(count: int) -> int:
    if count > 1000:
        raise InputError(f"a point is declared to have {count} fields")
    return count


def _read_field(wire: Wire) -> Field:
    name, offset, kind, _ = wire.string(), wire.u32(), wire.u8(), wire.u32()
    return Field(name, offset, _POINT_FIELDS.get(kind, ""))


def cloud_points(cloud: PointCloud) -> NDArray[np.floating[Any]]:
    """Points (N, 3), or (H, W, 3) where organised, in metres; NaN is "no measurement"."""
    by_name = {field.name: field for field in cloud.fields}
    missing = [name for name in "xyz" if name not in by_name]
    if missing:
        raise InputError(f"the point cloud has no field {', '.join(missing)}")
    columns = [_column(cloud, by_name[name]) for name in "xyz"]
    points: NDArray[np.floating[Any]] = np.stack(columns, axis=-1)
    return points if cloud.height > 1 else points.reshape(-1, 3)


def _column(cloud: PointCloud, field: Field) -> NDArray[np.floating[Any]]:
    if not field.dtype:
        raise InputError(f"field {field.name} of the point cloud has an unknown type")
    dtype = np.dtype((">" if cloud.big_endian else "<") + field.dtype)
    # Some writers leave the row step of a single row at 0.
    row_step = cloud.row_step if cloud.height > 1 and cloud.row_step else cloud.width * cloud.point_step
    if field.offset + dtype.itemsize > cloud.point_step or cloud.width * cloud.point_step > row_step:
        raise InputError(f"field {field.name} of the point cloud lies outside its point")
    if not cloud.height * cloud.width:
        raise InputError("the point cloud has no points")
    if (cloud.height - 1) * row_step + cloud.width * cloud.point_step > len(cloud.data):
        raise InputError(
            f"point cloud is declared {cloud.width} x {cloud.height} points, but {len(cloud.data)} bytes came"
        )
    view: NDArray[Any] = np.ndarray(
        (cloud.height, cloud.width), dtype, cloud.data, field.offset, (row_step, cloud.point_step)
    )
    return view.astype(np.float64 if dtype.itemsize == 8 else np.float32)


def read_acceleration(wire: Wire) -> tuple[Header, NDArray[np.float64]]:
    """``sensor_msgs/Imu``: its header and linear acceleration (3,), m/s²."""
    header = wire.header()
    wire.floats(4 + 9 + 3 + 9)
    return header, wire.floats(3)


class Transform(NamedTuple):
    """``geometry_msgs/TransformStamped``: ``p_parent = rotation @ p_child + …``."""

    parent: str
    child: str
    rotation: NDArray[np.float64]


def read_transforms(wire: Wire) -> list[Transform]:
    """``tf2_msgs/TFMessage``."""
    return [_read_transform(wire) for _ in range(_few(wire.u32()))]


def _read_transform(wire: Wire) -> Transform:
    header, child = wire.header(), wire.string()
    wire.floats(3)
    return Transform(header.frame_id.lstrip("/"), child.lstrip("/"), rotation_of(wire.floats(4)))


def rotation_of(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation matrix (3, 3) of a quaternion x, y, z, w of any length but 0."""
    norm = math.hypot(*quaternion.tolist())
    if not 1e-3 < norm < 1e3:
        raise InputError("a transform's rotation is no quaternion")
    x, y, z, w = quaternion / norm
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
