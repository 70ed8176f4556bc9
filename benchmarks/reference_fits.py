"""The core's least squares against fits that mpmath computes with 50 digits.

python -m benchmarks.reference_fits --write

Cylinders and cones from points with noise: all round and partial arcs, near the origin and far from it, steep and flat
cones. The reference has a formulation of its own: an axis by a point and a direction, moved by small steps across it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import mpmath as mp
import numpy as np
from benchmarks import trials
from numpy.typing import NDArray

from siloscope import SiloPose, _core

Vector = NDArray[np.float64]

DIGITS = 50
POINTS = 80
ENOUGH = mp.mpf(10) ** -30
"""Step, relative, after which the reference is good to far more than a double."""


@dataclass(frozen=True)
class Kind:
    """How data sets are drawn: lengths in m, angles in degrees; a slope is radius a metre of height."""

    name: str
    arc: tuple[float, float]
    away: tuple[float, float]
    slope: tuple[float, float] | None = None


KINDS = (
    Kind("cylinder, all round", (300.0, 360.0), (0.0, 5.0)),
    Kind("cylinder, arc of 40–120°", (40.0, 120.0), (0.0, 5.0)),
    Kind("cylinder, 100–10,000 m from the origin", (120.0, 360.0), (100.0, 10_000.0)),
    Kind("cone, slope 0.3–2", (300.0, 360.0), (0.0, 5.0), (0.3, 2.0)),
    Kind("flat cone, slope 4–12", (300.0, 360.0), (0.0, 5.0), (4.0, 12.0)),
    Kind("cone, arc of 60–120°", (60.0, 120.0), (0.0, 5.0), (0.3, 2.0)),
    Kind("cone, 100–10,000 m from the origin", (120.0, 360.0), (100.0, 10_000.0), (0.3, 4.0)),
)


@dataclass(frozen=True)
class Wall:
    """A cylinder or a cone: an axis by a point and a direction, the radius there, and the slope by which it shrinks."""

    point: mp.matrix
    direction: mp.matrix
    radius: mp.mpf
    slope: mp.mpf | None = None

    @property
    def vertex(self) -> mp.mpf:
        """Distance of the vertex from the point along the axis; 0 without one."""
        return mp.mpf(0) if self.slope is None else self.radius / self.slope


@dataclass(frozen=True)
class DataSet:
    """Points, and the wall that they were drawn from."""

    points: Vector
    pose: SiloPose
    radius: float
    slope: float | None

    @property
    def start(self) -> list[float]:
        """The true wall as the core's parameters (12,)."""
        rest = [math.nan] * 3 + [0.0] * 5
        if self.slope is None:
            rest[0] = self.radius
        else:
            rest[1:3] = [self.slope, self.radius + self.slope * self._height]
        return [self.pose.r_x, self.pose.r_y, self.pose.t_x, self.pose.t_y, *rest]

    @property
    def _height(self) -> float:
        return float(self.pose.to_silo(self.points)[:, 2].mean())


def drawn(kind: Kind, seed: int) -> DataSet:
    """A data set of a kind."""
    draw = np.random.default_rng((seed, KINDS.index(kind), 50))
    radius, height = float(draw.uniform(0.5, 3.0)), float(draw.uniform(0.5, 3.0))
    slope = None if kind.slope is None else float(draw.uniform(*kind.slope))
    if slope is not None:
        height = min(height, 1.2 * radius / slope)
    z = draw.uniform(-0.5, 0.5, POINTS) * height
    angle = math.radians(draw.uniform(*kind.arc)) * draw.uniform(-0.5, 0.5, POINTS) + draw.uniform(-math.pi, math.pi)
    across = radius - (0.0 if slope is None else slope) * z
    silo = np.column_stack([across * np.cos(angle), across * np.sin(angle), z])
    silo += draw.normal(0.0, radius * 10.0 ** draw.uniform(-3.0, -1.7), silo.shape)
    r_x, r_y = draw.uniform(-0.4, 0.4, 2)
    pose = SiloPose(float(r_x), float(r_y), 0.0, 0.0)
    way = draw.normal(size=3)
    moved = silo @ pose.T_silo_camera[:3, :3] + way / np.linalg.norm(way) * draw.uniform(*kind.away)
    middle = moved.mean(axis=0) - pose.to_camera(silo.mean(axis=0))
    shift = pose.T_silo_camera[:3, :3] @ middle
    return DataSet(moved, SiloPose(pose.r_x, pose.r_y, -float(shift[0]), -float(shift[1])), radius, slope)


