"""Section 2.4.5: a sensor in the empty silo, judged by the ideal silo's cloud and by the accelerometer."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.estimation.priors import GRAVITY_STD
from siloscope.reproduction.solvers import ALL, SOLVERS
from siloscope.reproduction.trials import STRIDE
from siloscope.simulation import Silo, SimulatedFrame, metrics
from siloscope.simulation.stand_ins import Mounted
from siloscope.types.pose import SiloPose

SPACING = 0.005
"""Distance between neighbours of the ideal silo's cloud, m."""

ACCELEROMETER_STD = 0.01
"""Error of an accelerometer at rest in each direction, rad: Table 7 has 5 to 12 mrad between it and the method."""

TRUTH = "true pose"
"""The column that uses the true pose: what is left is the sensor's own error."""

WITH_GRAVITY = "surface-gravity"
"""The column that is told the accelerometer's reading."""


@dataclass(frozen=True)
class SensorTrial:
    """One device of a kind in the silo."""

    mounted: Mounted
    device: int
    alone = False

    def settings(self) -> dict[str, Any]:
        """Everything the result depends on."""
        scene, profile = self.mounted.scene(self.device).to_dict(), asdict(self.mounted.profile)
        laws = (STRIDE, SPACING, ACCELEROMETER_STD, GRAVITY_STD)
        return {"scene": scene, "profile": profile, "laws": laws, "device": self.device}

    def run(self) -> dict[str, Any]:
        """Poses, the accelerometer's angles, and each pose's distance from the ideal silo (None where refused)."""
        frame = self.mounted.scene(self.device).render()
        gravity = accelerometer(frame.pose, self.device)
        poses = {TRUTH: frame.pose, **self._poses(frame, gravity)}
        found = {name: pose for name, pose in poses.items() if pose is not None}
        reading = SiloPose.from_axis(gravity, np.zeros(3))
        return {
            "poses": {name: None if pose is None else list(asdict(pose).values()) for name, pose in poses.items()},
            "distances": dict(zip(found, ideal_distances(list(found.values()), frame), strict=True)),
            "pose_distances": dict(zip(found, _pose_distances(list(found.values()), frame), strict=True)),
            "accelerometer": [reading.r_x, reading.r_y],
        }

    def _poses(self, frame: SimulatedFrame, gravity: NDArray[np.float64]) -> dict[str, SiloPose | None]:
        poses = {name: SOLVERS[name](frame, self.mounted.profile).pose for name in ALL}
        told = SOLVERS["surface"](frame, self.mounted.profile, gravity=gravity)
        return {**poses, WITH_GRAVITY: told.pose}


def accelerometer(pose: SiloPose, device: int) -> NDArray[np.float64]:
    """Direction of gravity in the camera frame as a device reads it: the axis, turned by its error, (3,)."""
    down = pose.axis_direction
    first = np.cross(down, [1.0, 0.0, 0.0])
    first /= np.linalg.norm(first)
    error = np.random.default_rng((device, 9)).normal(0.0, ACCELEROMETER_STD, 2)
    reading: NDArray[np.float64] = down + error[0] * first + error[1] * np.cross(down, first)
    return reading / np.linalg.norm(reading)


def ideal_cloud(silo: Silo, spacing: float = SPACING) -> NDArray[np.float64]:
    """Points of the ideal silo's wall in the silo frame, (N, 3), `spacing` metres apart."""
    slant = float(np.hypot(silo.radius, silo.cone_height))
    down = np.arange(0.0, silo.cylinder_height, spacing)
    along = np.arange(0.0, slant, spacing) / slant
    bottom = silo.top + silo.cylinder_height
    radii = np.concatenate([np.full(len(down), silo.radius), silo.radius * (1.0 - along)])
    heights = np.concatenate([silo.top + down, bottom + silo.cone_height * along])
    return np.concatenate([_ring(r, z, spacing) for r, z in zip(radii, heights, strict=True)])


def _ring(radius: float, z: float, spacing: float) -> NDArray[np.float64]:
    count = max(int(np.ceil(2.0 * np.pi * radius / spacing)), 1)
    turn = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.full(count, z)])


def ideal_distances(poses: list[SiloPose], frame: SimulatedFrame) -> list[float]:
    """Mean distance of the adjusted measured cloud to the ideal silo's cloud for each pose, m (Table 6)."""
    points = metrics.camera_points(frame.measured, frame.camera)[frame.measured > 0][::STRIDE]
    adjusted = np.concatenate([pose.to_silo(points) for pose in poses])
    distances = _core.nearest_distances(adjusted, ideal_cloud(frame.scene.silo), 1)
    return [float(part.mean()) for part in np.split(distances, len(poses))]


def _pose_distances(poses: list[SiloPose], frame: SimulatedFrame) -> list[float]:
    """Eq. 11 with the true pose as reference."""
    return metrics.pc_average_distances(poses, frame.pose, frame.measured, frame.camera, stride=STRIDE)
