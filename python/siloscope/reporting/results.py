"""An estimate as files: the document, the adjusted cloud, the pictures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import SiloscopeError
from siloscope.estimation.region import depth_metres, frame_points
from siloscope.io import writers
from siloscope.reporting.renewal import without_older
from siloscope.schema import documents
from siloscope.types.camera import Camera
from siloscope.types.estimate import Estimate
from siloscope.types.frame import Frame
from siloscope.types.pose import SiloPose

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Mask = NDArray[np.bool_]


PICTURES = ("depth", "overview", "clouds", "candidates", "directions", "profile")
"""Pictures of an estimate, as far as its frame allows them."""

RESULTS = ("estimate.json", "adjusted.ply", "corrected.ply", *(f"{name}.png" for name in PICTURES))
"""Files that an estimate may have."""


def write_results(directory: Path, frame: Frame, estimate: Estimate, mask: Mask | None = None) -> list[Path]:
    """Writes ``estimate.json``, ``adjusted.ply`` and the pictures that the estimate allows; returns their paths.

    Files of these names that an earlier estimate left are deleted.

    Raises `OSError` where the directory can't be written.
    """
    from siloscope.reporting.plots import save

    frame = _with_camera(frame, estimate)
    directory.mkdir(parents=True, exist_ok=True)
    document = documents.write(directory / "estimate.json", estimate.to_dict())
    written = [document, *_adjusted(directory, frame, estimate)]
    written += [save(made, directory / f"{name}.png") for name, made in pictures(frame, estimate, mask).items()]
    return without_older(directory, written, RESULTS)


def _adjusted(directory: Path, frame: Frame, estimate: Estimate) -> list[Path]:
    """The cloud in the silo frame as ``T_silo_camera`` gives it, and once more without the sensor's bias."""
    if estimate.pose is None:
        return []
    points = seen_points(frame)
    clouds = {"adjusted": points} | ({"corrected": without_bias(points, estimate)} if _bias(estimate) else {})
    written = []
    for name, cloud in clouds.items():
        written.append(directory / f"{name}.ply")
        placed = estimate.pose.to_silo(cloud).astype(np.float32)
        writers.write_ply(written[-1], placed, comments=["silo frame, metres, z down"])
    return written


def _with_camera(frame: Frame, estimate: Estimate) -> Frame:
    """The frame with the camera that the estimate used, which may be the sensor profile's."""
    used = estimate.config.get("camera")
    return frame if frame.camera is not None or not used else replace(frame, camera=Camera(**used))


def seen_points(frame: Frame, mask: Mask | None = None) -> NDArray[np.float64]:
    """The measured points (N, 3) of a frame in the camera frame, those of the mask where there is one."""
    points = frame_points(frame)
    chosen = np.isfinite(points).all(axis=-1)
    return points[chosen if mask is None else chosen & mask]


def without_bias(points: NDArray[np.float64], estimate: Estimate) -> NDArray[np.float64]:
    """Points (N, 3) of the camera frame moved along their rays to the depth that the sensor should have measured.

    Solves ``measured = d + offset + scale·d + quadratic·d²`` (Eq. 10) for d with the bias the estimate rests on.
    """
    bias = _bias(estimate)
    if not bias:
        return points
    gain, rest = 1.0 + bias["scale"], points[:, 2:] - bias["offset"]
    root = np.sqrt(np.maximum(gain**2 + 4.0 * bias["quadratic"] * rest, 0.0))
    depth = 2.0 * rest / (gain + root)
    moved: NDArray[np.float64] = points * (depth / points[:, 2:])
    return moved


def _bias(estimate: Estimate) -> dict[str, float]:
    """Depth bias that the estimate rests on; empty where there is none."""
    bias: dict[str, float] = estimate.extra.get("sensor", {}).get("bias", {})
    return bias if any(bias.values()) else {}


def pictures(frame: Frame, estimate: Estimate, mask: Mask | None = None) -> dict[str, Figure]:
    """The pictures that a frame and its estimate allow, by the name that files of them get."""
    from siloscope.reporting import plots

    frame = _with_camera(frame, estimate)
    made: dict[str, Figure] = {}
    depth = None if frame.depth is None else depth_metres(frame)
    if depth is not None:
        made["depth"] = plots.depth_map(depth, frame.source)
    points = seen_points(frame, mask)
    if estimate.pose is None or not len(points):
        return made
    corrected = without_bias(points, estimate)
    if depth is not None:
        made["overview"] = plots.overview(depth, points, corrected, estimate.pose, estimate.silo)
    made["clouds"] = plots.clouds(points, corrected, estimate.pose, estimate.silo)
    made |= _steps(corrected, estimate, estimate.pose)
    made["profile"] = _profile(corrected, estimate, estimate.pose)
    return made


PAIRS = 20_000
"""Pairs of candidates whose estimated vectors are drawn."""


def _steps(points: NDArray[np.float64], estimate: Estimate, pose: SiloPose) -> dict[str, Figure]:
    """Steps 3 and 4 of the paper on the frame's cloud; nothing where it is too small for them."""
    from siloscope.estimation import steps
    from siloscope.estimation.steps import cell_size
    from siloscope.reporting import plots

    grid = estimate.config.get("grid") or cell_size(points)
    try:
        between = steps.run(points, grid=grid, neighbours=estimate.config.get("neighbours", steps.NEIGHBOURS))
    except SiloscopeError:
        return {}
    chosen = np.zeros(len(between.points), np.bool_)
    chosen[between.candidates.index] = True
    vectors = steps.estimated_vectors(between.candidates.E1, PAIRS)
    return {
        "candidates": plots.candidates(between.points, chosen, pose, estimate.silo),
        "directions": plots.directions(vectors, pose.axis_direction),
    }


def _profile(points: NDArray[np.float64], estimate: Estimate, pose: SiloPose) -> Figure:
    """The fit's own patches and residuals where it has them, else the points within three deviations of the wall."""
    from siloscope.reporting import plots
    from siloscope.reporting.plots.profile import wall_distance

    details = estimate.details
    if details is not None:
        wall = np.isfinite(details.residuals)
        return plots.profile(details.points, wall, estimate.silo, details.residuals, "patches")
    placed = pose.to_silo(points)
    off = np.abs(wall_distance(np.hypot(placed[:, 0], placed[:, 1]), placed[:, 2], estimate.silo))
    spread = 1.4826 * np.nanmedian(off) if np.isfinite(off).any() else 0.0
    return plots.profile(placed, off <= 3.0 * spread, estimate.silo)
