"""The paper's six steps (section 2.3), one function each, for looking at every intermediate.

Arrays are float64, points and directions (N, 3) in the camera frame, metres. `locate(method="shape-tensor")` runs the
same steps in one go. Where the paper is silent the choices are measured: docs/design/choices-shape-tensor.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from siloscope import _core
from siloscope.errors import InputError, UsageError
from siloscope.types.camera import Camera
from siloscope.types.depth_frame import DepthFrame
from siloscope.types.pose import SiloPose

Vectors = NDArray[np.float64]
Numbers = NDArray[np.float64]
Indices = NDArray[np.uint32]
Result = TypeVar("Result")

GRID = _core.STEP_DEFAULTS.grid
"""Side of the voxels, m (step 1)."""

NEIGHBOURS = _core.STEP_DEFAULTS.neighbours
"""Neighbours k of normals and shape tensors (step 2)."""

SHARE = _core.STEP_DEFAULTS.share
"""Fraction of the clearly curved points that are kept as candidates (step 3)."""

AGREEMENT = _core.STEP_DEFAULTS.agreement
"""Robust standard deviations by which a candidate's E1 may be off the perpendicular to X (step 4)."""

PARTNERS = _core.STEP_DEFAULTS.partners
"""Partners s of each candidate (step 5)."""

VIEWS = ("inside", "outside", "either")
"""From which side walls are seen; "either" is for scans from several places."""


@dataclass(frozen=True, eq=False)
class ShapeTensors:
    """Principal curvatures k1 ≥ k2 (N,), 1/m, and unit principal directions E1, E2 (N, 3) (section 2.2.1).

    Positive curvature bends towards the normal. NaN where the neighbours don't determine the tensor.
    """

    k1: Numbers
    k2: Numbers
    E1: Vectors
    E2: Vectors


@dataclass(frozen=True, eq=False)
class Candidates:
    """Points that may lie on the walls, in order of rising |k2|: their `index` (C,) and direction `E1` (C, 3)."""

    index: Indices
    E1: Vectors


@dataclass(frozen=True, eq=False)
class Axis:
    """Direction X (3,) of the axis, z > 0, and the numbers (M,) of the candidates that agree with it."""

    X: Vectors
    agreeing: Indices


@dataclass(frozen=True, eq=False)
class Intermediates:
    """Everything between a cloud and its pose: one field for what each step gives."""

    points: Vectors
    """Step 1: means of the voxel grid (N, 3)."""
    normals: Vectors
    """Step 2: unit normals (N, 3)."""
    tensors: ShapeTensors
    """Step 2: curvatures and principal directions."""
    candidates: Candidates
    """Step 3."""
    axis: Axis
    """Step 4: direction, and the candidates behind it."""
    axis_points: Vectors
    """Step 5: estimated axis points (M, 3)."""
    axis_point: Vectors
    """Step 5: the axis point a (3,)."""
    pose: SiloPose
    """Step 6."""

    @property
    def walls(self) -> Indices:
        """Indices of the points that the axis rests on."""
        return self.candidates.index[self.axis.agreeing]


def back_project(
    depth: ArrayLike, camera: Camera, depth_unit: float | None = None, mask: ArrayLike | None = None
) -> Vectors:
    """Step 1: points (N, 3) of the pixels with a measurement, row by row (Eqs. 1 and 2), the lens undistorted.

    Parameters
    ----------
    depth : array (H, W)
        float32 or float64 metres, or uint16 in raw units of `depth_unit` metres. 0, NaN, infinite and negative depths,
        and raw 65535, are no measurement.
    camera : Camera
        Intrinsics of the same size.
    mask : array of bool (H, W), optional
        True for the pixels to use.

    Raises
    ------
    InputError
        For another type or shape, or raw units without `depth_unit`.
    """
    image = _depth(depth)
    if image.dtype == np.uint16 and depth_unit is None:
        raise InputError("depth is in raw units; give depth_unit, the metres per unit (0.001 for millimetres)")
    chosen = None if mask is None else np.require(np.asarray(mask) != 0, np.bool_, ["C", "A"])
    return _checked(_core.back_project, DepthFrame.of(image, camera, depth_unit or 1.0, chosen))


def voxel_grid(points: ArrayLike, size: float = GRID, threads: int = 1) -> Vectors:
    """Step 1: mean point (M, 3) of every occupied voxel, in order of the voxels, whatever the points' order.

    Points that aren't finite, or lie more than a million voxels from the origin, are left out.
    """
    return _checked(_core.voxel_grid, _vectors("points", points), size, threads)


def nearest_neighbours(points: ArrayLike, k: int = NEIGHBOURS, threads: int = 1) -> NDArray[np.uint32]:
    """Step 2: indices (N, k) of the nearest other points, nearest first, equally near ones by index.

    Fewer columns where the cloud has no k others.
    """
    return _checked(_core.nearest_neighbours, _finite("points", points), k, threads)


