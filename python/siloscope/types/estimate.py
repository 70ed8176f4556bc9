"""What one frame tells: the pose, how sure it is, and the silo seen."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.reasons import sentence
from siloscope.schema import ESTIMATE
from siloscope.types.by_value import ByValue, same
from siloscope.types.depth_frame import DepthFrame
from siloscope.types.frame_factor import FrameFactor
from siloscope.types.pose import SiloPose
from siloscope.types.remark import Remark
from siloscope.types.vessel import SiloGeometry, vessel_to_dict


@dataclass(frozen=True)
class Ratios:
    """Shares of cylinder, cone and feed among what was seen (section 2.4.4); they sum to at most 1."""

    cylinder: float
    cone: float
    feed: float

    def to_dict(self) -> dict[str, float]:
        """Plain data."""
        return {"cylinder": self.cylinder, "cone": self.cone, "feed": self.feed}


class PixelLabels:
    """Label of each pixel of a frame, worked out from the fit when first asked for. A pickle holds the labels alone."""

    def __init__(self, fit: _core.SurfaceFit, frame: DepthFrame) -> None:
        self._source: tuple[_core.SurfaceFit, DepthFrame] | NDArray[np.uint8] = (fit, frame)

    @property
    def image(self) -> NDArray[np.uint8]:
        """(H, W) 0 none, 1 cylinder, 2 cone, 3 feed, 4 other."""
        source = self._source
        if isinstance(source, tuple):
            fit, frame = source
            source = self._source = fit.labels(frame)
        return source

    def __getstate__(self) -> tuple[tuple[int, ...], bytes]:
        return self.image.shape, zlib.compress(self.image.tobytes(), 1)

    def __setstate__(self, state: tuple[tuple[int, ...], bytes]) -> None:
        shape, packed = state
        self._source = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(shape).copy()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, PixelLabels) and same(self.image, other.image)

    __hash__ = None  # type: ignore[assignment]


@dataclass(frozen=True, eq=False, repr=False)
class SurfaceDetails(ByValue):
    """What pictures show of a fit, and what other frames take from it.

    `points` (N, 3): patches in the silo frame, m; `residuals` (N,): their distance from the wall, m, NaN where a patch
    is not wall.
    """

    points: NDArray[np.float64]
    residuals: NDArray[np.float64]
    wall: _core.WarmStart | None = None
    """Where the frame's patches show the wall, for other frames of the camera to start from; None for clouds."""
    pixel_labels: PixelLabels | None = field(default=None, repr=False)
    """None for clouds."""
    evidence: FrameFactor | None = None
    """What the frame says about every parameter: what `calibrate` fuses."""

    @property
    def labels(self) -> NDArray[np.uint8] | None:
        """Label of each pixel (H, W): 0 none, 1 cylinder, 2 cone, 3 feed, 4 other. Computed on first access."""
        return None if self.pixel_labels is None else self.pixel_labels.image


FEWEST_CONE_PATCHES = 6
"""Patches that show how far a cone was seen."""


