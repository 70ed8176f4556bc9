"""Method ``shape-tensor``: the paper's six steps (section 2.3), from a frame to an estimate in one call of the core."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.estimation import steps
from siloscope.estimation.surface import cell_size, refused
from siloscope.types.camera import Camera
from siloscope.types.estimate import Estimate, Ratios
from siloscope.types.pose import SiloPose
from siloscope.types.vessel import SiloGeometry

METHOD = "shape-tensor"


@dataclass(frozen=True)
class Settings:
    """What the six steps leave to choose; see `siloscope.estimation.steps`."""

    grid: float | None = None
    """Side of the voxels, m; None for `steps.GRID`, or less for small clouds (`surface.cell_size`)."""
    neighbours: int = steps.NEIGHBOURS
    view: str = "auto"
    """One of `steps.VIEWS`, or "auto": the inside, and the others where that gives no axis."""
    share: float = steps.SHARE
    agreement: float = steps.AGREEMENT
    partners: int = steps.PARTNERS
    threads: int = 1

    def core(self, grid: float) -> tuple[float, int, str, float, float, int, int]:
        """As the core takes them."""
        return grid, self.neighbours, self.view, self.share, self.agreement, self.partners, self.threads


def fit_depth(
    depth: NDArray[np.float32], camera: Camera, settings: Settings, config: dict[str, Any] | None = None
) -> Estimate:
    """Run the six steps on a depth image.

    Parameters
    ----------
    depth : float32 (H, W), C-contiguous
        Measured depth z in metres; 0 or NaN where there is none.
    camera : Camera
        Intrinsics of the same size.
    settings : Settings
        Choices for the steps.
    config : dict, optional
        Effective settings to record in the estimate beside these.
    """
    rays = None if camera.distortion_model == "none" else camera.rays().reshape(-1, 2)
    grid = settings.grid or steps.GRID
    found = _core.shape_tensor_image(depth, camera, rays, 1.0, None, settings.core(grid))
    return _estimate(found, _recorded(config, settings, grid), pixels=True)


def fit_points(points: NDArray[np.float64], settings: Settings, config: dict[str, Any] | None = None) -> Estimate:
    """Run the six steps on a cloud (N, 3) in the camera frame, metres; rows that aren't finite are left out."""
    grid = settings.grid or cell_size(points)
    found = _core.shape_tensor_points(points, settings.core(grid))
    return _estimate(found, _recorded(config, settings, grid), pixels=False)


def _recorded(config: dict[str, Any] | None, settings: Settings, grid: float) -> dict[str, Any]:
    return {**(config or {}), **asdict(settings), "grid": grid}


def _estimate(found: dict[str, Any], config: dict[str, Any], *, pixels: bool) -> Estimate:
    if "refusal" in found:
        return refused(METHOD, found["refusal"], config)
    radius, bottom, apex = (found[name] or (None, None) for name in ("radius", "bottom", "apex"))
    return Estimate(
        "ok",
        METHOD,
        pose=SiloPose(*found["pose"]),
        covariance=found["covariance"],
        silo=SiloGeometry(radius[0], bottom[0], apex[0]),
        silo_std=SiloGeometry(radius[1], bottom[1], apex[1]),
        pixel_ratios=_ratios(found["pixels"]) if pixels else None,
        area_ratios=_ratios(found["areas"]) if pixels else None,
        config=config,
        timing_ms={name.replace(" ", "_"): ms for name, ms in found["timing"]},
        extra={"fit": {**found["evidence"], "misfit": found["misfit"]}},
    )


def _ratios(sums: list[float]) -> Ratios | None:
    """Shares of cylinder, cone and feed among everything seen."""
    seen = sum(sums[1:])
    return Ratios(*(sums[label] / seen for label in (1, 2, 3))) if seen > 0 else None