def normals(points: ArrayLike, neighbours: ArrayLike, threads: int = 1) -> Vectors:
    """Step 2: unit normals (N, 3) after Hoppe et al., turned towards the camera at the origin.

    The smallest eigenvector of M = 1/k Σ (p_i − p)(p_i − p)ᵀ over the `neighbours` (N, k).
    """
    return _checked(_core.hoppe_normals, _finite("points", points), _indices(neighbours), threads)


def shape_tensors(points: ArrayLike, neighbours: ArrayLike, normals: ArrayLike, threads: int = 1) -> ShapeTensors:
    """Step 2: shape tensors by the adjacent-normal cubic approximation of Goldfeather and Interrante.

    `neighbours` (N, k) and `normals` (N, 3) are those of `nearest_neighbours` and `normals`.
    """
    arrays = _finite("points", points), _indices(neighbours), _vectors("normals", normals)
    found = _checked(_core.shape_tensors, *arrays, threads)
    return ShapeTensors(found.k1, found.k2, found.E1, found.E2)


def select_candidates(
    points: ArrayLike, neighbours: ArrayLike, tensors: ShapeTensors, share: float = SHARE, view: str = "inside"
) -> Candidates:
    """Step 3: the `share` with the smallest |k2| of the points whose k1 is clearly not 0.

    Clear is a radius of curvature below the extent of the cloud. Points whose `neighbours` (N, k) lie to one side, at
    the edge of what is seen, are left out. Seen from outside, a wall bends away from the camera and its k2 is −1/R:
    there the two change places, and E1 is the direction of the greater in size.
    """
    if not 0.0 < share <= 1.0:
        raise UsageError(f"share must be above 0 and at most 1, got {share}")
    arrays = _vectors("points", points), _indices(neighbours)
    curvatures = (np.require(k, np.float64, ["C", "A"]) for k in (tensors.k1, tensors.k2))
    directions = (_vectors(name, E) for name, E in (("E1", tensors.E1), ("E2", tensors.E2)))
    checked = ShapeTensors(*curvatures, *directions)
    found = _checked(_core.select_candidates, *arrays, checked, share, _view(view))
    return Candidates(found.index, found.E1)


def axis_direction(E1: ArrayLike) -> Vectors:
    """Step 4: unit direction X (3,), z > 0: the leading principal component of all pairs' E1 × E1' (Eq. 3).

    No pair is formed; X is the eigenvector of the smallest eigenvalue of Σ E1 E1ᵀ.
    """
    return np.array(_checked(_core.axis_direction, _finite("E1", E1)))


def consistent_direction(E1: ArrayLike, agreement: float = AGREEMENT) -> Axis:
    """Step 4 against false candidates: `axis_direction` of those that agree with each other.

    On walls E1 is perpendicular to X (Property 3). X is drawn from the first fifth of the candidates, then from all,
    each time without those farther off than `agreement` robust standard deviations. Infinity keeps all.
    """
    if not agreement > 0.0:
        raise UsageError(f"agreement must be above 0, got {agreement}")
    found = _checked(_core.consistent_direction, _finite("E1", E1), agreement)
    return Axis(np.array(found.X), found.agreeing)


def estimated_vectors(E1: ArrayLike, count: int = 2000, seed: int = 0) -> Vectors:
    """The estimated vectors X̃ = E1 × E1' of `count` pairs drawn at random (Eq. 3), unit length, z ≥ 0 (Fig. 14).

    Pairs that are too near parallel to have a direction are left out.
    """
    directions = _finite("E1", E1)
    draw = np.random.default_rng(seed)
    first, second = draw.integers(0, max(len(directions), 1), (2, count if len(directions) else 0))
    products = np.cross(directions[first], directions[second])
    length = np.linalg.norm(products, axis=1, keepdims=True)
    clear = length[:, 0] > 1e-9
    unit: Vectors = products[clear] / length[clear]
    return unit * np.where(unit[:, 2:] < 0.0, -1.0, 1.0)


def axis_points(
    points: ArrayLike, normals: ArrayLike, X: ArrayLike, partners: int = PARTNERS, threads: int = 1
) -> Vectors:
    """Step 5: estimated axis points (M, 3), in the plane through the camera perpendicular to X (Eq. 4).

    `points` and `normals` (C, 3) are those of the candidates in order of rising |k2|: each gives the plane π(p, X, N),
    met by the normal lines of its `partners`.
    """
    direction = _direction(X)
    if not 1 <= partners <= 10_000:
        raise UsageError(f"partners must be between 1 and 10000, got {partners}")
    arrays = _finite("points", points), _finite("normals", normals)
    flat = _checked(_core.axis_points, *arrays, tuple(direction), partners, threads)
    plane = SiloPose.from_axis(direction, np.zeros(3)).T_silo_camera[:2, :3]
    found: Vectors = flat @ plane
    return found


