"""One simulated frame, every method on it, and how far each is off."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.reproduction.solvers import ALL, KNOWN
from siloscope.schema.frame_factor import Factor
from siloscope.sensors import SensorProfile
from siloscope.simulation import Scene, SimulatedFrame, metrics
from siloscope.types.estimate import Estimate, Ratios, SurfaceDetails
from siloscope.types.frame_factor import FrameFactor
from siloscope.types.pose import SiloPose
from siloscope.types.vessel import SiloGeometry

STRIDE = 37
"""Every so many points of the adjusted cloud are asked for their nearest reference point (Eq. 11); it shares no factor
with image widths, so that all columns are asked."""


@dataclass(frozen=True)
class Trial:
    """A scene, and the methods to run on its frame."""

    scene: Scene
    profile: SensorProfile
    """What `surface` is told where it knows the profile."""
    solvers: tuple[str, ...] = ALL
    stride: int = STRIDE
    alone = False

    def settings(self) -> dict[str, Any]:
        """Everything the result depends on."""
        return {
            "scene": self.scene.to_dict(),
            "profile": asdict(self.profile),
            "solvers": self.solvers,
            "stride": self.stride,
        }

    def run(self) -> dict[str, Any]:
        """Renders, solves and compares; see `Observation`."""
        frame = self.scene.render()
        timed = {name: _timed(name, frame, self.profile) for name in self.solvers}
        answers = {name: _answer(estimate, seconds) for name, (estimate, seconds) in timed.items()}
        for name, distance in self._distances(frame, {n: e for n, (e, _) in timed.items()}).items():
            answers[name]["distance"] = distance
        return {
            "pixels": frame.pixel_ratios.to_dict(),
            "area": frame.area_ratios.to_dict(),
            "seen": float(np.mean(frame.measured > 0)),
            "answers": answers,
        }

    def _distances(self, frame: SimulatedFrame, estimates: Mapping[str, Estimate]) -> dict[str, float]:
        poses = {name: estimate.pose for name, estimate in estimates.items() if estimate.pose is not None}
        distances = metrics.pc_average_distances(
            list(poses.values()), frame.pose, frame.measured, frame.camera, stride=self.stride
        )
        return dict(zip(poses, distances, strict=True))


def _timed(name: str, frame: SimulatedFrame, profile: SensorProfile) -> tuple[Estimate, float]:
    start = time.perf_counter()
    estimate = KNOWN[name](frame, profile)
    return estimate, time.perf_counter() - start


def _answer(estimate: Estimate, seconds: float) -> dict[str, Any]:
    """An estimate as plain data, with its evidence; the distance is added later."""
    pose, covariance = estimate.pose, estimate.covariance
    return {
        "reason": estimate.reason,
        "seconds": seconds,
        "pose": None if pose is None else list(asdict(pose).values()),
        "covariance": None if covariance is None else covariance.tolist(),
        "silo": estimate.silo.to_dict(),
        "evidence": None if estimate.evidence is None else estimate.evidence.to_dict(),
        "distance": None,
    }


@dataclass(frozen=True, eq=False)
class Answer:
    """What a method said about one frame."""

    method: str
    reason: str | None
    seconds: float
    pose: SiloPose | None
    covariance: NDArray[np.float64] | None
    """(4, 4) of r_x, r_y, t_x, t_y."""
    silo: SiloGeometry
    evidence: FrameFactor | None
    distance: float | None
    """PC average distance, m."""

    @classmethod
    def of(cls, method: str, data: Mapping[str, Any]) -> Answer:
        """From a trial's result."""
        evidence, covariance = data["evidence"], data["covariance"]
        return cls(
            method,
            data["reason"],
            data["seconds"],
            None if data["pose"] is None else SiloPose(*data["pose"]),
            None if covariance is None else np.array(covariance),
            SiloGeometry(**data["silo"]),
            None if evidence is None else FrameFactor.read(Factor.model_validate(evidence)),
            data["distance"],
        )

    def estimate(self) -> Estimate:
        """As the estimate it was, for fusing."""
        status = "refused" if self.pose is None else "ok"
        return Estimate(
            status,
            self.method,
            pose=self.pose,
            covariance=self.covariance,
            silo=self.silo,
            reason=self.reason,
            details=SurfaceDetails(np.empty((0, 3)), np.empty(0), evidence=self.evidence),
        )


@dataclass(frozen=True, eq=False)
class Observation:
    """A trial with its result."""

    scene: Scene
    pixels: Ratios
    """True shares by pixels."""
    area: Ratios
    """True shares by area."""
    seen: float
    """Share of the image with a measurement."""
    answers: dict[str, Answer]

    @classmethod
    def of(cls, trial: Trial, data: Mapping[str, Any]) -> Observation:
        """From a trial and what it gave."""
        answers = {name: Answer.of(KNOWN[name].method, answer) for name, answer in data["answers"].items()}
        return cls(trial.scene, Ratios(**data["pixels"]), Ratios(**data["area"]), data["seen"], answers)

    @property
    def level(self) -> float:
        """Highest feed point over the vertex as a share of the silo's height; 0 where empty."""
        return 0.0 if self.scene.feed is None else self.scene.feed.level
