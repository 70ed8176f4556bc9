"""Are the deviations that `siloscope plan` foresees those of answers? At random places, against the scatter of answers.

python -m benchmarks.plan --write

A hopper of random lengths, a random place under its roof, a random direction and level for each row. What is foreseen
there is held against the root mean square error of answers for frames with noise, before cameras that are off what is
told of them as the foreseen intrinsics say.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from benchmarks import trials
from numpy.typing import NDArray

import siloscope
from siloscope import Camera, SiloPose, sensors
from siloscope.planning.expectation import View, axis_std, expected, within_range
from siloscope.planning.places import Placement, looking
from siloscope.planning.view import Interior, exact_depth
from siloscope.simulation import ASTRA_S, true_camera
from siloscope.vessel.bottoms import Oblique
from siloscope.vessel.datasheet import Datasheet
from siloscope.vessel.vessel import Vessel

CAMERA = Camera(width=160, height=120, fx=142.6, fy=142.6, cx=79.5, cy=59.5)
SENSOR = sensors.load("orbbec-astra-s")
WITHIN = 0.3
"""Fraction by which what is foreseen may differ from the scatter."""
OBLIQUITY, OVAL, BEND, RINGS = 0.005, 0.002, 2e-4, 1e-4
"""Tolerances of every vessel (docs/design/fit-model.md): of its outlet's place, per length of the hopper; of its
ovality, as a fraction of the radius; of bend and rings, m."""
FEWEST = 10
"""Answers from which on a scatter is told."""

PAGE = trials.ROOT / "docs" / "planning.md"

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Site:
    """A view of a vessel, a camera's place in it, and a level."""

    view: View
    placement: Placement
    level: float
    seed: int
    known: str
    """How exactly the intrinsics are known."""

    def foreseen(self) -> Vector | None:
        """Deviations of tilt (rad), place and axis (m); None where the frame would be refused."""
        told = expected(self.view, self.placement, self.level)
        if told.std is None or told.estimate is None or told.estimate.covariance is None:
            return None
        return spread(told.estimate.covariance, self.view.inside.lowest)

    def errors(self, draws: int) -> Iterator[Vector]:
        """Errors (4,) of r_x, r_y, t_x, t_y of each answer for a frame with noise before a camera of its own."""
        pose = self.placement.pose
        for draw in range(draws):
            seed = 1000 * self.seed + draw
            exact = built(self.view.inside, true_camera(CAMERA, self.known, seed), pose, self.level, seed)
            noise = np.random.default_rng((seed, 5)).standard_normal(exact.shape)
            read = within_range(self.view, exact)
            read = np.where(read > 0.0, read + noise * ASTRA_S.sigma_at(exact), 0.0)
            answer = siloscope.locate(read, CAMERA, sensor=SENSOR, intrinsics=self.known)
            if answer.pose is not None:
                yield np.array([getattr(answer.pose, k) - getattr(pose, k) for k in ("r_x", "r_y", "t_x", "t_y")])


def built(inside: Interior, camera: Camera, pose: SiloPose, level: float, seed: int) -> Vector:
    """Depths (H, W), m, of a vessel as it may be built: with the tolerances that the fit grants every vessel."""
    draw = np.random.default_rng((seed, 9))
    height = inside.lowest - inside.edge
    out = draw.normal(0.0, OBLIQUITY * math.hypot(inside.radius, height), 2)
    hopper = Oblique(height, outlet_x=float(out[0]), outlet_y=float(out[1]))
    inside = replace(inside, floor_depth=lambda x, y: hopper.depth(x, y, inside.radius), round=False)
    depth = exact_depth(inside, camera, pose, level)
    rays = np.dstack([camera.rays(), np.ones(depth.shape)])
    turned = rays @ pose.T_silo_camera[:3, :3].T
    x, y, z = np.moveaxis(pose.to_silo(rays * depth[..., None]), -1, 0)
    across = np.hypot(x, y)
    on_wall = (depth > 0.0) & (np.abs(across - inside.radius) < 1e-6)
    up, turn = 2.0 * (z - inside.top) / (inside.edge - inside.top) - 1.0, np.arctan2(y, x)
    legendre = (np.ones_like(up), up, 1.5 * up**2 - 0.5)
    a, b = draw.normal(0.0, OVAL * inside.radius, (2, 3)) * (1.0, 0.25, 0.11)
    form = sum(p * (a[k] * np.cos(2.0 * turn) + b[k] * np.sin(2.0 * turn)) for k, p in enumerate(legendre))
    c, d = draw.normal(0.0, BEND, 2)
    form = form + legendre[2] * (c * np.cos(turn) + d * np.sin(turn) + draw.normal(0.0, RINGS))
    outwards = (turned[..., 0] * x + turned[..., 1] * y) / across
    return np.where(on_wall & (outwards > 0.05), depth + form / np.maximum(outwards, 0.05), depth)