def axis_point(axis_points: ArrayLike, X: ArrayLike) -> Vectors:
    """Step 5: the axis point a (3,) at the camera's height: medians of the estimated ones along the silo's x and y."""
    plane = SiloPose.from_axis(_direction(X), np.zeros(3)).T_silo_camera[:2, :3]
    estimates = _finite("axis_points", axis_points)
    if not len(estimates):
        raise InputError("there are no estimated axis points to take the median of")
    point: Vectors = np.median(estimates @ plane.T, axis=0) @ plane
    return point


def adjust(points: ArrayLike, pose: SiloPose) -> Vectors:
    """Step 6: points (N, 3) in the silo frame (Eq. 5)."""
    return pose.to_silo(_vectors("points", points))


def run(
    points: ArrayLike,
    *,
    grid: float = GRID,
    neighbours: int = NEIGHBOURS,
    view: str = "inside",
    share: float = SHARE,
    agreement: float = AGREEMENT,
    partners: int = PARTNERS,
    threads: int = 1,
) -> Intermediates:
    """All steps from points (N, 3), with everything in between; nothing is judged or refused.

    Raises
    ------
    InputError
        Where the cloud has too few points or candidates to go on.
    """
    cloud = voxel_grid(points, grid, threads)
    if len(cloud) <= neighbours:
        raise InputError(f"the voxel grid leaves {len(cloud)} points; {neighbours} neighbours need more: a finer grid")
    near = nearest_neighbours(cloud, neighbours, threads)
    N = normals(cloud, near, threads)
    tensors = shape_tensors(cloud, near, N, threads)
    candidates = select_candidates(cloud, near, tensors, share, view)
    axis = consistent_direction(candidates.E1, agreement)
    walls = candidates.index[axis.agreeing]
    estimates = axis_points(cloud[walls], N[walls], axis.X, partners, threads)
    a = axis_point(estimates, axis.X)
    return Intermediates(cloud, N, tensors, candidates, axis, estimates, a, SiloPose.from_axis(axis.X, a))


def _checked(step: Callable[..., Result], *arguments: Any) -> Result:
    """Runs a step of the core; its refusal of a setting becomes a `UsageError`."""
    try:
        return step(*arguments)
    except (ValueError, TypeError, OverflowError) as error:
        raise UsageError(str(error)) from None


def _depth(depth: ArrayLike) -> NDArray[Any]:
    array = np.asarray(depth)
    if array.dtype not in (np.float32, np.float64, np.uint16):
        raise InputError(f"depth of type {array.dtype} is no depth image; give float32, float64 or uint16")
    if array.ndim != 2:
        raise InputError(f"depth has the shape {array.shape}; give one image (H, W)")
    return np.require(array, array.dtype.newbyteorder("="), ["C", "A"])


def _vectors(name: str, vectors: ArrayLike) -> Vectors:
    try:
        array = np.require(vectors, np.float64, ["C", "A"])
    except (ValueError, TypeError) as error:
        raise InputError(f"{name} can't be read as numbers ({error}); give an array (N, 3)") from None
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"{name} has the shape {array.shape}; give (N, 3)")
    return array


def _finite(name: str, vectors: ArrayLike) -> Vectors:
    array = _vectors(name, vectors)
    if not np.isfinite(array).all():
        raise InputError(f"{name} holds values that are not finite; leave those rows out first")
    return array


def _indices(neighbours: ArrayLike) -> NDArray[np.uint32]:
    array = np.asarray(neighbours)
    if array.ndim != 2 or array.dtype.kind not in "iu" or (array.size and array.min() < 0):
        raise InputError(f"neighbours is {array.dtype} {array.shape}; give the indices (N, k) of nearest_neighbours")
    return np.require(array, np.uint32, ["C", "A"])


def _direction(X: ArrayLike) -> Vectors:
    direction = np.asarray(X, np.float64)
    if direction.shape != (3,) or not np.isfinite(direction).all() or not direction.any():
        raise InputError(f"X must be three finite numbers, not all zero, got {X!r}")
    return direction


def _view(view: str) -> str:
    if view not in VIEWS:
        raise UsageError(f"unknown view '{view}'; known are {', '.join(VIEWS)}")
    return view


def cell_size(points: NDArray[np.float64]) -> float:
    """Side of voxel cells for a cloud: the paper's 0.05 m, or a 60th of the cloud where it is small, in metres."""
    finite = points[np.isfinite(points).all(axis=1)]
    if len(finite) == 0:
        return GRID
    extent = float(np.max(np.percentile(finite, 95, axis=0) - np.percentile(finite, 5, axis=0)))
    return min(GRID, extent / 60.0) if extent > 0.0 else GRID
