"""The methods: ours, and what a user would reach for instead, each tuned as well as we could (see README.md)."""

from __future__ import annotations

import json
import math
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from frames import Shown
from install import import_path, program
from known import Target, target_of
from numpy.typing import NDArray

from siloscope import locate
from siloscope.types.pose import SiloPose

PRIOR = 0.6
"""Largest angle between the axis and the optical axis that a user would promise, rad."""

GRID = 0.05
"""Voxels for everyone, m: step 1 of the paper."""


@dataclass(frozen=True)
class Found:
    """One run's answer."""

    pose: SiloPose | None
    ms: float


@dataclass(frozen=True)
class Method:
    """A way to find the axis."""

    name: str
    told: str
    """What it knows besides the frame."""
    answers: Callable[[Shown, int], list[Found]]
    """Answers of so many runs, each with another seed where there is chance in it."""
    available: Callable[[], bool] = lambda: True
    slow: bool = False
    """Whether only some of the frames are tried."""
    once: bool = False
    """Whether one run a frame is enough: there is little chance in it, and it takes long."""


def ours(**told: Any) -> Callable[[Shown, int], list[Found]]:
    """`locate`; its answer is always the same, so repeats only make the time surer."""

    def answers(frame: Shown, repeats: int) -> list[Found]:
        settings = {name: value(frame) if callable(value) else value for name, value in told.items()}
        return [_timed(lambda: locate(frame.depth, frame.camera, **settings).pose) for _ in range(repeats)]

    return answers


def _timed(work: Callable[[], SiloPose | None]) -> Found:
    start = time.process_time()
    pose = work()
    return Found(pose, 1e3 * (time.process_time() - start))


EXACT = (0.05, 0.3)
QUICK = (0.08, 0.05)
"""Distance in m and weight of the normals for PCL, the nearest and the quickest that `tune.py` finds."""

CGAL = (0.01, 0.8)
"""Distance in m and least cosine of normals; the nearest that `tune.py` finds."""


def compiled(name: str, prior: float, settings: tuple[float, float]) -> Callable[[Shown, int], list[Found]]:
    """A C++ program, which times itself from the depths in memory to the axis."""
    numbers = [str(value) for value in (prior, *settings)]

    def answers(frame: Shown, repeats: int) -> list[Found]:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "frame.bin"
            frame.write(path)
            command = [str(program(name)), str(path), str(repeats), *numbers]
            done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=600)
        return [_axis(json.loads(line)) for line in done.stdout.splitlines()]

    return answers


def _axis(answer: dict[str, Any]) -> Found:
    pose = SiloPose.from_axis(answer["axis"], answer["point"]) if answer["found"] else None
    return Found(pose, sum(answer["ms"]))


def _voxels(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean point of each cell, by NumPy."""
    _, inverse, counts = np.unique(np.floor(points / GRID), axis=0, return_inverse=True, return_counts=True)
    sums = np.zeros((len(counts), 3))
    np.add.at(sums, inverse.ravel(), points)
    return sums / counts[:, None]


def pyransac(frame: Shown, repeats: int) -> list[Found]:
    """pyransac3d's cylinder: 2000 samples, 3 cm."""
    import random

    import pyransac3d

    def run(seed: int) -> SiloPose | None:
        random.seed(seed)
        centre, axis, _, inliers = pyransac3d.Cylinder().fit(_voxels(frame.points()), thresh=0.03, maxIteration=2000)
        return SiloPose.from_axis(axis, centre) if len(inliers) else None

    return [_timed(partial(run, seed)) for seed in range(repeats)]


def open3d_icp(start: str) -> Callable[[Shown, int], list[Found]]:
    """Open3D: voxels, then point-to-plane ICP to the known silo with a shrinking reach."""

    def answers(frame: Shown, repeats: int) -> list[Found]:
        target = _open3d_target(target_of(frame.silo))
        return [_timed(partial(_open3d, frame, target, _start(frame, start, seed))) for seed in range(repeats)]

    return answers


REACHES = (1.0, 0.4, 0.15, 0.08)
"""How far ICP looks for partners in its four rounds, m."""


def _open3d_target(target: Target) -> Any:
    import open3d

    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(target.points))
    cloud.normals = open3d.utility.Vector3dVector(target.normals)
    return cloud


