"""Method ``shape-tensor``: the paper's six steps (section 2.3), from a frame to an estimate in one call of the core."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.estimation import steps
from siloscope.estimation.priors import Priors
from siloscope.estimation.steps import cell_size
from siloscope.types.camera import Camera
from siloscope.types.depth_frame import DepthFrame
from siloscope.types.estimate import Estimate, ratios_of, refused, timing_ms
from siloscope.types.pose import SiloPose
from siloscope.types.vessel import SiloGeometry

METHOD = "shape-tensor"


@dataclass(frozen=True)
class Settings:
    """What the six steps leave to choose; see `siloscope.estimation.steps`."""

    grid: float | None = None
    """Side of the voxels, m; None for `steps.GRID`, or less for small clouds (`steps.cell_size`)."""
    neighbours: int = steps.NEIGHBOURS
    view: str = "auto"
    """One of `steps.VIEWS`, or "auto": the inside, and the others where that gives no axis."""
    share: float = steps.SHARE
    agreement: float = steps.AGREEMENT
    partners: int = steps.PARTNERS
    threads: int = 1


def fit_depth(
    depth: NDArray[np.float32],
    camera: Camera,
    settings: Settings,
    config: dict[str, Any] | None = None,
    priors: Priors | None = None,
) -> Estimate:
    """Run the six steps on a depth image.

    Parameters
    ----------
    depth : float32 (H, W)
        Measured depth z in metres; 0 or NaN where there is none.
    camera : Camera
        Intrinsics of the same size.
    settings : Settings
        Choices for the steps.
    config : dict, optional
        Effective settings to record in the estimate beside these.
    priors : Priors, optional
        What is known of the sensor and of the intrinsics. The steps leave these errors in the answer; its covariance
        has them. None for that of the scatter alone.
    """
    settings = replace(settings, grid=settings.grid or steps.GRID)
    found = _core.shape_tensor_depth(DepthFrame.of(depth, camera), settings, priors)
    return _estimate(found, {**(config or {}), **asdict(settings)}, pixels=True)


def fit_points(points: NDArray[np.float64], settings: Settings, config: dict[str, Any] | None = None) -> Estimate:
    """Run the six steps on a cloud (N, 3) in the camera frame, metres; rows that aren't finite are left out."""
    settings = replace(settings, grid=settings.grid or cell_size(points))
    found = _core.shape_tensor_points(points, settings)
    return _estimate(found, {**(config or {}), **asdict(settings)}, pixels=False)


def _estimate(found: _core.ShapeTensorFit | _core.Refusal, config: dict[str, Any], *, pixels: bool) -> Estimate:
    if isinstance(found, _core.Refusal):
        return refused(METHOD, found, config)
    lengths = (found.radius, found.bottom, found.apex)
    return Estimate(
        "ok",
        METHOD,
        pose=SiloPose(*found.pose),
        covariance=found.covariance,
        silo=SiloGeometry(*(None if length is None else length.value for length in lengths)),
        silo_std=SiloGeometry(*(None if length is None else length.std for length in lengths)),
        pixel_ratios=ratios_of(found.pixels) if pixels else None,
        area_ratios=ratios_of(found.areas) if pixels else None,
        config=config,
        timing_ms=timing_ms(found.stages),
        extra={"fit": _quality(found)},
    )


def _quality(found: _core.ShapeTensorFit) -> dict[str, Any]:
    names = ("points", "candidates", "walls", "around", "along", "miss", "turn", "bend", "behind")
    seen = found.diagnostics
    return {**{name: getattr(seen, name) for name in names}, "misfit": found.model_error_std}