@dataclass(frozen=True, eq=False, repr=False)
class Estimate(ByValue):
    """Pose of the camera in its silo from one frame. Radians and metres.

    A refused estimate (`status` "refused") has no pose: its numbers are None, and `reason` (a stable slug) and
    `message` (a sentence with what to try) say why.
    """

    status: str
    method: str
    pose: SiloPose | None = None
    covariance: NDArray[np.float64] | None = None
    """(4, 4) covariance of (r_x, r_y, t_x, t_y)."""
    silo: SiloGeometry = field(default_factory=SiloGeometry)
    silo_std: SiloGeometry = field(default_factory=SiloGeometry)
    """Standard deviations of the geometry."""
    pixel_ratios: Ratios | None = None
    area_ratios: Ratios | None = None
    reason: str | None = None
    message: str | None = None
    quality: tuple[Remark, ...] = ()
    """What the inputs say against each other."""
    config: dict[str, Any] = field(default_factory=dict)
    """The effective settings."""
    timing_ms: dict[str, float] = field(default_factory=dict, compare=False)
    """Milliseconds by stage; no part of the answer, so it is not compared."""
    extra: dict[str, Any] = field(default_factory=dict)
    """Further keys of the JSON document, such as the gravity check."""
    details: SurfaceDetails | None = None
    """Patches, residuals and labels for pictures, and evidence for fusing frames (method ``surface``)."""

    @property
    def evidence(self) -> FrameFactor | None:
        """What the frame says about every parameter, for fusing frames; None without details."""
        return None if self.details is None else self.details.evidence

    @property
    def cone_reach(self) -> tuple[float, float] | None:
        """Distances from the axis between which patches show the bare cone, m; None without a cone or its patches."""
        if self.details is None or self.silo.apex is None:
            return None
        joint = -np.inf if self.silo.cylinder_bottom is None else self.silo.cylinder_bottom
        x, y, z = self.details.points.T
        across = np.hypot(x, y)[np.isfinite(self.details.residuals) & (z > joint)]
        if len(across) < FEWEST_CONE_PATCHES:
            return None
        near, far = np.quantile(across, (0.02, 0.98))
        return float(near), float(far)

    @property
    def ok(self) -> bool:
        """Whether there is an answer."""
        return self.status == "ok"

    @property
    def r_x(self) -> float | None:
        """Rotation about the x-axis."""
        return self.pose.r_x if self.pose else None

    @property
    def r_y(self) -> float | None:
        """Rotation about the y-axis."""
        return self.pose.r_y if self.pose else None

    @property
    def t_x(self) -> float | None:
        """Translation along the silo's x-axis."""
        return self.pose.t_x if self.pose else None

    @property
    def t_y(self) -> float | None:
        """Translation along the silo's y-axis."""
        return self.pose.t_y if self.pose else None

    @property
    def T_silo_camera(self) -> NDArray[np.float64] | None:
        """Homogeneous (4, 4) transform with ``p_silo = T_silo_camera @ p_camera`` (Eq. 5)."""
        return self.pose.T_silo_camera if self.pose else None

    def to_dict(self) -> dict[str, Any]:
        """The document of ``siloscope locate --json`` (schema ``siloscope.estimate/1``)."""
        names = ("r_x", "r_y", "t_x", "t_y")
        pose = self.pose
        std = None if self.covariance is None else np.sqrt(np.diag(self.covariance))
        return {
            "schema": ESTIMATE,
            "status": self.status,
            "reason": self.reason,
            "message": self.message,
            "quality": [remark.to_dict() for remark in self.quality],
            "method": self.method,
            **{name: getattr(self, name) for name in names},
            "std": {name: None if std is None else float(std[i]) for i, name in enumerate(names)},
            "covariance": None if self.covariance is None else self.covariance.tolist(),
            "T_silo_camera": None if pose is None else pose.T_silo_camera.tolist(),
            "axis": {
                "direction": None if pose is None else pose.axis_direction.tolist(),
                "point": None if pose is None else pose.axis_point.tolist(),
            },
            "silo": vessel_to_dict(self.silo, self.silo_std, self.extra.get("fit", {}).get("ovality"), self._bottom()),
            "ratios": {
                "pixels": self.pixel_ratios.to_dict() if self.pixel_ratios else None,
                "area": self.area_ratios.to_dict() if self.area_ratios else None,
            },
            **self.extra,
            "config": self.config,
            "timing_ms": self.timing_ms,
        }

    def _bottom(self) -> dict[str, Any]:
        """A cone that is the silo's own; else unknown, with the model of the conical surface seen, if any."""
        if self.silo.apex is not None:
            return {"kind": "cone"}
        models = self.extra.get("models")
        seen = models[0]["model"] if models and models[0]["model"] != "cylinder" else None
        return {"kind": "unknown", "seen": seen}


def refused(method: str, refusal: _core.Refusal, config: dict[str, Any] | None) -> Estimate:
    """An estimate without an answer; the message says what the reason means and what to try."""
    message = sentence((refusal.meaning, refusal.remedy))
    return Estimate("refused", method, reason=refusal.slug, message=message, config=config or {})


def timing_ms(stages: list[_core.StageTime]) -> dict[str, float]:
    """Milliseconds of a method's stages by their names."""
    return {stage.name.replace(" ", "_"): stage.ms for stage in stages}


def ratios_of(sums: list[float]) -> Ratios | None:
    """Shares of cylinder, cone and feed among everything seen; None where nothing is."""
    seen = sum(sums[1:])
    return Ratios(*(sums[label] / seen for label in (1, 2, 3))) if seen > 0 else None
