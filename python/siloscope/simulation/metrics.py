"""The measures of section 2.4.4: ratios by pixels and by area, PC average distance, errors of the transform."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.errors import UsageError
from siloscope.types.camera import Camera
from siloscope.types.estimate import Ratios
from siloscope.types.pose import SiloPose

LABELS = {"none": 0, "cylinder": 1, "cone": 2, "feed": 3, "other": 4}
"""Numbers in label images; "other" is outlet, roof, clutter, flying pixel or dust."""


def pixel_ratios(labels: NDArray[np.uint8]) -> Ratios:
    """Shares of cylinder, cone and feed among the pixels with depth, by counting them (section 2.4.4).

    `labels` holds `LABELS`, in any shape.
    """
    return _ratios(np.bincount(labels.ravel(), minlength=len(LABELS)))


def area_ratios(
    labels: NDArray[np.uint8], depth: NDArray[np.float64], normals: NDArray[np.float64], camera: Camera
) -> Ratios:
    """The same shares by true surface area, which answers the first limitation of section 3.6.

    `labels` and `depth` are (H, W), `normals` (H, W, 3) unit normals in the camera frame.
    """
    areas = pixel_areas(depth, normals, camera)
    return _ratios(np.bincount(labels.ravel(), areas.ravel(), minlength=len(LABELS)))


def _ratios(sums: NDArray[Any]) -> Ratios:
    total = float(sums[1:].sum()) or 1.0
    return Ratios(*(float(sums[LABELS[name]]) / total for name in ("cylinder", "cone", "feed")))


def pixel_areas(depth: NDArray[np.float64], normals: NDArray[np.float64], camera: Camera) -> NDArray[np.float64]:
    """Surface area that each pixel sees, m², (H, W); 0 where nothing is hit.

    The ray is q = (x, y, 1) and its pixel in the plane z = 1 has the area J, 1/(fx fy) for an undistorted camera.
    Seen from the camera it fills the solid angle J/|q|³; the surface at distance d|q| under the angle of cosine
    |n·q|/|q| then has d² J / |n·q|.
    """
    x, y = camera.rays()[..., 0], camera.rays()[..., 1]
    facing = np.abs(normals[..., 0] * x + normals[..., 1] * y + normals[..., 2])
    seen = facing > 0
    areas: NDArray[np.float64] = np.divide(depth**2 * _cell_areas(camera), facing, out=np.zeros_like(depth), where=seen)
    return areas


def _cell_areas(camera: Camera) -> float | NDArray[np.float64]:
    """Area of each pixel in the plane z = 1."""
    if camera.distortion_model == "none" or min(camera.width, camera.height) < 2:
        return 1.0 / (camera.fx * camera.fy)
    rays = camera.rays()
    along_v, along_u = np.gradient(rays, axis=0), np.gradient(rays, axis=1)
    cells: NDArray[np.float64] = np.abs(along_u[..., 0] * along_v[..., 1] - along_u[..., 1] * along_v[..., 0])
    return cells


def pc_average_distance(
    estimate: SiloPose,
    reference: SiloPose,
    depth: NDArray[np.floating[Any]],
    camera: Camera,
    *,
    stride: int = 1,
    threads: int = 1,
) -> float:
    """PC average distance of Eq. 11 in metres.

    The frame's cloud, every pixel with depth, is adjusted once with the estimated pose and once with the reference
    pose; each point of the first has its distance to the nearest point of the second, and the mean is taken. With a
    `stride` only every such point of the first cloud is asked; the second stays whole.

    Raises
    ------
    UsageError
        Where the depth (H, W) is not of the camera's size or holds no measurement, or the stride is below 1.
    """
    return pc_average_distances([estimate], reference, depth, camera, stride=stride, threads=threads)[0]


def pc_average_distances(
    estimates: Sequence[SiloPose],
    reference: SiloPose,
    depth: NDArray[np.floating[Any]],
    camera: Camera,
    *,
    stride: int = 1,
    threads: int = 1,
) -> list[float]:
    """PC average distance of each of several estimates of one frame; the reference cloud is indexed only once."""
    if depth.shape != (camera.height, camera.width):
        raise UsageError(f"depth has the shape {depth.shape}, the camera is {camera.height} x {camera.width}")
    if stride < 1:
        raise UsageError(f"stride must be at least 1, got {stride}")
    valid = np.isfinite(depth) & (depth > 0)
    if not valid.any():
        raise UsageError("the frame has no pixel with depth to compare")
    if not estimates:
        return []
    points = camera_points(depth, camera)[valid]
    adjusted = [estimate.to_silo(points[::stride]) for estimate in estimates]
    return cloud_distances(adjusted, reference.to_silo(points), threads)


def cloud_distance(points: NDArray[np.float64], reference: NDArray[np.float64], threads: int = 1) -> float:
    """Mean distance in metres from each point (N, 3) to the nearest of a reference cloud (M, 3) (Eq. 11, Table 6).

    Raises
    ------
    UsageError
        Where a cloud is empty, has another shape, or holds NaN or infinite coordinates.
    """
    return cloud_distances([points], reference, threads)[0]


def cloud_distances(
    clouds: Sequence[NDArray[np.float64]], reference: NDArray[np.float64], threads: int = 1
) -> list[float]:
    """`cloud_distance` of each of several clouds; the reference is indexed only once."""
    if any(len(points) == 0 for points in clouds):
        raise UsageError("there is no point to compare")
    try:
        distances = _core.nearest_distances(np.concatenate(clouds), reference, threads)
    except (TypeError, ValueError) as error:
        raise UsageError(f"clouds can't be compared: {error}") from None
    ends = np.cumsum([len(points) for points in clouds])[:-1]
    return [float(part.mean()) for part in np.split(distances, ends)]


def camera_points(depth: NDArray[np.floating[Any]], camera: Camera) -> NDArray[np.float64]:
    """Points (H, W, 3) of a depth image in the camera frame, metres (Eqs. 1 and 2)."""
    z = np.asarray(depth, np.float64)[..., None]
    return np.concatenate([camera.rays() * z, z], axis=-1)


@dataclass(frozen=True)
class TransformError:
    """Estimated minus true pose; radians and metres."""

    r_x: float
    r_y: float
    t_x: float
    t_y: float

    def to_dict(self) -> dict[str, float]:
        """Plain data."""
        return asdict(self)


def transform_error(estimate: SiloPose, truth: SiloPose) -> TransformError:
    """Errors of the four parameters (Tables 3–5)."""
    return TransformError(
        estimate.r_x - truth.r_x, estimate.r_y - truth.r_y, estimate.t_x - truth.t_x, estimate.t_y - truth.t_y
    )