def by_core(data: DataSet) -> Wall:
    """The core's fit, with the axis' point nearest to the middle of the points."""
    found = _core.orthogonal_fit(data.points, data.start)
    pose = SiloPose(*found[:4].tolist())
    direction, middle = mp.matrix(pose.axis_direction.tolist()), _middle(data)
    point = mp.matrix(pose.axis_point.tolist())
    along = _dot(middle - point, direction)
    if data.slope is None:
        return Wall(point + direction * along, direction, mp.mpf(found[4]))
    slope = mp.mpf(found[5])
    return Wall(point + direction * along, direction, mp.mpf(found[6]) - slope * along, slope)


def by_digits(data: DataSet) -> Wall:
    """The reference: Gauss–Newton steps at 50 digits until they vanish."""
    points = [mp.matrix(row) for row in data.points.tolist()]
    middle = _middle(data)
    direction = mp.matrix(data.pose.axis_direction.tolist())
    direction /= mp.norm(direction)
    point = mp.matrix(data.pose.axis_point.tolist())
    point += direction * _dot(middle - point, direction)
    wall = Wall(point, direction, mp.mpf(data.radius), None if data.slope is None else mp.mpf(data.slope))
    for _ in range(200):
        wall, step = _stepped(wall, points)
        if step < ENOUGH:
            break
    along = _dot(middle - wall.point, wall.direction)
    radius = wall.radius - (0 if wall.slope is None else wall.slope * along)
    return Wall(wall.point + wall.direction * along, wall.direction, radius, wall.slope)


def _stepped(wall: Wall, points: list[mp.matrix]) -> tuple[Wall, mp.mpf]:
    first, second = _across(wall.direction)
    size = 5 if wall.slope is None else 6
    normal, right = mp.zeros(size), mp.zeros(size, 1)
    for point in points:
        off = point - wall.point
        x, y, z = _dot(off, first), _dot(off, second), _dot(off, wall.direction)
        rho = mp.sqrt(x * x + y * y)
        slope = wall.slope or mp.mpf(0)
        stretch = mp.sqrt(1 + slope * slope)
        value = rho - wall.radius + slope * z
        row = [slope * x - z * x / rho, slope * y - z * y / rho, -x / rho, -y / rho, mp.mpf(-1)]
        row += [] if wall.slope is None else [z - value * slope / stretch**2]
        row = [entry / stretch for entry in row]
        for i in range(size):
            right[i] -= row[i] * value / stretch
            for j in range(size):
                normal[i, j] += row[i] * row[j]
    step = mp.lu_solve(normal, right)
    direction = wall.direction + first * step[0] + second * step[1]
    moved = wall.point + first * step[2] + second * step[3]
    grown = None if wall.slope is None else wall.slope + step[5]
    return Wall(moved, direction / mp.norm(direction), wall.radius + step[4], grown), mp.norm(step)


def _across(direction: mp.matrix) -> tuple[mp.matrix, mp.matrix]:
    least = min(range(3), key=lambda k: abs(direction[k]))
    first = mp.matrix([mp.mpf(k == least) for k in range(3)])
    first -= direction * direction[least]
    first /= mp.norm(first)
    d, f = direction, first
    return first, mp.matrix([d[1] * f[2] - d[2] * f[1], d[2] * f[0] - d[0] * f[2], d[0] * f[1] - d[1] * f[0]])


def _dot(a: mp.matrix, b: mp.matrix) -> mp.mpf:
    return sum((a[k] * b[k] for k in range(3)), mp.mpf(0))


def _middle(data: DataSet) -> mp.matrix:
    return mp.matrix(data.points.mean(axis=0).tolist())


def errors(kind: Kind, seed: int) -> tuple[float, float, float, float]:
    """Errors of the core's fit: direction, rad; place, and radius or vertex, over the radius; slope, relative."""
    with mp.workdps(DIGITS):
        data = drawn(kind, seed)
        core, reference = by_core(data), by_digits(data)
        turned = mp.norm(core.direction - reference.direction)
        beside = mp.norm(core.point - reference.point) / data.radius
        length = abs(core.radius - reference.radius) + abs(core.vertex - reference.vertex)
        slope = mp.mpf(0)
        if core.slope is not None and reference.slope is not None:
            slope = abs(core.slope / reference.slope - 1)
        return float(turned), float(beside), float(length / data.radius), float(slope)


def rows(sets: int) -> Iterator[tuple[str, ...]]:
    """Lines of the table, of so many data sets in all."""
    for number, kind in enumerate(KINDS):
        seeds = range(number, sets, len(KINDS))
        worst = np.max([errors(kind, seed) for seed in seeds], axis=0)
        cells = [f"{value:.0e}" if value else "—" for value in worst]
        yield (kind.name, str(len(seeds)), *cells)


def main() -> None:
    """Prints the table; with --write puts it into the manual."""
    options = trials.arguments(__doc__, sets=200)
    head = ("worst error", "data sets", "direction", "place", "radius, vertex", "slope")
    trials.publish("reference fits", trials.table(head, rows(options.sets)), options.write, "benchmarks.reference_fits")


if __name__ == "__main__":
    main()
