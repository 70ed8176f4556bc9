"""Cylinders that an image shows from outside: answered by the points of their surface's tiles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from siloscope import Camera, Estimate, SiloPose, locate, sensors

CAMERA = Camera(320, 240, 285.0, 285.0, 159.5, 119.5)
PROFILE = sensors.load("orbbec-astra-s")
SEEDS = range(16)


@dataclass(frozen=True)
class Tank:
    """A cylinder before a wall, and what the paper's sensor reads of it."""

    depth: NDArray[np.float32]
    pose: SiloPose
    radius: float

    @classmethod
    def draw(cls, seed: int) -> Tank:
        draws = np.random.default_rng(seed)
        radius = draws.uniform(0.4, 1.0)
        away = radius * draws.uniform(1.6, 2.6)
        axis = np.array([draws.normal(0.0, 0.15), 1.0, abs(draws.normal(0.3, 0.15))])
        axis /= np.linalg.norm(axis)
        point = np.array([draws.normal(0.0, 0.1 * radius), 0.0, away])
        rays = np.dstack([CAMERA.rays(), np.ones((CAMERA.height, CAMERA.width))])
        across, beside = rays - (rays @ axis)[..., None] * axis, point - (point @ axis) * axis
        a, b, c = (across**2).sum(axis=2), across @ beside, beside @ beside - radius**2
        true = np.where(b**2 > a * c, (b - np.sqrt(np.maximum(b**2 - a * c, 0.0))) / a, away + 3.0 * radius)
        offset, scale, quadratic = PROFILE.bias
        read = true + offset + scale * true + quadratic * true**2
        assert PROFILE.noise is not None
        floor, constant, linear, square, factor, power = PROFILE.noise
        sigma = np.maximum(floor, constant + linear * true + square * true**2 + factor * true**power)
        noisy = read + sigma * draws.standard_normal(true.shape)
        return cls(noisy.astype(np.float32), SiloPose.from_axis(axis, point), float(radius))

    def located(self, **known: Any) -> Estimate:
        return locate(self.depth, CAMERA, **{"intrinsics": "exact", "trust": "range", **known})

    def errors(self, found: Estimate) -> NDArray[np.float64]:
        names = ("r_x", "r_y", "t_x", "t_y")
        return np.array([getattr(found.pose, name) - getattr(self.pose, name) for name in names])


@pytest.mark.parametrize(
    ("known", "direction", "position"),
    [("profile", 1e-4, 2e-4), ("diameter", 3e-4, 5e-4), ("nothing", 3e-4, 0.1)],
)
def test_answers_are_true_and_their_deviations_too(known: str, direction: float, position: float) -> None:
    shares, off = [], []
    for tank in map(Tank.draw, SEEDS):
        told: dict[str, dict[str, Any]] = {"profile": {"sensor": PROFILE}, "diameter": {"diameter": 2.0 * tank.radius}}
        found = tank.located(**told.get(known, {}))
        assert found.covariance is not None, found.message
        assert found.extra["fit"]["seen_from"] == "outside"
        errors = tank.errors(found)
        shares.append(errors / np.sqrt(found.covariance.diagonal()))
        off.append([np.hypot(*errors[:2]), np.hypot(*errors[2:])])
    assert (np.median(off, axis=0) < [direction, position]).all()
    assert np.mean(np.abs(shares) < 2.0) > 0.85
    assert np.abs(shares).max() < 4.5


def test_deviations_contain_those_of_the_intrinsics() -> None:
    tank = Tank.draw(3)
    exact, usual = (tank.located(sensor=PROFILE, intrinsics=of).covariance for of in ("exact", "calibrated"))
    assert exact is not None
    assert usual is not None
    assert (usual.diagonal() > exact.diagonal()).all()
    assert usual[2, 2] > 4.0 * exact[2, 2]


def test_another_frame_is_no_start_and_changes_nothing() -> None:
    tank = Tank.draw(4)
    alone = tank.located(sensor=PROFILE)
    assert tank.located(sensor=PROFILE, start=alone).pose == alone.pose