def spread(covariance: Vector, lowest: float) -> Vector:
    """Deviations of tilt, place and the axis at the vessel's lowest point: each the root of a mean variance."""
    variance = np.diag(covariance)
    return np.array([math.sqrt(variance[:2].mean()), math.sqrt(variance[2:].mean()), axis_std(covariance, lowest)])


def site(seed: int, known: str) -> Site:
    """A random one."""
    draw = np.random.default_rng((seed, 77))
    radius, cylinder, cone = draw.uniform(0.9, 1.8), draw.uniform(2.0, 4.0), draw.uniform(1.0, 2.2)
    sheet = Datasheet(diameter=2.0 * float(radius), cylinder=float(cylinder), cone=float(cone), bottom="cone")
    view = View.of(Vessel(sheet), 0.2, SENSOR, CAMERA, known)
    away, azimuth, aim = 0.85 * radius * math.sqrt(draw.uniform()), draw.uniform(-math.pi, math.pi), draw.uniform()
    x, y = float(away * math.cos(azimuth)), float(away * math.sin(azimuth))
    off = draw.uniform(-0.4, 0.4, 2) * radius
    target = (float(off[0]), float(off[1]), float((0.4 + 0.6 * aim) * view.inside.edge))
    pose: SiloPose = looking(x, y, target)
    return Site(view, Placement(x, y, "random", pose), float(draw.uniform(0.05, 0.5)), seed, known)


def row(here: Site, draws: int) -> tuple[Vector, tuple[str, ...]] | None:
    """What is foreseen over the scatter, and the table's line; None where too few frames are answered."""
    told = here.foreseen()
    errors = np.array(list(here.errors(draws))).reshape(-1, 4) if told is not None else np.empty((0, 4))
    if told is None or len(errors) < FEWEST:
        return None
    ratio = told / spread(errors.T @ errors / len(errors), here.view.inside.lowest)
    away, tilt = math.hypot(here.placement.x, here.placement.y), math.degrees(here.placement.tilt)
    line = (f"{here.known}, {away:.2f} m aside, {tilt:.0f}°, level {100 * here.level:.0f} %", str(len(errors)))
    return ratio, (*line, f"{1e3 * told[2]:.1f}", *(f"{value:.2f}" for value in ratio))


def main() -> None:
    """Prints the table; with --write puts it into the manual."""
    options = trials.arguments(__doc__, places=20, draws=40, first=0)
    lines: list[tuple[str, ...]] = []
    for known in ("exact", "calibrated"):
        ratios: list[Vector] = []
        for seed in range(options.first, options.first + 10 * options.places):
            found = row(site(seed, known), options.draws)
            if found is not None and len(ratios) < options.places:
                ratios.append(found[0])
                if options.list:
                    print(seed, *found[1], flush=True)
            if len(ratios) == options.places:
                break
        inside = np.mean(np.abs(np.log(ratios)) < math.log1p(WITHIN), axis=0)
        low, middle, high = np.quantile(ratios, (0.1, 0.5, 0.9), axis=0)
        cells = [f"{middle[k]:.2f} ({low[k]:.2f}–{high[k]:.2f}), {100 * inside[k]:.0f} %" for k in range(3)]
        lines.append((f"intrinsics {known}", str(len(ratios)), *cells))
    head = (
        "foreseen over scatter: median (10–90 %), within 30 %",
        "places",
        "tilt",
        "place",
        "axis at the bottom",
    )
    trials.publish("plan", trials.table(head, lines), options.write, "benchmarks.plan", PAGE)


if __name__ == "__main__":
    main()