def _open3d(frame: Shown, target: Any, start: NDArray[np.float64]) -> SiloPose | None:
    import open3d

    registration = open3d.pipelines.registration
    source = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(frame.points())).voxel_down_sample(GRID)
    transform, often = start, registration.ICPConvergenceCriteria(max_iteration=40)
    for round_, reach in enumerate(REACHES):
        kernel = registration.TukeyLoss(reach / 2.0) if round_ else registration.L2Loss()
        plane = registration.TransformationEstimationPointToPlane(kernel)
        found = registration.registration_icp(source, target, reach, transform, plane, often)
        transform = found.transformation
    return _pose(np.asarray(transform)) if len(found.correspondence_set) else None


def small_gicp(start: str) -> Callable[[Shown, int], list[Found]]:
    """small_gicp: voxels and covariances, then GICP to the known silo with the same reaches, one thread."""

    def answers(frame: Shown, repeats: int) -> list[Found]:
        target = _gicp_target(frame.silo)
        return [_timed(partial(_gicp, frame, target, _start(frame, start, seed))) for seed in range(repeats)]

    return answers


@cache
def _gicp_target(silo: Any) -> Any:
    import small_gicp as library

    return library.preprocess_points(target_of(silo).points, downsampling_resolution=0.01, num_neighbors=10)


def _gicp(frame: Shown, target: Any, start: NDArray[np.float64]) -> SiloPose | None:
    import small_gicp as library

    source, _ = library.preprocess_points(frame.points(), downsampling_resolution=GRID, num_neighbors=20)
    transform = start
    for reach in REACHES:
        found = library.align(
            target[0],
            source,
            target[1],
            init_T_target_source=transform,
            registration_type="GICP",
            max_correspondence_distance=reach,
            num_threads=1,
            max_iterations=40,
        )
        transform = found.T_target_source
    return _pose(transform) if found.num_inliers else None


def _start(frame: Shown, kind: str, seed: int) -> NDArray[np.float64]:
    """Where registration starts: the identity, or 0.1 rad and 0.3 m off the truth in a random direction."""
    if kind == "identity":
        return np.eye(4)
    draw = np.random.default_rng(seed)
    turn, shift = draw.uniform(-math.pi, math.pi, 2)
    pose = frame.pose
    return SiloPose(
        pose.r_x + 0.1 * math.cos(turn),
        pose.r_y + 0.1 * math.sin(turn),
        pose.t_x + 0.3 * math.cos(shift),
        pose.t_y + 0.3 * math.sin(shift),
    ).T_silo_camera


def _pose(T_silo_camera: NDArray[np.float64]) -> SiloPose | None:
    """Axis of a rigid transform; a turn about the axis and a shift along it don't matter."""
    if not np.isfinite(T_silo_camera).all():
        return None
    rotation, shift = T_silo_camera[:3, :3], T_silo_camera[:3, 3]
    return SiloPose.from_axis(rotation.T @ [0.0, 0.0, 1.0], -rotation.T @ shift)


def _package(name: str) -> Callable[[], bool]:
    def available() -> bool:
        import_path()
        return find_spec(name) is not None

    return available


def _program(name: str) -> Callable[[], bool]:
    return lambda: program(name) is not None


KNOWN = "radius, heights"
METHODS = (
    Method("siloscope shape-tensor", "nothing", ours(method="shape-tensor")),
    Method("siloscope surface", "nothing", ours(method="surface")),
    Method("siloscope surface", "diameter", ours(method="surface", diameter=lambda frame: 2.0 * frame.silo.radius)),
    Method("siloscope surface", "profile", ours(method="surface", sensor=lambda frame: frame.profile)),
    Method("PCL cylinder and cone", "axis within 0.6 rad", compiled("pcl", PRIOR, EXACT), _program("pcl")),
    Method("PCL cylinder and cone, quick", "axis within 0.6 rad", compiled("pcl", PRIOR, QUICK), _program("pcl")),
    Method("PCL cylinder and cone", "nothing", compiled("pcl", 0.0, EXACT), _program("pcl")),
    Method("CGAL Efficient RANSAC", "axis within 0.6 rad", compiled("cgal", PRIOR, CGAL), _program("cgal")),
    Method("CGAL Efficient RANSAC", "nothing", compiled("cgal", 0.0, CGAL), _program("cgal")),
    Method("pyransac3d Cylinder", "nothing", pyransac, _package("pyransac3d"), slow=True, once=True),
    Method("Open3D ICP", KNOWN, open3d_icp("identity"), _package("open3d"), once=True),
    Method("Open3D ICP", f"{KNOWN}, near start", open3d_icp("near"), _package("open3d"), once=True),
    Method("small_gicp GICP", KNOWN, small_gicp("identity"), _package("small_gicp"), once=True),
    Method("small_gicp GICP", f"{KNOWN}, near start", small_gicp("near"), _package("small_gicp"), once=True),
)
"""In the table's order."""
